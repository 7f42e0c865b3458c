//! The drum sequencer, after the function block of GE's PLCs.

use tickbus_base::time::Nanos;

/// The unit of fault time-outs: 0.1 s.
const TENTH: i64 = 100_000_000;

/// A drum with `STEPS` steps, each a pattern of 16 outputs.
///
/// Steps are numbered from 1. The words [`active`](Self::active) and [`preset`](Self::preset) may be written
/// by the program as well; unless both are from 1 to `STEPS`, the block has no power flow and changes
/// nothing.
///
/// With power flow: `reset` makes the preset step the active one, and has priority; otherwise a rising `step` turns the
/// drum one step further, from the last to the first. Then `q` is the active step's pattern.
///
/// Where the manuals are silent: a `step` that is already true when the block is enabled is not an edge,
/// `reset` keeps the step's time at 0, and a fault time-out of 0 disables it.
#[derive(Clone, Debug)]
pub struct Drum<const STEPS: usize> {
    /// The active step, 1 to `STEPS`.
    pub active: u16,
    /// The step that `reset` selects, 1 to `STEPS`.
    pub preset: u16,
    /// The active step's pattern, `Q`.
    pub q: u16,
    /// The first followers, `FF`: one bit per step, on only for the active one; `ff[0]` is step 1.
    pub ff: [bool; STEPS],
    /// The drum coil, `DRC`: the block is enabled and the active step is not the preset one.
    pub drum_coil: bool,
    /// The time-out fault, `TFT`: the active step has lasted its fault time-out.
    pub timeout_fault: bool,
    patterns: [u16; STEPS],
    fault: Option<[u16; STEPS]>,
    /// The value of `step` in the last call; `None` if that call was not enabled.
    step_before: Option<bool>,
    /// The step that `entered` refers to; 0 before the first call.
    timed: u16,
    entered: Nanos,
}

impl<const STEPS: usize> Drum<STEPS> {
    /// A drum at step 1, with step 1 preset and no times.
    pub const fn new(patterns: [u16; STEPS]) -> Self {
        Self {
            active: 1,
            preset: 1,
            q: 0,
            ff: [false; STEPS],
            drum_coil: false,
            timeout_fault: false,
            patterns,
            fault: None,
            step_before: None,
            timed: 0,
            entered: Nanos::ZERO,
        }
    }

    /// The same drum with fault time-outs `FTT`, in 0.1 s.
    #[must_use]
    pub const fn with_fault(self, tenths: [u16; STEPS]) -> Self {
        Self {
            fault: Some(tenths),
            ..self
        }
    }

    /// How long the active step has lasted at `now`; 0 in the call that enters it.
    pub fn lasts(&self, now: Nanos) -> Nanos {
        now - self.entered
    }

    /// Evaluates the block and returns its power flow.
    pub fn call(&mut self, now: Nanos, enable: bool, reset: bool, step: bool) -> bool {
        let steps = 1..=STEPS;
        let in_range =
            steps.contains(&usize::from(self.active)) && steps.contains(&usize::from(self.preset));
        if !enable || !in_range {
            self.step_before = None;
            self.drum_coil = false;
            return false;
        }

        let rising = step && self.step_before == Some(false);
        self.step_before = Some(step);
        if reset {
            self.active = self.preset;
        } else if rising {
            self.active = if usize::from(self.active) == STEPS {
                1
            } else {
                self.active + 1
            };
        }

        let index = usize::from(self.active) - 1;
        self.q = self.patterns[index];
        self.ff = [false; STEPS];
        self.ff[index] = true;
        self.drum_coil = self.active != self.preset;

        if reset || self.timed != self.active {
            self.timed = self.active;
            self.entered = now;
            self.timeout_fault = false;
        } else {
            let lasted = |tenths: u16| now - self.entered >= Nanos(TENTH * i64::from(tenths));
            self.timeout_fault = self
                .fault
                .is_some_and(|fault| fault[index] > 0 && lasted(fault[index]));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PATTERNS: [u16; 3] = [0x0001, 0x8000, 0x00F0];

    fn ms(millis: i64) -> Nanos {
        Nanos::from_millis(millis)
    }

    #[test]
    fn each_rising_step_turns_the_drum_once_and_the_last_step_leads_to_the_first() {
        let mut drum = Drum::new(PATTERNS);
        let mut seen = Vec::new();
        for step in [true, true, false, true, true, false, true, false, true] {
            assert!(drum.call(Nanos::ZERO, true, false, step));
            seen.push((drum.active, drum.q));
            assert_eq!(drum.ff.iter().filter(|&&on| on).count(), 1);
            assert!(drum.ff[usize::from(drum.active) - 1]);
            assert_eq!(drum.drum_coil, drum.active != 1);
        }
        let active: Vec<u16> = seen.iter().map(|&(active, _)| active).collect();
        assert_eq!(
            active,
            [1, 1, 1, 2, 2, 2, 3, 3, 1],
            "a step held from the start is no edge"
        );
        assert_eq!((seen[0].1, seen[3].1, seen[6].1), (0x0001, 0x8000, 0x00F0));
    }

    #[test]
    fn reset_selects_the_preset_step_and_has_priority() {
        let mut drum = Drum::new(PATTERNS);
        drum.preset = 2;
        drum.call(Nanos::ZERO, true, false, false);
        assert_eq!(drum.active, 1);
        drum.call(Nanos::ZERO, true, true, true);
        assert_eq!((drum.active, drum.q, drum.drum_coil), (2, 0x8000, false));
        drum.call(Nanos::ZERO, true, false, true);
        assert_eq!(drum.active, 2, "the edge was spent under reset");
    }

    #[test]
    fn out_of_range_words_stop_the_power_flow_and_change_nothing() {
        for (active, preset) in [(0, 1), (4, 1), (2, 0), (2, 4), (u16::MAX, 1)] {
            let mut drum = Drum::new(PATTERNS);
            drum.call(Nanos::ZERO, true, false, false);
            (drum.active, drum.preset) = (active, preset);
            assert!(
                !drum.call(Nanos::ZERO, true, true, true),
                "{active} {preset}"
            );
            assert_eq!(
                (drum.active, drum.q, drum.drum_coil),
                (active, 0x0001, false)
            );
        }
    }

    #[test]
    fn without_enable_it_holds_and_a_step_meanwhile_is_no_edge() {
        let mut drum = Drum::new(PATTERNS);
        drum.call(Nanos::ZERO, true, false, false);
        assert!(!drum.call(Nanos::ZERO, false, false, true));
        drum.call(Nanos::ZERO, true, false, true);
        assert_eq!(drum.active, 1);
    }

    #[test]
    fn fault_times_count_from_entering_the_step() {
        let mut drum = Drum::new(PATTERNS).with_fault([3, 0, 1]);
        let mut times = Vec::new();
        for (now, reset, step) in [
            (0, true, false),
            (50, true, false),
            (149, false, false),
            (150, false, false),
            (350, false, false),
            (360, false, true),
            (361, false, false),
            (999, false, false),
        ] {
            drum.call(ms(now), true, reset, step);
            times.push(drum.timeout_fault);
        }
        assert_eq!(
            times,
            [false, false, false, false, true, false, false, false]
        );
    }

    #[test]
    fn a_step_that_the_program_writes_is_a_new_step() {
        let mut drum = Drum::new(PATTERNS).with_fault([1; 3]);
        drum.call(ms(0), true, false, false);
        drum.call(ms(100), true, false, false);
        assert!(drum.timeout_fault);
        drum.active = 3;
        drum.call(ms(200), true, false, false);
        assert_eq!((drum.q, drum.timeout_fault), (0x00F0, false));
    }
}
