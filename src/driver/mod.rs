//! One device: configuration, open, exchange, supervision, statistics, close.

mod config;
mod exchange;
mod frames;
mod host;
mod layout;
mod open;
mod slots;
mod station;
mod statistics;
mod status;
mod supervise;

pub use config::{Config, Timing};
pub use exchange::Exchange;
pub use open::{Driver, DriverError};
pub use slots::SlotMap;
pub use statistics::Counters;
pub use status::Code;
pub(crate) use supervise::panic_text;
