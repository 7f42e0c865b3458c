//! The phases of the rig's program.

/// What the program is about; the number is shown on `%QB3`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Phase {
    /// No machine answers yet, or no more.
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
    /// Brings all home for the last time.
    Finalise = 6,
    /// May be switched off.
    Parked = 7,
}

impl Phase {
    /// Whether the homing sequence has the word.
    pub(super) fn homes(self) -> bool {
        matches!(self, Self::Home | Self::Recover | Self::Finalise)
    }
}
