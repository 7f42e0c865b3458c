//! The facts about its driver that a bus gets.

use std::path::Path;
use std::sync::Arc;

use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_image::signal::SignalTable;

use super::{Events, Role};

/// The facts about its driver that a bus gets when it opens.
#[derive(Clone, Copy, Debug)]
pub struct BusSetup<'a> {
    /// The driver's name.
    pub name: &'a str,
    /// The driver's id, unique in its folder.
    pub id: i32,
    /// The folder of its driver.cfg, to which paths are relative.
    pub folder: &'a Path,
    /// The end of the bus that the driver is.
    pub role: Role,
    /// The driver's stations and signals.
    pub table: &'a SignalTable,
    /// The bus cycle, if stated.
    pub cycle: Option<Nanos>,
    /// Data older than this are stale.
    pub max_age: Nanos,
    /// The changes that are reported as events.
    pub events: Events,
    /// The driver's clock, for a stepped bus that waits in real time.
    pub clock: &'a Arc<dyn Clock>,
    /// The program that runs alone at this end; `None` for a simulation, which ticks.
    pub hosted: Option<Hosted<'a>>,
}

/// A PLC program that is hosted alone at an end of a bus.
#[derive(Clone, Copy, Debug)]
pub struct Hosted<'a> {
    /// The interval of the program's scans.
    pub interval: Nanos,
    /// Ends the program, even while its bus waits.
    pub stop: &'a Stop,
}
