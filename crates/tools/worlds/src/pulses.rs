//! The times at which an end writes pulses.

use crate::plan::Plan;

/// The pulses of one end in one life.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pulses {
    next: i64,
    /// From one pulse to the next, or from one pair to the next, in ns.
    between: i64,
    /// From the first pulse of a pair to the second, in ns; the first may still be held then.
    within: Option<i64>,
    is_second: bool,
    was_due: bool,
}

impl Pulses {
    /// The pulses of a life that begins at `now`.
    pub(crate) fn new(plan: &Plan, now: i64) -> Self {
        Self {
            next: now + plan.pulses.0,
            between: plan.pulses.0,
            within: plan.features.pairs.then_some(plan.pair.0),
            is_second: false,
            was_due: false,
        }
    }

    /// Returns true if the tick at `now` writes a pulse.
    pub(crate) fn are_due(&mut self, now: i64) -> bool {
        // A tick without a pulse separates the two of a pair.
        let is_apart = self.within.is_none() || !self.was_due;
        self.was_due = now >= self.next && is_apart;
        if self.was_due {
            let within = self.within.filter(|_| !self.is_second);
            self.is_second = within.is_some();
            self.next = now + within.unwrap_or(self.between);
        }
        self.was_due
    }
}
