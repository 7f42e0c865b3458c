//! One device: configuration, open, exchange, supervision, statistics, close.

mod config;
mod exchange;
mod host;
mod layout;
mod open;
mod statistics;
mod status;
mod supervise;

pub use config::{Config, Timing};
pub use exchange::Exchange;
pub use open::{Driver, DriverError, SlotMap};
pub use statistics::Counters;
pub use status::Code;
pub(crate) use supervise::panic_text;
