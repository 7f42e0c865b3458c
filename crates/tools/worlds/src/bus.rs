//! The lines that a world may have.

/// The line between the two ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Bus {
    /// In one process, by the name of the link.
    Loopback,
    /// Records in every cycle.
    Socket,
    /// Records when something has changed.
    SocketOnChange,
    /// Modbus TCP.
    Modbus,
    /// Modbus RTU over TCP.
    ModbusRtu,
    /// S7.
    S7,
    /// Lines of values that a dispatcher in a separate process forwards.
    Dispatcher,
    /// PROFIBUS DP on a serial line; the controller is the master.
    Profibus,
}

impl Bus {
    /// The names of all buses.
    pub(crate) const NAMES: [&str; 8] = [
        "loopback",
        "socket",
        "on change",
        "modbus",
        "modbus rtu",
        "s7",
        "dispatcher",
        "profibus",
    ];

    /// The name of the bus, as a feature of a world.
    pub(crate) fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// Returns true if one end asks and the other answers.
    pub(crate) fn asks(self) -> bool {
        matches!(
            self,
            Self::Modbus | Self::ModbusRtu | Self::S7 | Self::Profibus
        )
    }

    /// Returns true if each station is asked separately: a unit of Modbus, a slave of PROFIBUS.
    pub(crate) fn has_units(self) -> bool {
        matches!(self, Self::Modbus | Self::ModbusRtu | Self::Profibus)
    }

    /// Returns true if one message carries several stations.
    pub(crate) fn has_stations(self) -> bool {
        matches!(
            self,
            Self::Loopback | Self::Socket | Self::SocketOnChange | Self::Dispatcher
        )
    }
}
