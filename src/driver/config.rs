//! The driver.cfg of one driver: reading it whole, with every mistake in it.

use std::path::PathBuf;

use crate::fieldbus::{Options, Role};
use crate::signal::SignalTable;
use crate::time::Nanos;

/// All that a driver.cfg says, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// The file that it came from.
    pub path: PathBuf,
    /// The driver's id, unique among the drivers of a folder; positive.
    pub id: i32,
    /// The driver's name, for people.
    pub name: String,
    /// Which end of the bus it is.
    pub role: Role,
    /// Its stations and signals.
    pub table: SignalTable,
    /// Cycle times and time-outs.
    pub timing: Timing,
    /// What the bus itself needs to know.
    pub bus: Options,
}

/// Cycle times and time-outs of a driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Timing {
    /// The bus cycle; `None` leaves it to the bus. Positive.
    pub cycle: Option<Nanos>,
    /// Data from the peer that are older than this are stale. Positive.
    pub max_age: Nanos,
    /// A simulation that has not ticked for longer than this has stopped; `None` never says so.
    pub watchdog: Option<Nanos>,
    /// Waits between attempts to reach the peer again; the last one repeats. Never empty, all
    /// positive.
    pub reconnect: Vec<Nanos>,
}
