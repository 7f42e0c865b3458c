//! The `[fieldbus]` table: which bus, and what it needs to know.

use std::path::Path;

use super::tcp::Address;
use super::{Role, loopback, modbus, plugin, socket};
use crate::axis::Axis;
use crate::config::{Collector, Table, Value, did_you_mean, shown};
use crate::signal::SignalTable;

/// Every bus kind that a driver.cfg may name, in this version or a later one.
pub const KINDS: [&str; 15] = [
    "loopback",
    "socket",
    "plugin",
    "modbus-server",
    "modbus-client",
    "s7-server",
    "s7-client",
    "opcua-server",
    "opcua-client",
    "profibus-device",
    "hilscher-cif",
    "hilscher-cifx",
    "interbus-ddi",
    "sdsp",
    "dispatcher",
];

/// The bus kinds that this version has.
const BUILT: [&str; 5] = [
    "loopback",
    "socket",
    "plugin",
    "modbus-server",
    "modbus-client",
];

/// What the `[fieldbus]` table says to its bus, by bus kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Options {
    /// `kind = "loopback"`: both ends in one process.
    Loopback(loopback::Options),
    /// `kind = "socket"`: records of fixed size over TCP.
    Socket(socket::Options),
    /// `kind = "plugin"`: a vendor's shared library.
    Plugin(plugin::Options),
    /// `kind = "modbus-server"`: clients of Modbus read and write the image.
    ModbusServer(modbus::ServerOptions),
    /// `kind = "modbus-client"`: reads and writes the tables of a Modbus server.
    ModbusClient(modbus::ClientOptions),
}

impl Options {
    /// The bus kind as a driver.cfg names it.
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Loopback(_) => "loopback",
            Self::Socket(_) => "socket",
            Self::Plugin(_) => "plugin",
            Self::ModbusServer(_) => "modbus-server",
            Self::ModbusClient(_) => "modbus-client",
        }
    }

    /// Whether every change that the peer makes is reported as an event, beside the image.
    pub const fn events(&self) -> bool {
        match self {
            Self::Loopback(options) => options.events,
            Self::Socket(options) => options.events,
            Self::Plugin(options) => options.events,
            Self::ModbusServer(options) => options.events,
            Self::ModbusClient(options) => options.events,
        }
    }

    /// The recording that stands in for the peer, as the driver.cfg names it.
    pub fn replayed(&self) -> Option<&Path> {
        match self {
            Self::Loopback(loopback::Options {
                peer: loopback::Peer::Replay(file),
                ..
            }) => Some(file),
            _ => None,
        }
    }

    /// Whether both ends of the bus are in one process.
    pub const fn is_in_process(&self) -> bool {
        match self {
            Self::Loopback(_) => true,
            _ => false,
        }
    }

    /// Takes another address than the driver.cfg names, from a command line.
    ///
    /// # Errors
    ///
    /// The bus has no address, or the text is none.
    pub fn set_address(&mut self, address: &str) -> Result<(), String> {
        match self {
            Self::Loopback(_) | Self::Plugin(_) => Err(format!(
                "the bus \"{}\" has no address; remove \"{address}\" from the command",
                self.kind()
            )),
            Self::Socket(options) => options.set_address(address),
            Self::ModbusServer(options) => options.line.set_address(address, |_| Ok(())),
            Self::ModbusClient(options) => {
                options.line.set_address(address, Address::check_dialled)
            }
        }
    }

    /// Reads the keys that the bus has in the next of `count` `[[station]]` tables.
    pub fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        match self {
            Self::ModbusServer(options) => options.stations.read_station(count, false, table),
            Self::ModbusClient(options) => options.stations.read_station(count, true, table),
            Self::Socket(options) => options.read_station(count, table),
            Self::Loopback(_) | Self::Plugin(_) => {}
        }
    }

    /// Reports what does not go together with the stations, signals and axes of the driver.
    pub fn fit(&self, table: &SignalTable, axes: &[Axis], collector: &Collector<'_>) {
        match self {
            Self::ModbusClient(options) => options.fit(table, collector),
            Self::Socket(options) => options.fit(table, axes, collector),
            _ => {}
        }
    }

    /// Reads the keys of the bus kind that `kind` names, and reports their mistakes. `moved` says that another
    /// address will take the place of the one that is read.
    ///
    /// The table is finished: what is left in it is unknown, unless the bus kind is.
    pub fn read(kind: &Value<'_>, role: Role, moved: bool, table: Table<'_>) -> Option<Self> {
        let known = kind.text(&format!(
            "write the kind of bus in quotes, such as \"{}\"",
            KINDS[0]
        ));
        match known {
            Some("loopback") => loopback::Options::read(role, table).map(Self::Loopback),
            Some("socket") => socket::Options::read(role, moved, table).map(Self::Socket),
            Some("plugin") => plugin::Options::read(table).map(Self::Plugin),
            Some("modbus-server") => {
                modbus::ServerOptions::read(role, table).map(Self::ModbusServer)
            }
            Some("modbus-client") => {
                modbus::ClientOptions::read(role, moved, table).map(Self::ModbusClient)
            }
            other => {
                table.finish_open();
                report_kind(kind, other?);
                None
            }
        }
    }
}

fn report_kind(kind: &Value<'_>, name: &str) {
    if KINDS.contains(&name) {
        let built = BUILT.map(|kind| format!("\"{kind}\"")).join(", ");
        kind.wrong(
            format!("bus kind \"{name}\" is not in this version"),
            format!("this version has {built}"),
        );
    } else {
        kind.wrong(
            format!("bus kind \"{}\" is unknown", shown(name)),
            did_you_mean(name, "bus kinds", &KINDS),
        );
    }
}
