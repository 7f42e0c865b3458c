//! The bus traits, the port, faults, and one room per bus.

pub use tickbus_bus_dispatcher as dispatcher;
pub use tickbus_bus_hilscher as hilscher;
pub use tickbus_bus_identification as identification;
pub use tickbus_bus_interbus as interbus;
pub use tickbus_bus_modbus as modbus;
pub use tickbus_bus_opcua as opcua;
pub use tickbus_bus_plugin as plugin;
pub use tickbus_bus_profibus as profibus;
pub use tickbus_bus_s7 as s7;
pub use tickbus_bus_sdsp as sdsp;
pub use tickbus_bus_socket as socket;
pub use tickbus_fieldbus::*;
