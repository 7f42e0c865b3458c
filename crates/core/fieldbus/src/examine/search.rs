//! Searching for peers that no driver.cfg names.

use super::wire::{Peer, Wire};

/// How the servers of a bus are found.
#[derive(Clone, Copy, Debug)]
pub struct Search {
    /// The name of the bus on a command line, such as `modbus`.
    pub bus: &'static str,
    /// The usual port of its servers.
    pub port: u16,
    /// Asks a peer who it is. Returns nothing if the peer does not speak this bus. Writes nothing.
    pub ask: fn(Searching<'_>) -> Vec<Found>,
    /// How servers that are reached by datagrams are found; `None` for a bus without them.
    pub datagrams: Option<Datagrams>,
}

/// Questions that can be sent to an address of which nothing is known.
#[derive(Clone, Copy, Debug)]
pub struct Datagrams {
    /// The units to ask one after another, until one answers.
    pub units: &'static [u8],
    /// The question to a unit, which any server of the bus answers. Writes nothing.
    pub question: fn(u8) -> Vec<u8>,
}

/// A peer that has accepted a connection.
#[derive(Debug)]
pub struct Searching<'a> {
    /// The peer, for further connections.
    pub peer: Peer,
    /// The first connection.
    pub wire: Wire,
    /// The Modbus units to ask; empty for the usual ones.
    pub units: &'a [u8],
}

/// A device that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The identity that the device reports; empty if it reports none. It is text of the peer.
    pub identity: String,
    /// Further facts, as pairs of a name and a text, such as `unit` and `1`.
    pub facts: Vec<(&'static str, String)>,
    /// The `[fieldbus]` table of a driver.cfg for this device.
    pub stanza: String,
    /// The addresses of other servers that the device names, as it writes them, such as `opc.tcp://press:4840`. They are
    /// text of the peer.
    pub named: Vec<String>,
}

/// A counter of a server that shows what its clients do wrong, with its meaning.
#[derive(Clone, Copy, Debug)]
pub struct Complaint {
    /// The counter in the statistics.
    pub counter: &'static str,
    /// The cause, as a fixed word.
    pub cause: &'static str,
    /// The behaviour of the clients.
    pub what: &'static str,
    /// The correction to make.
    pub next: &'static str,
}
