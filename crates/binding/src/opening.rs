//! Opening a driver for a simulator in another language.

use std::path::Path;

use tickbus_base::time::Monotonic;
use tickbus_driver::{Code, Driver};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::Role;
use tickbus_image::signal::{Area, Signal};

use crate::refusal::Refusal;

/// The file name in mistakes in the tables handed in by the simulator.
const TABLES: &str = "tables instead of driver.cfg's";

/// Opens the driver that the file describes, with `tables` in place of its own; empty for none.
///
/// # Errors
///
/// `BAD_CONFIG` with every mistake of the file, or why the bus cannot be opened.
pub fn open(path: &Path, tables: &str) -> Result<Driver, Refusal> {
    let config = Config::load(path).and_then(|config| config.overlaid(TABLES, tables));
    let config = config.map_err(|mistakes| {
        Refusal::new(
            Code::BadConfig,
            format!("driver.cfg cannot be used:\n{mistakes}"),
        )
    })?;
    Ok(Driver::open(config, Monotonic::shared())?)
}

/// Whether this end writes the signal.
pub fn is_written(signal: &Signal, role: Role) -> bool {
    match role {
        Role::Device => signal.area == Area::Input,
        Role::Controller => signal.area == Area::Output,
    }
}
