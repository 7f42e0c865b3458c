//! The effects of faults on their world.

use super::{Event, Misfortune, Plan};
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

    /// The time for which faults of the line may hold back data that count as young, in ns.
    pub(crate) fn held_by_faults(&self) -> i64 {
        let faults = self.features.faults.iter();
        let is_suspended = |event: &Event| matches!(event.what, Misfortune::Suspend(..));
        let stands_still = self.events.iter().any(is_suspended);
        let held = faults.map(|fault| match fault.effect {
            // A repeated frame is up to a second old if the server's client has not asked in between, or if the process was
            // suspended.
            Effect::Duplicate(direction)
                if stands_still
                    || self.bus.asks() && direction != "in" && self.serves(fault.end) =>
            {
                1_000_000_000
            }
            // Frames are lost, or replace the next one, at random. Meanwhile, the peer of a server has old values.
            Effect::Duplicate(_) | Effect::Drop(_) => self.cycle.0 * 20,
            _ => fault.held(),
        });
        held.sum()
    }

    /// The time by which faults may delay what an end receives, in ns.
    pub(crate) fn delayed_at(&self, end: usize) -> i64 {
        let faults = self.features.faults.iter();
        let delays = faults.filter(|fault| fault.end == end);
        let spans = delays.map(|fault| match fault.effect {
            Effect::Delay(by) => by.0,
            _ => 0,
        });
        spans.sum()
    }

    /// The additional age that values may reach, in ns. Slow answers wait for a pulse that nobody has read: for at most
    /// a second, and for as long as the pulse is held.
    pub(crate) fn waits_for_pulses(&self) -> i64 {
        let faults = self.features.faults.iter();
        let slow = faults.filter(|fault| matches!(fault.effect, Effect::LateValues(_)));
        i64::try_from(slow.count()).expect("few") * (1_000_000_000 + self.hold.0)
    }

    /// Returns true if the line of an end is down at any time.
    pub(crate) fn goes_down(&self, end: usize) -> bool {
        let mut faults = self.features.faults.iter();
        faults.any(|fault| fault.end == end && fault.effect == Effect::LinkDown)
    }

    /// Returns true if the line of an end is down in a tick.
    pub(crate) fn is_down(&self, end: usize, tick: u64) -> bool {
        self.features.faults.iter().any(|fault| {
            fault.end == end
                && fault.effect == Effect::LinkDown
                && fault.activity(tick) == Activity::Yes
        })
    }

    /// Returns true if a fault of the line is, or may be, active at an end in a tick.
    pub(crate) fn is_disturbed(&self, end: usize, tick: u64) -> bool {
        self.features.faults.iter().any(|fault| {
            fault.end == end && fault.is_of_line() && fault.activity(tick) != Activity::No
        })
    }

    /// Returns true if all faults of an end are over from a tick on.
    pub(crate) fn has_no_more_faults(&self, end: usize, tick: u64) -> bool {
        let mut faults = self.features.faults.iter();
        faults.all(|fault| fault.end != end || fault.is_over(tick))
    }
}
