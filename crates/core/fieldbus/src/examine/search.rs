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
