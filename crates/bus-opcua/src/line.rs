//! What a driver.cfg says to an OPC UA bus outside its own table.

use std::path::Path;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::Role;
use tickbus_image::signal::SignalTable;

/// What a bus of the driver needs to know beside its own options.
#[derive(Clone, Copy, Debug)]
pub struct Line<'a> {
    /// The driver's name.
    pub name: &'a str,
    /// The driver's id, by which its own certificate is called.
    pub id: i32,
    /// The folder that relative paths begin at.
    pub directory: &'a Path,
    /// Which end of the line it is.
    pub role: Role,
    /// Its stations and signals.
    pub table: &'a SignalTable,
    /// The bus cycle, if one is stated.
    pub cycle: Option<Nanos>,
}

impl Line<'_> {
    /// The bus cycle.
    pub(super) fn cycle(&self) -> Nanos {
        self.cycle.unwrap_or(Nanos::from_millis(10))
    }
}
