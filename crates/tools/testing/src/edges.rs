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
