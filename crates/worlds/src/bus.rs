//! The lines that a world may have.

/// The line between the two ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Bus {
    /// By link name, in one process.
    Loopback,
    /// Records in each cycle.
    Socket,
    /// Records when something has changed.
    SocketOnChange,
    /// Modbus TCP.
    Modbus,
    /// Modbus RTU over TCP.
    ModbusRtu,
    /// S7.
    S7,
    /// Lines of values, which a dispatcher in a process of its own passes on.
    Dispatcher,
}

impl Bus {
    /// The names of all.
    pub(crate) const NAMES: [&str; 7] = [
        "loopback",
        "socket",
        "on change",
        "modbus",
        "modbus rtu",
        "s7",
        "dispatcher",
    ];

    /// The name, as a feature of a world.
    pub(crate) fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// Whether one end asks and the other answers.
    pub(crate) fn asks(self) -> bool {
        matches!(self, Self::Modbus | Self::ModbusRtu | Self::S7)
    }

    /// Whether each station is asked by itself: a unit of Modbus.
    pub(crate) fn has_units(self) -> bool {
        matches!(self, Self::Modbus | Self::ModbusRtu)
    }

    /// Whether one message carries several stations.
    pub(crate) fn has_stations(self) -> bool {
        matches!(
            self,
            Self::Loopback | Self::Socket | Self::SocketOnChange | Self::Dispatcher
        )
    }
}
