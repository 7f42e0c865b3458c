//! The loopback: both ends of the line in one process.
//!
//! Two drivers meet by the name of a link, one as Device, one as Controller; or a PLC program is
//! hosted at the other end. It is a real bus in all but the wire: frames of fixed size, a cycle of its
//! own, pulses confirmed when the other end has taken them.

mod free;
mod link;
mod stepped;

pub use free::FreeLoopback;
pub use link::{End, private_link};
pub use stepped::SteppedLoopback;

use tickbus_base::time::Nanos;

/// The bus cycle of a loopback whose driver.cfg states none.
pub const CYCLE: Nanos = Nanos::from_millis(1);
