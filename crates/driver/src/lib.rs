//! One device: configuration, open, exchange, supervision, statistics, close.

mod bus;
mod exchange;
mod extras;
mod faults;
mod frames;
mod heartbeat;
mod host;
mod open;
mod replay;
mod slots;
mod station;
mod statistics;
mod status;
mod supervise;
mod tape;

pub use exchange::Exchange;
pub use host::Host;
pub use open::{Driver, DriverError};
pub use slots::SlotMap;
pub use statistics::{Counters, Snapshot};
pub use status::Code;
pub use supervise::panic_text;
