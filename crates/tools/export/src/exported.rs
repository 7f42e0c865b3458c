//! The kinds of bus that the exports distinguish.

use tickbus_bus_modbus as modbus;
use tickbus_bus_opcua as opcua;
use tickbus_bus_s7 as s7;
use tickbus_bus_socket as socket;
use tickbus_driver_cfg::{Options, loopback};

/// The kinds of bus for which the PLC's half of a line differs.
///
/// Every export matches on all variants, so a kind that an export forgets does not compile.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Exported<'a> {
    /// `kind = "loopback"`.
    Loopback,
    /// `kind = "socket"`.
    Socket(&'a socket::Options),
    /// `kind = "modbus-server"`.
    ModbusServer(&'a modbus::ServerOptions),
    /// `kind = "modbus-client"`.
    ModbusClient(&'a modbus::ClientOptions),
    /// `kind = "s7-server"`.
    S7Server(&'a s7::ServerOptions),
    /// `kind = "s7-client"`.
    S7Client(&'a s7::ClientOptions),
    /// `kind = "opcua-client"`.
    OpcuaClient,
    /// `kind = "opcua-server"`.
    OpcuaServer(&'a opcua::ServerOptions),
    /// A bus for which tickbus exports no PLC program: users write that by hand.
    ByHand,
}

impl<'a> Exported<'a> {
    /// The variant for a bus with these options.
    pub(crate) fn of(options: &'a Options) -> Self {
        // Each variant names the type to downcast to.
        let found = options
            .downcast_ref::<loopback::Options>()
            .map(|_| Self::Loopback);
        found
            .or_else(|| options.downcast_ref().map(Self::Socket))
            .or_else(|| options.downcast_ref().map(Self::ModbusServer))
            .or_else(|| options.downcast_ref().map(Self::ModbusClient))
            .or_else(|| options.downcast_ref().map(Self::S7Server))
            .or_else(|| options.downcast_ref().map(Self::S7Client))
            .or_else(|| {
                let client = options.downcast_ref::<opcua::ClientOptions>();
                client.map(|_| Self::OpcuaClient)
            })
            .or_else(|| options.downcast_ref().map(Self::OpcuaServer))
            .unwrap_or(Self::ByHand)
    }

    /// Returns true for a server with the places of a real device.
    pub(crate) fn is_device(self) -> bool {
        match self {
            Self::ModbusServer(options) => !options.at.is_empty(),
            Self::S7Server(options) => !options.variables.is_empty(),
            Self::OpcuaServer(options) => !options.nodes.is_empty(),
            _ => false,
        }
    }
}
