//! The `[fieldbus]` table: which bus, and what it needs to know.

use super::{Role, loopback};
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
const BUILT: [&str; 1] = ["loopback"];

/// What the `[fieldbus]` table says to its bus, by bus kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Options {
    /// `kind = "loopback"`: both ends in one process.
    Loopback(loopback::Options),
}

impl Options {
    /// The bus kind as a driver.cfg names it.
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Loopback(_) => "loopback",
        }
    }

    /// Reads the keys of the bus kind that `kind` names, and reports their mistakes.
    ///
    /// The table is finished: what is left in it is unknown, unless the bus kind is.
    pub fn read(kind: &Value<'_>, role: Role, table: Table<'_>) -> Option<Self> {
        let known = kind.text(&format!(
            "write the kind of bus in quotes, such as \"{}\"",
            KINDS[0]
        ));
        match known {
            Some("loopback") => loopback::Options::read(role, table).map(Self::Loopback),
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
