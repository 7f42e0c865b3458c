//! Bridges to the dispatcher of a virtual laboratory, for clients that cannot connect over TCP themselves.
//!
//! [`AsciiBridge`] carries the lines of a client on a serial line, without I/O; [`serial`] connects it with a port.
//! [`mqtt`] turns topics of a broker into the channels of a client. docs/dispatcher.md has a section for users.

mod ascii;
mod lines;
mod link;
pub mod mqtt;
mod outbox;
pub mod serial;
mod speaker;

pub use ascii::{AsciiBridge, LineEnd, Traffic};
pub use speaker::Speaker;
