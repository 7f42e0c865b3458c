//! A PLC program behind a process image: scanned by its own thread, or by the simulation's tick.

mod cpu;
mod fit;
mod own_end;
mod program;
mod scan_counters;
mod stepped;
mod thread;
mod unit;

pub(super) use fit::{check_fit, program_error};
pub(super) use program::OtherEnd;
use scan_counters::ScanCounters;
pub(super) use stepped::SteppedHost;
pub(super) use thread::{HostThread, ScanSetup, watchdog};
