//! Examining a line step by step, as `tickbus doctor` does, and asking unknown peers who they are, as `tickbus find` does.
//!
//! The steps that all buses have in common are here: name, route, port, the order of bytes, the age of values. A bus adds
//! its own in [`BusOptions::examine`](crate::BusOptions::examine). Nothing here writes into a PLC.

mod orders;
mod report;
mod search;
mod serial;
mod values;
mod wire;

pub use orders::Neighbours;
pub use report::{Examination, Step, Verdict};
pub use search::{Complaint, Datagrams, Found, Search, Searching};
pub use values::Round;
pub use wire::{Peer, Plain, Wire, WireEnd};
