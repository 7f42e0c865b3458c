//! Finding the PLCs on a network that the user names, and examining the line of a driver.cfg.
//!
//! | part | contents |
//! |---|---|
//! | [`Target`] | addresses, ranges and names, as a command line has them |
//! | [`find`] | connects to all of them at a bounded rate, and asks those that answer who they are |
//! | [`examine`] | goes along the line of a driver.cfg step by step |
//!
//! A bus knows its own questions: [`Search`](tickbus_fieldbus::examine::Search) and
//! [`BusOptions::examine`](tickbus_fieldbus::BusOptions::examine). Nothing is written to anybody.

mod datagrams;
mod device;
mod doctor;
mod finding;
mod plan;
mod target;

pub use device::Device;
pub use doctor::{Terms, cause, examine};
pub use finding::{Findings, find};
pub use plan::{Plan, RATE};
pub use target::Target;
