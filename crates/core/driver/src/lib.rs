//! One device: configuration, open, exchange, supervision, statistics, close.

mod bus;
mod bus_handle;
mod controller;
mod driver;
mod error;
mod exchange;
mod extras;
mod frames;
mod heartbeat;
mod host;
mod inject;
mod line;
#[cfg(test)]
mod model_faults_tests;
mod open;
mod real_time;
mod recording;
mod replay;
mod reset;
mod shape;
mod slots;
mod station;
mod statistics;
mod status;
mod supervise;
#[cfg(test)]
mod swallowed_tests;
mod tap;
mod tick;
mod tick_counters;
mod view;
mod watch;
mod watching;

/// The kinds that this crate's tests use.
#[cfg(test)]
static KINDS: tickbus_driver_cfg::Kinds =
    tickbus_driver_cfg::Kinds::LOOPBACK.with_programs(tickbus_programs::PROGRAMS);

pub use controller::Host;
pub use driver::Driver;
pub use error::DriverError;
pub use line::{Line, Untaken};
pub use slots::SlotMap;
pub use statistics::{LineEnd, Snapshot};
pub use status::Code;
pub use supervise::panic_text;
pub use tick::Exchange;
pub use tick_counters::TickCounters;
pub use view::{FailSafeValues, StationView, View};
pub use watch::{Force, Watch};
