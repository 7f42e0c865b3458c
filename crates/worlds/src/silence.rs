//! A logger for worlds that nobody reads. A driver that logs makes its statistics, for which it looks at the clock, and where a thread
//! looks at the clock it may lose the processor: without a logger a world would take another course than where its seed is repeated.

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

/// Sets that logger in this process, unless there is one.
pub(crate) fn begin() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        if log::set_logger(&Silence).is_ok() {
            log::set_max_level(LevelFilter::Info);
        }
    });
}
