//! The bus traits, and one room per bus.

mod bus;
mod changes;
mod port;

pub mod loopback;

pub use bus::{Bus, BusError, Free, Stepped};
pub use changes::ChangeEvents;
pub use port::{LinkState, LinkStatus, Port};

/// Which end of the line a driver is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Role {
    /// The machine: writes `%I`, reads `%Q`.
    #[default]
    Device,
    /// The PLC: reads `%I`, writes `%Q`.
    Controller,
}

impl Role {
    /// Both of them.
    pub const ALL: [Self; 2] = [Self::Device, Self::Controller];

    /// Its name in a driver.cfg: `device` or `controller`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Device => "device",
            Self::Controller => "controller",
        }
    }
}

/// What the `[fieldbus]` table says to its bus, by bus kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Options {
    /// `kind = "loopback"`: both ends in one process.
    Loopback(loopback::Options),
}

impl Options {
    /// The bus kind as a driver.cfg names it.
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Loopback(_) => "loopback",
        }
    }
}
