//! The loopback: both ends of the line in one process.
//!
//! Two drivers find each other by the name of a link, one as Device, one as Controller; or a PLC program is hosted at
//! the other end. Except for the wire, the loopback is a real bus: it has frames of fixed size, its own cycle, and
//! pulses that are confirmed when the other end has taken them.

mod free;
mod link;
mod stepped;

pub use free::FreeLoopback;
pub use link::{End, private_link};
pub use stepped::SteppedLoopback;

use tickbus_base::time::Nanos;

/// The default bus cycle of a loopback.
pub const CYCLE: Nanos = Nanos::from_millis(1);
