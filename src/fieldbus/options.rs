//! The `[fieldbus]` table: which bus, and what it needs to know.

use std::path::Path;

use super::tcp::Address;
use super::{At, CYCLE, Role, loopback, modbus, opcua, plugin, s7, socket};
use crate::axis::Axis;
use crate::config::{Collector, Table, Value, did_you_mean, shown};
use crate::signal::{Signal, SignalTable, Station};
use crate::time::Nanos;

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
const BUILT: [&str; 9] = [
    "loopback",
    "socket",
    "plugin",
    "modbus-server",
    "modbus-client",
    "s7-server",
    "s7-client",
    "opcua-server",
    "opcua-client",
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
    /// `kind = "s7-server"`: clients of S7 communication read and write the image.
    S7Server(s7::ServerOptions),
    /// `kind = "s7-client"`: the memory of a CPU is read and written.
    S7Client(s7::ClientOptions),
    /// `kind = "opcua-client"`: a PLC that is an OPC UA server.
    OpcuaClient(opcua::ClientOptions),
    /// `kind = "opcua-server"`: a server for PLCs that are OPC UA clients.
    OpcuaServer(opcua::ServerOptions),
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
            Self::S7Server(_) => "s7-server",
            Self::S7Client(_) => "s7-client",
            Self::OpcuaClient(_) => "opcua-client",
            Self::OpcuaServer(_) => "opcua-server",
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
            Self::S7Server(options) => options.events,
            Self::S7Client(options) => options.events,
            Self::OpcuaClient(options) => options.events,
            Self::OpcuaServer(options) => options.events,
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

    /// The bus cycle where a driver.cfg states none; `None` for a bus whose peer gives the rhythm.
    pub const fn cycle(&self) -> Option<Nanos> {
        match self {
            Self::Loopback(_) => Some(loopback::CYCLE),
            Self::Socket(_) | Self::Plugin(_) | Self::ModbusClient(_) | Self::S7Client(_) => {
                Some(CYCLE)
            }
            Self::ModbusServer(_)
            | Self::S7Server(_)
            | Self::OpcuaClient(_)
            | Self::OpcuaServer(_) => None,
        }
    }

    /// Whether both ends of the bus are in one process.
    pub const fn is_in_process(&self) -> bool {
        matches!(self, Self::Loopback(_))
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
            Self::S7Server(options) => options.set_address(address),
            Self::S7Client(options) => options.set_address(address),
            Self::OpcuaClient(options) => options.set_address(address),
            Self::OpcuaServer(options) => options.set_address(address),
        }
    }

    /// Reads the keys that the bus has in the next of `count` `[[station]]` tables.
    pub fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        match self {
            Self::ModbusServer(options) => options.stations.read_station(count, false, table),
            Self::ModbusClient(options) => options.stations.read_station(count, true, table),
            Self::Socket(options) => options.read_station(table),
            Self::S7Server(options) => options.read_station(count, table),
            Self::S7Client(options) => options.read_station(count, table),
            Self::Loopback(_) | Self::Plugin(_) | Self::OpcuaClient(_) | Self::OpcuaServer(_) => {}
        }
    }

    /// Where a signal of `station` lies, in the bus's own words; empty where those are its address.
    pub fn place(&self, signal: &Signal, station: &Station) -> String {
        match self {
            Self::ModbusServer(options) => options.place(signal),
            Self::ModbusClient(options) => options.place(signal, station.bytes(signal.area)),
            Self::OpcuaClient(options) => options.place(signal, station),
            Self::S7Client(options) => options
                .variable(signal)
                .map(|variable| variable.to_string())
                .unwrap_or_default(),
            _ => String::new(),
        }
    }

    /// What a bus that polls asks for in each cycle, a line for each request; empty for others.
    pub fn requests(&self, table: &SignalTable) -> Vec<String> {
        match self {
            Self::ModbusClient(options) => options.shown_requests(table),
            Self::S7Client(options) => options.shown_requests(table),
            _ => Vec::new(),
        }
    }

    /// The signals that `[fieldbus.at]` lets be written where others are read, each with the one that is read, by their
    /// places in the signal table.
    pub fn both_ways(&self, table: &SignalTable) -> Vec<(usize, usize)> {
        match self {
            Self::ModbusClient(options) => options.both_ways(table),
            Self::S7Client(options) => options.both_ways(table),
            // Two signals of one node are refused.
            _ => Vec::new(),
        }
    }

    /// Takes the lines of `[fieldbus.at]`: where signals lie in the words of the device. Reports addresses that
    /// are none, and that the bus has no addresses of its own.
    pub fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        let kind = self.kind();
        if let Self::S7Client(options) = self {
            options.place_signals(lines, table);
        } else if let Self::ModbusClient(options) = self {
            options.place_signals(lines, table);
        } else if let Self::OpcuaClient(options) = self {
            options.place_signals(lines, table);
        } else if let Some(first) = lines.first() {
            first.wrong(
                format!("the bus \"{kind}\" has no addresses of its own"),
                "remove [fieldbus.at]; each signal lies where its \"address\" says",
            );
        }
    }

    /// Reports what does not go together with the stations, signals and axes of the driver.
    pub fn fit(&self, table: &SignalTable, axes: &[Axis], collector: &Collector<'_>) {
        match self {
            Self::Socket(options) => options.fit(table, axes, collector),
            Self::ModbusServer(options) => options.fit(table, collector),
            Self::ModbusClient(options) => options.fit(table, collector),
            Self::S7Server(options) => options.fit(table, collector),
            Self::S7Client(options) => options.fit(table, collector),
            Self::OpcuaClient(options) => options.fit(table, collector),
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
            Some("s7-server") => s7::ServerOptions::read(table).map(Self::S7Server),
            Some("s7-client") => s7::ClientOptions::read(role, moved, table).map(Self::S7Client),
            Some("plugin") => plugin::Options::read(table).map(Self::Plugin),
            Some("modbus-server") => {
                modbus::ServerOptions::read(role, table).map(Self::ModbusServer)
            }
            Some("modbus-client") => {
                modbus::ClientOptions::read(role, moved, table).map(Self::ModbusClient)
            }
            Some("opcua-client") => opcua::ClientOptions::read(moved, table).map(Self::OpcuaClient),
            Some("opcua-server") => opcua::ServerOptions::read(table).map(Self::OpcuaServer),
            other => {
                table.finish_open();
                report_kind(kind, other?);
                None
            }
        }
    }
}

/// Reads `events` of a bus that knows what was written: whether changes are reported as events, and whether every
/// write is.
pub(super) fn read_events(value: &Value<'_>) -> Option<(bool, bool)> {
    if value.is_boolean() {
        return value.boolean().map(|events| (events, false));
    }
    let right = "write true for every change, \"writes\" for every write, changed or not, or false";
    let text = value.text(right)?;
    if text != "writes" {
        value.wrong(format!("\"{}\" is no kind of events", shown(text)), right);
        return None;
    }
    Some((true, true))
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
