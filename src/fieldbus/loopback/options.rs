//! What a driver.cfg says to the loopback bus.

use crate::time::Nanos;

/// When the bus runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Mode {
    /// On a thread and a clock of its own.
    #[default]
    Free,
    /// On the tick's thread, in simulation time.
    Stepped,
}

/// Who is at the other end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Peer {
    /// The driver that names the same link, in the other role.
    Link(String),
    /// A PLC program hosted in this process.
    Program {
        /// Its name.
        name: String,
        /// Its options, as pairs of key and value.
        options: Vec<(String, String)>,
        /// Its scan interval.
        scan: Nanos,
    },
}

/// What a driver.cfg says to the loopback bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// When the bus runs.
    pub mode: Mode,
    /// Who is at the other end.
    pub peer: Peer,
    /// Whether every change that the peer makes is reported as an event, beside the image.
    pub events: bool,
}
