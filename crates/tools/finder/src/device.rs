//! A device that was found, and the times in which one must answer.

use std::net::SocketAddr;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::printable;
use tickbus_fieldbus::examine::Found;

/// The time in which a port must accept a connection. Below one second this is a single packet, as systems repeat it
/// after one second (RFC 6298, 2.1).
pub(crate) const CONNECT: Nanos = Nanos::from_millis(900);

/// The time in which a device must answer a question.
pub(crate) const ANSWER: Nanos = Nanos::from_millis(500);

/// One device that answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// The address of the device.
    pub address: SocketAddr,
    /// The name of the bus.
    pub bus: &'static str,
    /// The identity and further facts, without control characters.
    pub found: Found,
}

/// Texts of a device as text: a terminal or a file must not take them for commands.
pub(crate) fn legible(found: Found) -> Found {
    let Found {
        identity,
        facts,
        stanza,
        named,
    } = found;
    let facts = facts
        .into_iter()
        .map(|(name, text)| (name, printable(&text)));
    Found {
        identity: printable(&identity),
        facts: facts.collect(),
        stanza: stanza.lines().map(|line| printable(line) + "\n").collect(),
        named: named.iter().map(|url| printable(url)).collect(),
    }
}
