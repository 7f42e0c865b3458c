//! Conditions over time: on edges since the wait began.

use tickbus_image::signal::Slot;
use tickbus_reply::{Condition, Demand};

use super::watch::Watch;

/// The edge counts at the beginning of a wait.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bookmark {
    rises: u64,
    falls: u64,
    changes: u64,
}

impl Bookmark {
    pub(super) fn of(watch: &Watch) -> Self {
        Self {
            rises: watch.rises(),
            falls: watch.falls(),
            changes: watch.changes(),
        }
    }

    /// Returns true if the condition holds for a signal with this history and these slots; edges count from the
    /// bookmark on.
    pub(super) fn finds(self, condition: &Condition, watch: &Watch, slots: &[Slot]) -> bool {
        match &condition.demand {
            Demand::Rises => watch.rises() > self.rises,
            Demand::Falls => watch.falls() > self.falls,
            Demand::Changes => watch.changes() > self.changes,
            _ => condition.holds_for(watch.value(), slots),
        }
    }
}

#[cfg(test)]
mod tests {
    use tickbus_image::signal::{Area, DataType, Signal, SignalTable};

    use super::*;

    #[test]
    fn a_change_counts_from_the_bookmark_on() {
        let phase = Signal::new("Phase", Area::Output, 0, DataType::Int);
        let table = SignalTable::of_one_station(2, 2, vec![phase.clone()]);
        let condition = Condition::parse("Phase changes", &table).expect("a condition");
        let slots = [3.0, 4.0, 3.0].map(Slot::from_real);
        let mut watch = Watch::new(slots[0], &phase);
        let begin = Bookmark::of(&watch);
        watch.look(slots[0], &phase, 1);
        assert!(!begin.finds(&condition, &watch, &slots[..1]));
        watch.look(slots[1], &phase, 2);
        watch.look(slots[2], &phase, 3);
        assert!(begin.finds(&condition, &watch, &slots[2..]));
        assert!(!Bookmark::of(&watch).finds(&condition, &watch, &slots[2..]));
    }
}
