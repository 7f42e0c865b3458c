//! The `[fieldbus]` table: which bus, and its options.

use std::path::Path;

use crate::loopback;
use tickbus_axis::Axis;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Table, Value, did_you_mean, shown};
use tickbus_bus_modbus as modbus;
use tickbus_bus_opcua as opcua;
use tickbus_bus_plugin as plugin;
use tickbus_bus_s7 as s7;
use tickbus_bus_socket as socket;
use tickbus_fieldbus::tcp::Address;
use tickbus_fieldbus::{At, CYCLE, Role};
use tickbus_image::signal::{Signal, SignalTable, Station};

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

/// The bus options in the `[fieldbus]` table, by bus kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Options {
    /// `kind = "loopback"`: both ends in one process.
    Loopback(loopback::Options),
    /// `kind = "socket"`: records of fixed size over TCP.
    Socket(socket::Options),
    /// `kind = "plugin"`: a vendor's shared library.
    Plugin(plugin::Options),
    /// `kind = "modbus-server"`: Modbus clients read and write the image.
    ModbusServer(modbus::ServerOptions),
    /// `kind = "modbus-client"`: reads and writes the tables of a Modbus server.
    ModbusClient(modbus::ClientOptions),
    /// `kind = "s7-server"`: S7 communication clients read and write the image.
    S7Server(s7::ServerOptions),
    /// `kind = "s7-client"`: reads and writes the memory of a CPU.
    S7Client(s7::ClientOptions),
    /// `kind = "opcua-client"`: for PLCs that are OPC UA servers.
    OpcuaClient(opcua::ClientOptions),
    /// `kind = "opcua-server"`: for PLCs that are OPC UA clients.
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

    /// Whether every change by the peer is reported as an event, in addition to the image.
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

    /// The recording that replaces the peer, as named in the driver.cfg.
    pub fn replayed(&self) -> Option<&Path> {
        match self {
            Self::Loopback(loopback::Options {
                peer: loopback::Peer::Replay(file),
                ..
            }) => Some(file),
            _ => None,
        }
    }

    /// The default bus cycle; `None` for a bus whose peer sets the cycle.
    pub const fn cycle(&self) -> Option<Nanos> {
        match self {
            Self::Loopback(_) => Some(tickbus_fieldbus::loopback::CYCLE),
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

    /// Replaces the address of the driver.cfg by one from a command line.
    ///
    /// # Errors
    ///
    /// The bus has no address, or the text is not an address.
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

    /// Reads the bus's keys from the next of `count` `[[station]]` tables.
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

    /// The address of a signal of `station` in the bus's own terms; empty if that is its image address.
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

    /// The requests of a polling bus in each cycle, one per line; empty for other buses.
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

    /// Reports conflicts with the stations, signals and axes of the driver.
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

    /// Reads the keys of the bus kind that `kind` names, and reports mistakes. `moved` says that the address
    /// will be replaced.
    ///
    /// The table is finished: keys left in it are unknown, unless the bus kind itself is.
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
