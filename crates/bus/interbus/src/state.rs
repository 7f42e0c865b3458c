//! The state of an INTERBUS, as its controller board reports it.

use std::fmt;

/// The state bits of a diagnosis, and its parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct State {
    pub(crate) bits: u16,
    pub(crate) parameter: u16,
}

/// The names of the bits, from the lowest on.
const NAMES: [&str; 16] = [
    "USER", "PF", "BUS", "CTRL", "DETECT", "RUN", "ACTIVE", "READY", "BSA", "BASP", "RESULT",
    "SYNC", "DC", "WARN", "QUALITY", "SSINFO",
];

/// RUN, ACTIVE and READY.
const RUNS: u16 = 0xE0;

impl State {
    /// True if the bus exchanges data.
    pub(crate) const fn runs(self) -> bool {
        self.bits & RUNS == RUNS
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}", self.bits)?;
        for (bit, name) in NAMES.iter().enumerate() {
            if self.bits >> bit & 1 != 0 {
                write!(f, " {name}")?;
            }
        }
        write!(f, ", parameter {:04X}", self.parameter)
    }
}

#[cfg(test)]
mod tests {
    use super::State;

    #[test]
    fn a_bus_runs_with_three_bits_and_all_are_told_by_name() {
        let state = |bits| State { bits, parameter: 3 };
        assert!(state(0xE0).runs() && state(0xFFFF).runs());
        assert!(
            [0xC0, 0xA0, 0x60, 0]
                .into_iter()
                .all(|bits| !state(bits).runs())
        );
        assert_eq!(
            state(0x80E2).to_string(),
            "80E2 PF RUN ACTIVE READY SSINFO, parameter 0003"
        );
    }
}
