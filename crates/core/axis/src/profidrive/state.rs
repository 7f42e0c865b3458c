//! The states of a drive, as the general state diagram of PROFIdrive (IEC 61800-7-203) has them.

/// Bits 0 to 3 of STW1: ON, no coast stop (OFF2), no quick stop (OFF3), enable operation.
const ON: u16 = 1;
const NO_COAST: u16 = 1 << 1;
pub(super) const NO_QUICK_STOP: u16 = 1 << 2;
const ENABLE: u16 = 1 << 3;

/// A state of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// S1: switching on inhibited. OFF1 without OFF2 and OFF3 leads out of it.
    #[default]
    Inhibited,
    /// S2: ready for switching on.
    Ready,
    /// S3: switched on.
    SwitchedOn,
    /// S4: operation.
    Operation,
    /// S5, switching off, along the ramp of OFF1.
    RampStop,
    /// S5, switching off, by the quick stop of OFF3.
    QuickStop,
}

impl State {
    /// The state after this one with these bits of STW1; `stands` is true at standstill.
    pub(super) const fn next(self, stw1: u16, stands: bool) -> Self {
        let on = stw1 & ON != 0;
        let no_coast = stw1 & NO_COAST != 0;
        let no_quick_stop = stw1 & NO_QUICK_STOP != 0;
        let enabled = stw1 & ENABLE != 0;
        match self {
            Self::Inhibited if !on && no_coast && no_quick_stop => Self::Ready,
            Self::Inhibited => self,
            _ if !no_coast => Self::Inhibited,
            Self::Ready | Self::SwitchedOn if !no_quick_stop => Self::Inhibited,
            Self::Ready if on => Self::SwitchedOn,
            Self::SwitchedOn if !on => Self::Ready,
            Self::SwitchedOn if enabled => Self::Operation,
            Self::Operation | Self::RampStop if !no_quick_stop => Self::QuickStop,
            Self::Operation if !on => Self::RampStop,
            Self::Operation if !enabled => Self::SwitchedOn,
            Self::RampStop if on && enabled => Self::Operation,
            Self::RampStop if stands || !enabled => Self::Ready,
            Self::QuickStop if stands || !enabled => Self::Inhibited,
            _ => self,
        }
    }

    /// True while the motor is under the drive's control; otherwise it coasts.
    pub(super) const fn has_power(self) -> bool {
        matches!(self, Self::Operation | Self::RampStop | Self::QuickStop)
    }

    /// Bits 0 to 2 and 6 of ZSW1.
    pub(super) const fn bits(self) -> u16 {
        match self {
            Self::Inhibited => 1 << 6,
            Self::Ready => 0b001,
            Self::SwitchedOn | Self::RampStop | Self::QuickStop => 0b011,
            Self::Operation => 0b111,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::State::{Inhibited, Operation, QuickStop, RampStop, Ready, SwitchedOn};

    /// The transitions of the profile's diagram, and what stays: state, bits 0 to 3 of STW1, standstill, next state.
    #[test]
    fn the_states_follow_each_other_as_in_the_diagram_of_the_profile() {
        for (state, stw1, stands, next) in [
            // ON is no way out of S1, nor is OFF1 with a coast stop or a quick stop.
            (Inhibited, 0b1111, true, Inhibited),
            (Inhibited, 0b0100, true, Inhibited),
            (Inhibited, 0b0010, true, Inhibited),
            (Inhibited, 0b0110, true, Ready),
            (Inhibited, 0b1110, true, Ready),
            (Ready, 0b0110, true, Ready),
            (Ready, 0b0111, true, SwitchedOn),
            (Ready, 0b0100, true, Inhibited),
            (Ready, 0b0010, true, Inhibited),
            (SwitchedOn, 0b0111, true, SwitchedOn),
            (SwitchedOn, 0b0110, true, Ready),
            (SwitchedOn, 0b1101, true, Inhibited),
            (SwitchedOn, 0b1011, true, Inhibited),
            (SwitchedOn, 0b1111, true, Operation),
            (Operation, 0b1111, true, Operation),
            (Operation, 0b0111, false, SwitchedOn),
            (Operation, 0b1110, false, RampStop),
            (Operation, 0b1011, false, QuickStop),
            (Operation, 0b1010, false, QuickStop),
            (Operation, 0b1101, false, Inhibited),
            (RampStop, 0b1110, false, RampStop),
            (RampStop, 0b1110, true, Ready),
            (RampStop, 0b0110, false, Ready),
            (RampStop, 0b1111, false, Operation),
            (RampStop, 0b1010, false, QuickStop),
            (RampStop, 0b1100, false, Inhibited),
            (QuickStop, 0b1011, false, QuickStop),
            // A quick stop once begun is finished.
            (QuickStop, 0b1111, false, QuickStop),
            (QuickStop, 0b1111, true, Inhibited),
            (QuickStop, 0b0111, false, Inhibited),
            (QuickStop, 0b1101, false, Inhibited),
        ] {
            assert_eq!(
                state.next(stw1, stands),
                next,
                "{state:?} {stw1:04b} {stands}"
            );
        }
    }

    #[test]
    fn each_state_has_its_bits_of_zsw1() {
        let all = [Inhibited, Ready, SwitchedOn, Operation, RampStop, QuickStop];
        let bits = all.map(super::State::bits);
        assert_eq!(bits, [0x40, 1, 3, 7, 3, 3]);
    }
}
