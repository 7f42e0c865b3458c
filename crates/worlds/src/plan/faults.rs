//! What the faults of a world mean for it.

use super::Plan;
use crate::faults::{Activity, Effect, Way};

impl Plan {
    /// The faults that are written into the driver.cfg of an end.
    pub(crate) fn fault_sections(&self, end: usize) -> Vec<String> {
        let faults = self.features.faults.iter();
        let faults = faults.filter(|fault| fault.end == end && fault.way == Way::File);
        let sections = faults.map(|fault| {
            format!(
                "[[fault]]\n{}tick = {}\nticks = {}",
                fault.section(),
                fault.first,
                fault.ticks
            )
        });
        sections.collect()
    }

    /// How long faults of the line may hold back what counts as young.
    pub(crate) fn held_by_faults(&self) -> i64 {
        let faults = self.features.faults.iter();
        let held = faults.map(|fault| match fault.effect {
            // A server repeats the answer of up to a second ago, if its client has not asked meanwhile.
            Effect::Duplicate(direction)
                if self.bus.asks() && direction != "in" && self.serves(fault.end) =>
            {
                1_000_000_000
            }
            // Frames are lost, or take the place of the next, by chance: of a server the peer has old values meanwhile.
            Effect::Duplicate(_) | Effect::Drop(_) => self.cycle.0 * 20,
            _ => fault.held(),
        });
        held.sum()
    }

    /// How long faults may delay what an end receives.
    pub(crate) fn delayed_at(&self, end: usize) -> i64 {
        let faults = self.features.faults.iter();
        let delays = faults.filter(|fault| fault.end == end);
        let spans = delays.map(|fault| match fault.effect {
            Effect::Delay(by) => by.0,
            _ => 0,
        });
        spans.sum()
    }

    /// How old values may become besides: slow answers wait for a pulse that nobody has read, for a second at most, and for as
    /// long as it is held.
    pub(crate) fn waits_for_pulses(&self) -> i64 {
        let faults = self.features.faults.iter();
        let slow = faults.filter(|fault| matches!(fault.effect, Effect::SlowAnswers(_)));
        i64::try_from(slow.count()).expect("few") * (1_000_000_000 + self.hold.0)
    }

    /// Whether the line of an end is down at any time.
    pub(crate) fn goes_down(&self, end: usize) -> bool {
        let mut faults = self.features.faults.iter();
        faults.any(|fault| fault.end == end && fault.effect == Effect::LinkDown)
    }

    /// Whether the line of an end is down in a tick.
    pub(crate) fn is_down(&self, end: usize, tick: u64) -> bool {
        self.features.faults.iter().any(|fault| {
            fault.end == end
                && fault.effect == Effect::LinkDown
                && fault.activity(tick) == Activity::Yes
        })
    }

    /// Whether a fault of the line is active at an end.
    pub(crate) fn is_disturbed(&self, end: usize, tick: u64) -> bool {
        self.features.faults.iter().any(|fault| {
            fault.end == end && fault.is_of_line() && fault.activity(tick) != Activity::No
        })
    }

    /// Whether all faults of an end are over, from a tick on.
    pub(crate) fn has_no_more_faults(&self, end: usize, tick: u64) -> bool {
        let mut faults = self.features.faults.iter();
        faults.all(|fault| fault.end != end || fault.is_over(tick))
    }
}
