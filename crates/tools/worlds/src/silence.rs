//! A logger for worlds whose log nobody reads. A driver that logs also makes its statistics, reads the clock for them,
//! and may lose the processor when it does. Without a logger, a world would take another course than when its seed is
//! repeated with one.

use std::sync::Once;

use log::{LevelFilter, Log, Metadata, Record};

struct Silence;

impl Log for Silence {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn log(&self, _: &Record<'_>) {}

    fn flush(&self) {}
}

/// Sets this logger for the process, unless there is one already.
pub(crate) fn begin() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        if log::set_logger(&Silence).is_ok() {
            log::set_max_level(LevelFilter::Info);
        }
    });
}
