//! The end of the line that a driver is.

use tickbus_image::signal::Area;

/// The end of the line that a driver is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Role {
    /// The machine: writes `%I`, reads `%Q`.
    #[default]
    Device,
    /// The PLC: reads `%I`, writes `%Q`.
    Controller,
}

impl Role {
    /// Both roles.
    pub const ALL: [Self; 2] = [Self::Device, Self::Controller];

    /// The areas that this end writes and reads.
    pub const fn areas(self) -> (Area, Area) {
        match self {
            Self::Device => (Area::Input, Area::Output),
            Self::Controller => (Area::Output, Area::Input),
        }
    }

    /// The role's name in a driver.cfg: `device` or `controller`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Device => "device",
            Self::Controller => "controller",
        }
    }
}
