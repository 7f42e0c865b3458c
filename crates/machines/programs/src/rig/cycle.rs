//! The treatment cycle: a drum sequencer and the rungs that turn it.

use super::guard::EARLY;
use super::image::command::{
    IM1_INDEX, IM2_INDEX, LA1_CODE_HIGH, LA1_CODE_LOW, LA1_RUN, LA2_RUN, LA2_UP, LAMP, SC1, SC2,
};
use crate::Drum;
use tickbus_base::time::Nanos;
use tickbus_plc::blocks::RTrig;

/// Steps of one cycle.
pub(super) const STEPS: usize = 6;

/// The command word of each step.
const PATTERNS: [u16; STEPS] = [
    // 1: wheel 1 brings the next bottle under lift 1.
    IM1_INDEX,
    // 2: lift 1 carries it up into a sleeve of wheel 2.
    LA1_RUN | SC1,
    // 3: lift 1 releases it and draws back a little.
    LA1_RUN | LA1_CODE_LOW,
    // 4: wheel 2 swaps the bottles.
    IM2_INDEX,
    // 5: lift 1 fetches the treated bottle, while lift 2 takes the new one up to the lamp.
    LA1_RUN | LA1_CODE_HIGH | SC1 | LA2_RUN | LA2_UP | SC2 | LAMP,
    // 6: both lifts go down with what they hold.
    LA1_RUN | LA1_CODE_HIGH | LA1_CODE_LOW | SC1 | LA2_RUN | SC2 | LAMP,
];

/// Each step's fault time-out: 5 s, in 0.1 s.
const FAULT_TENTHS: [u16; STEPS] = [50; STEPS];

/// Drum and rungs.
#[derive(Clone, Debug)]
pub(super) struct Cycle {
    drum: Drum<STEPS>,
    /// The positive transition coils of rungs 2 to 7.
    done: [RTrig; STEPS],
}

impl Cycle {
    /// A cycle at step 1.
    pub(super) fn new() -> Self {
        Self {
            drum: Drum::new(PATTERNS).with_fault(FAULT_TENTHS),
            done: [RTrig::default(); STEPS],
        }
    }

    /// Evaluates the rungs; returns whether this scan completed a cycle.
    ///
    /// Unless `running`, the drum is at step 1, and it still is in the first running scan.
    pub(super) fn call(&mut self, now: Nanos, running: bool, status: u16) -> bool {
        // Rung 1: a Move copies the input word.
        let complete = status;
        // Rungs 2 to 7: the active step AND its "complete" make a pulse of one scan.
        let mut pulse = false;
        for (step, done) in self.done.iter_mut().enumerate() {
            let both = running && self.drum.ff[step] && complete & (1 << step) != 0;
            pulse |= done.call(both);
        }
        // Rung 8: the pulse makes NextStep drop for one scan; its return turns the drum.
        let next_step = !pulse;
        // Rung 9: the drum.
        let step_before = self.drum.active;
        self.drum.call(now, true, !running, next_step);
        running && self.drum.active < step_before
    }

    /// The active step, 1 to 6.
    pub(super) fn step(&self) -> u16 {
        self.drum.active
    }

    /// The command word of the active step, with the code of lift 1 MSB first.
    pub(super) fn command(&self) -> u16 {
        self.drum.q
    }

    /// The active step is reported as complete before the machine can have done it.
    pub(super) fn early(&self, now: Nanos, status: u16) -> bool {
        status & (1 << (self.drum.active - 1)) != 0 && self.drum.lasts(now) < EARLY
    }

    /// The active step has exceeded its time limit.
    pub(super) fn overdue(&self) -> bool {
        self.drum.timeout_fault
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCAN: Nanos = Nanos::from_millis(10);

    #[test]
    fn the_words_are_those_of_the_protocol() {
        assert_eq!(PATTERNS, [0x0001, 0x0024, 0x000C, 0x0080, 0x3C34, 0x343C]);
    }

    #[test]
    fn a_step_follows_one_scan_after_its_complete_bit() {
        let mut cycle = Cycle::new();
        let mut now = Nanos::ZERO;
        let mut steps = Vec::new();
        for (running, status) in [
            (false, 0b1),
            (true, 0),
            (true, 0b10_0000),
            (true, 0b1),
            (true, 0b1),
            (true, 0b1),
            (true, 0b10),
            (true, 0),
        ] {
            now += SCAN;
            assert!(!cycle.call(now, running, status));
            steps.push(cycle.step());
        }
        assert_eq!(steps, [1, 1, 1, 1, 2, 2, 2, 3]);
    }

    #[test]
    fn the_last_step_completes_the_cycle_once() {
        let mut cycle = Cycle::new();
        let mut completed = 0;
        cycle.call(Nanos::ZERO, false, 0);
        for scan in 0..24 {
            let status = 1 << (cycle.step() - 1);
            completed += i32::from(cycle.call(Nanos(scan), true, status));
        }
        assert_eq!((completed, cycle.step()), (2, 1));
        cycle.call(Nanos(24), true, 0b1);
        cycle.call(Nanos(25), true, 0b1);
        assert_eq!(cycle.step(), 2);
        assert!(
            !cycle.call(Nanos(26), false, 0),
            "a reset completes nothing"
        );
        assert_eq!(cycle.step(), 1);
    }
}
