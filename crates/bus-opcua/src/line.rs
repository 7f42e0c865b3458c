//! What an OPC UA bus needs from a driver.cfg outside its own table.

use std::path::Path;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::Role;
use tickbus_image::signal::SignalTable;

/// What a bus needs to know about its driver, in addition to its own options.
#[derive(Clone, Copy, Debug)]
pub struct Line<'a> {
    /// The driver's name.
    pub name: &'a str,
    /// The driver's id, part of the name of its certificate.
    pub id: i32,
    /// The folder to which paths are relative.
    pub directory: &'a Path,
    /// Which end of the line it is.
    pub role: Role,
    /// Its stations and signals.
    pub table: &'a SignalTable,
    /// The bus cycle, if stated.
    pub cycle: Option<Nanos>,
}

impl Line<'_> {
    /// The bus cycle.
    pub(super) fn cycle(&self) -> Nanos {
        self.cycle.unwrap_or(Nanos::from_millis(10))
    }
}
