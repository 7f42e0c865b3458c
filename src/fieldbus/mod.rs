//! The bus traits, and one room per bus.

mod bus;
mod changes;
mod options;
mod port;
mod role;

pub mod loopback;

pub use bus::{Bus, BusError, Free, Stepped};
pub use changes::ChangeEvents;
pub use options::{KINDS, Options};
pub use port::{LinkState, LinkStatus, Port};
pub use role::Role;
