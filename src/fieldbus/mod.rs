//! The bus traits, and one room per bus.

mod bus;
mod changes;
mod port;

pub mod loopback;

pub use bus::{Bus, BusError, Free, Stepped};
pub use changes::ChangeEvents;
pub use port::{LinkState, LinkStatus, Port};

/// Which end of the line a driver is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// The machine: writes `%I`, reads `%Q`.
    Device,
    /// The PLC: writes `%Q`, reads `%I`.
    Controller,
}

impl std::fmt::Display for Role {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Device => "device",
            Self::Controller => "controller",
        })
    }
}
