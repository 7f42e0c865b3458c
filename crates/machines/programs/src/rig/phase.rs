//! The phases of the rig's program.

/// The phase of the program; the number is shown on `%QB3`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Phase {
    /// The machine does not answer yet, or no longer.
    #[default]
    Initialise = 0,
    /// Brings lifts and wheels home.
    Home = 1,
    /// At home; waits for Start.
    Ready = 2,
    /// The drum turns.
    Run = 3,
    /// Stopped by a fault; waits for Reset.
    Abort = 4,
    /// Acknowledges the fault and homes.
    Recover = 5,
    /// Brings lifts and wheels home for the last time.
    Finalise = 6,
    /// The rig may be switched off.
    Parked = 7,
}

impl Phase {
    /// True if the homing sequence controls the outputs.
    pub(super) fn homes(self) -> bool {
        matches!(self, Self::Home | Self::Recover | Self::Finalise)
    }
}
