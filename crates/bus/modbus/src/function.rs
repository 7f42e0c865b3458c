//! Function codes and exception codes of the Modbus Application Protocol V1.1b3.

use std::fmt;

/// The longest PDU: function code and data, in bytes.
pub const PDU_LIMIT: usize = 253;

/// Set in the function code of an answer that is an exception.
pub(super) const EXCEPTION_BIT: u8 = 0x80;

/// Most coils or discrete inputs that one request reads.
pub(super) const READ_BITS: usize = 2000;
/// Most registers that one request reads.
pub(super) const READ_REGISTERS: usize = 125;
/// Most coils that one request writes.
pub(super) const WRITE_BITS: usize = 1968;
/// Most registers that one request writes.
pub(super) const WRITE_REGISTERS: usize = 123;
/// Most registers that a request writes which also reads.
pub(super) const READ_WRITE_REGISTERS: usize = 121;
/// Most registers in a queue, without the one that counts them.
pub(super) const QUEUED_REGISTERS: usize = 31;

/// A function that is implemented.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Function {
    /// Read coils.
    ReadCoils = 1,
    /// Read discrete inputs.
    ReadDiscreteInputs = 2,
    /// Read holding registers.
    ReadHoldingRegisters = 3,
    /// Read input registers.
    ReadInputRegisters = 4,
    /// Write one coil.
    WriteCoil = 5,
    /// Write one register.
    WriteRegister = 6,
    /// Read eight bits about the state of the device.
    ReadExceptionStatus = 7,
    /// Test the line, and read and clear the counters of a unit.
    Diagnostics = 8,
    /// Read the number of requests that were carried out.
    CommEventCounter = 11,
    /// Read the last events on the line.
    CommEventLog = 12,
    /// Write coils in a row.
    WriteCoils = 15,
    /// Write registers in a row.
    WriteRegisters = 16,
    /// Read the identification of the server, which only the server's end has.
    ReportServerId = 17,
    /// Read records of files.
    ReadFileRecord = 20,
    /// Write records of files.
    WriteFileRecord = 21,
    /// Set and clear single bits of a register.
    MaskWriteRegister = 22,
    /// Write registers, then read registers.
    ReadWriteRegisters = 23,
    /// Read a queue of registers.
    ReadFifoQueue = 24,
    /// Encapsulated interface; only its kind 14, reading the device identification.
    DeviceIdentification = 43,
}

impl Function {
    /// All functions.
    pub const ALL: [Self; 19] = [
        Self::ReadCoils,
        Self::ReadDiscreteInputs,
        Self::ReadHoldingRegisters,
        Self::ReadInputRegisters,
        Self::WriteCoil,
        Self::WriteRegister,
        Self::ReadExceptionStatus,
        Self::Diagnostics,
        Self::CommEventCounter,
        Self::CommEventLog,
        Self::WriteCoils,
        Self::WriteRegisters,
        Self::ReportServerId,
        Self::ReadFileRecord,
        Self::WriteFileRecord,
        Self::MaskWriteRegister,
        Self::ReadWriteRegisters,
        Self::ReadFifoQueue,
        Self::DeviceIdentification,
    ];

    /// The code, the first byte of a PDU.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The function with this code.
    pub fn of(code: u8) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|function| function.code() == code)
    }

    /// True if the function changes the server's tables: only such functions may be broadcast.
    pub const fn writes(self) -> bool {
        matches!(
            self,
            Self::WriteCoil
                | Self::WriteRegister
                | Self::WriteCoils
                | Self::WriteRegisters
                | Self::MaskWriteRegister
                | Self::ReadWriteRegisters
        )
    }
}

/// Why a server refuses a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Exception(pub u8);

impl Exception {
    /// The function code is unknown.
    pub const ILLEGAL_FUNCTION: Self = Self(1);
    /// The address, or the last one of a range, does not exist.
    pub const ILLEGAL_DATA_ADDRESS: Self = Self(2);
    /// A quantity or value that the function does not allow, or a request of the wrong length.
    pub const ILLEGAL_DATA_VALUE: Self = Self(3);
    /// The server failed.
    pub const SERVER_DEVICE_FAILURE: Self = Self(4);
    /// Accepted, but it will take time.
    pub const ACKNOWLEDGE: Self = Self(5);
    /// The server is busy; the request may be repeated.
    pub const SERVER_DEVICE_BUSY: Self = Self(6);
    /// The gateway has no path to the unit.
    pub const GATEWAY_PATH_UNAVAILABLE: Self = Self(0x0A);
    /// The unit behind a gateway does not answer.
    pub const GATEWAY_TARGET_FAILED: Self = Self(0x0B);

    /// True if the request itself is at fault, so that the server will always refuse it.
    pub const fn is_about_the_request(self) -> bool {
        matches!(
            self,
            Self::ILLEGAL_FUNCTION | Self::ILLEGAL_DATA_ADDRESS | Self::ILLEGAL_DATA_VALUE
        )
    }

    /// True if the same request may succeed a little later.
    pub const fn passes(self) -> bool {
        matches!(
            self,
            Self::ACKNOWLEDGE
                | Self::SERVER_DEVICE_BUSY
                | Self::GATEWAY_PATH_UNAVAILABLE
                | Self::GATEWAY_TARGET_FAILED
        )
    }

    /// The name in the standard; empty if unknown.
    pub const fn name(self) -> &'static str {
        match self {
            Self::ILLEGAL_FUNCTION => "illegal function",
            Self::ILLEGAL_DATA_ADDRESS => "illegal data address",
            Self::ILLEGAL_DATA_VALUE => "illegal data value",
            Self::SERVER_DEVICE_FAILURE => "server device failure",
            Self::ACKNOWLEDGE => "acknowledge",
            Self::SERVER_DEVICE_BUSY => "server device busy",
            Self(8) => "memory parity error",
            Self::GATEWAY_PATH_UNAVAILABLE => "gateway path unavailable",
            Self::GATEWAY_TARGET_FAILED => "gateway target device failed to respond",
            Self(_) => "",
        }
    }
}

impl fmt::Display for Exception {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "exception {:02X}", self.0)?;
        match self.name() {
            "" => Ok(()),
            name => write!(f, " ({name})"),
        }
    }
}
