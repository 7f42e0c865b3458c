//! The end of the line that a driver is.

use tickbus_base::Mistake;
use tickbus_image::signal::Area;

/// An observer's way to write, in the description of its line.
pub const OBSERVES: &str = "observes, and can write nothing";

/// The end of the line that a driver is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Role {
    /// The machine: writes `%I`, reads `%Q`.
    #[default]
    Device,
    /// The PLC: reads `%I`, writes `%Q`.
    Controller,
    /// Neither: reads `%I` and `%Q` of a PLC that runs, and writes nothing.
    ///
    /// Its signal table is [an observer's](tickbus_image::signal::SignalTable::observed): all signals are in the area
    /// that it reads, and the frame that it writes has no bytes.
    Observer,
}

impl Role {
    /// All roles.
    pub const ALL: [Self; 3] = [Self::Device, Self::Controller, Self::Observer];

    /// Both ends of a line, between which values go to and fro.
    pub const ENDS: [Self; 2] = [Self::Device, Self::Controller];

    /// The areas that this end writes and reads. In an observer's table no signal is in the area that it writes.
    pub const fn areas(self) -> (Area, Area) {
        match self {
            Self::Device | Self::Observer => (Area::Input, Area::Output),
            Self::Controller => (Area::Output, Area::Input),
        }
    }

    /// True if this end writes `area` in a driver.cfg as it is written: an observer writes none.
    pub fn writes(self, area: Area) -> bool {
        self != Self::Observer && self.areas().0 == area
    }

    /// Checks that faults, forced signals among them, can be injected at this end.
    ///
    /// # Errors
    ///
    /// This end is an observer, which writes nothing.
    pub fn check_faults(self) -> Result<(), Mistake> {
        if self == Self::Observer {
            return Err(Mistake::new(
                "an observer forces no signals and injects no faults",
                "do that at the machine's or the PLC's end",
            ));
        }
        Ok(())
    }

    /// The role's name in a driver.cfg: `device`, `controller` or `observer`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Device => "device",
            Self::Controller => "controller",
            Self::Observer => "observer",
        }
    }
}
