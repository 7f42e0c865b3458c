//! One device: configuration, open, exchange, supervision, statistics, close.

mod bus;
mod config;
mod exchange;
mod extras;
mod faults;
mod frames;
mod heartbeat;
mod host;
mod layout;
mod open;
mod overlay;
mod replay;
mod slots;
mod station;
mod statistics;
mod status;
mod supervise;
mod tape;
mod timing;

pub use config::{Asked, Config};
pub use exchange::Exchange;
pub use host::Host;
pub use open::{Driver, DriverError};
pub use slots::SlotMap;
pub use statistics::{Counters, Snapshot};
pub use status::Code;
pub(crate) use supervise::panic_text;
pub use timing::Timing;
