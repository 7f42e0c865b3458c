//! Bridges to the dispatcher of a virtual laboratory, for clients that cannot connect over TCP themselves.
//!
//! [`AsciiBridge`] carries the lines of a client at a serial line, and does no I/O; [`serial`] puts it on a port. [`mqtt`]
//! makes topics of a broker the channels of a client.
//! docs/dispatcher.md has a section for users.

mod ascii;
mod lines;
#[cfg(any(unix, feature = "mqtt"))]
mod link;
pub mod mqtt;
mod outbox;
#[cfg(unix)]
pub mod serial;
mod speaker;

pub use ascii::{AsciiBridge, LineEnd, Traffic};
pub use speaker::Speaker;
