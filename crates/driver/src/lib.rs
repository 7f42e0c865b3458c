//! One device: configuration, open, exchange, supervision, statistics, close.

mod bus;
mod bus_handle;
mod controller;
mod driver;
mod error;
mod exchange;
mod extras;
mod faults;
mod frames;
mod gateway;
mod heartbeat;
mod host;
mod open;
mod recording;
mod replay;
mod slots;
mod station;
mod statistics;
mod status;
mod supervise;
mod tick;

pub use controller::Host;
pub use driver::Driver;
pub use error::DriverError;
pub use gateway::{Gateway, GatewayOptions};
pub use slots::SlotMap;
pub use statistics::{Snapshot, TickCounters};
pub use status::Code;
pub use supervise::panic_text;
pub use tick::Exchange;
