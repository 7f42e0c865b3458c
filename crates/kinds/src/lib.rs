//! The bus kinds of tickbus: the one list of them, with the PLC programs that are built in.
//!
//! No crate below this one knows the list. Code that reads a driver.cfg takes the list from its caller, and the native
//! library, the command and the Python package hand in this one. A program with a bus of its own hands in
//! [`KINDS`] and that:
//!
//! ```ignore
//! static MINE: Kinds = tickbus_kinds::KINDS.and(&[Kind::of::<my_bus::Options>()]);
//! ```

use tickbus_bus_dispatcher as dispatcher;
use tickbus_bus_hilscher as hilscher;
use tickbus_bus_identification as identification;
use tickbus_bus_interbus as interbus;
use tickbus_bus_modbus as modbus;
use tickbus_bus_opcua as opcua;
use tickbus_bus_plugin as plugin;
use tickbus_bus_profibus as profibus;
use tickbus_bus_s7 as s7;
use tickbus_bus_sdsp as sdsp;
use tickbus_bus_socket as socket;
use tickbus_driver_cfg::{Kind, Kinds};

#[cfg(test)]
mod tests;

/// All kinds: those of these crates, and the loopback, which every list has.
pub static KINDS: Kinds = Kinds::new(&[
    Kind::of::<socket::Options>(),
    Kind::of::<modbus::ServerOptions>(),
    Kind::of::<modbus::ClientOptions>(),
    Kind::of::<s7::ServerOptions>(),
    Kind::of::<s7::ClientOptions>(),
    Kind::of::<opcua::ClientOptions>(),
    Kind::of::<opcua::ServerOptions>(),
    Kind::of::<profibus::Options>(),
    Kind::of::<hilscher::cif::Options>(),
    Kind::of::<hilscher::cifx::Options>(),
    Kind::of::<interbus::Options>(),
    Kind::of::<identification::ClientOptions>(),
    Kind::of::<identification::ReaderOptions>(),
    Kind::of::<sdsp::Options>(),
    Kind::of::<dispatcher::Options>(),
    Kind::of::<plugin::Options>(),
])
.with_programs(tickbus_programs::PROGRAMS)
.with_advice(&[
    ("profinet", CARD),
    ("ethercat", CARD),
    ("ethernet-ip", CARD),
    ("ethernetip", CARD),
    ("canopen", CARD),
    ("devicenet", CARD),
    ("powerlink", CARD),
]);

/// Advice for names of buses that only cards have.
const CARD: &str = "this bus needs a card: kind = \"hilscher-cifx\" (docs/hilscher.md), or \"plugin\" for another vendor's; \
                    docs/which-bus.md lists what suits each PLC";
