//! The `[fieldbus]` table: which bus, and what it needs to know.

use std::path::Path;

use super::{Role, loopback, opcua, plugin, socket};
use crate::config::{Table, Value, did_you_mean, shown};

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
            Self::OpcuaClient(options) => options.set_address(address),
            Self::OpcuaServer(options) => options.set_address(address),
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
            Some("opcua-client") => opcua::ClientOptions::read(table).map(Self::OpcuaClient),
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
