//! Opening a driver for a simulator in another language.

use std::path::Path;

use tickbus_base::time::{Monotonic, Nanos};
use tickbus_driver::{Code, Driver};
use tickbus_driver_cfg::{Config, Kinds};

use crate::refusal::Refusal;

/// The file name that is reported for mistakes in the tables that the simulator handed in.
const TABLES: &str = "tables instead of driver.cfg's";

/// How long closing waits for the log to reach stderr.
const LOG_FLUSH_LIMIT: Nanos = Nanos::from_millis(100);

/// Opens the driver that the file describes, with `tables` in place of its own; an empty text replaces nothing. Both
/// may name only these `kinds` of bus.
///
/// # Errors
///
/// `BAD_CONFIG` with every mistake in the file, or with the reason why the bus cannot be opened.
pub fn open(path: &Path, tables: &str, kinds: &'static Kinds) -> Result<Driver, Refusal> {
    Ok(Driver::open(
        load(path, tables, kinds)?,
        Monotonic::shared(),
    )?)
}

/// Reads the file that describes a driver, with `tables` in place of its own; an empty text replaces nothing. Both may
/// name only these `kinds` of bus.
///
/// # Errors
///
/// `BAD_CONFIG` with every mistake in the file.
pub fn load(path: &Path, tables: &str, kinds: &'static Kinds) -> Result<Config, Refusal> {
    let config = Config::load(path, kinds).and_then(|config| config.overlaid(TABLES, tables));
    config.map_err(|mistakes| {
        Refusal::new(
            Code::BadConfig,
            format!("driver.cfg cannot be used:\n{mistakes}"),
        )
    })
}

/// Calls `close` to close a driver, and waits until its last log messages have reached stderr: the process may end
/// right after this.
pub fn closing<R>(close: impl FnOnce() -> R) -> R {
    let closed = close();
    tickbus_base::os::flush_log(LOG_FLUSH_LIMIT);
    closed
}
