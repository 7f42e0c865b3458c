//! The arrangement of values in the slots of an exchange.

use tickbus_fieldbus::Role;
use tickbus_image::signal::{SignalTable, Slot};

/// The arrangement of values in the slots that an exchange works on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SlotMap {
    /// The number of slots: one per signal in the order of the table, then one per latched signal that this
    /// end reads.
    pub count: usize,
    /// Per signal, the slot that counts its edges since the last exchange, as a double.
    pub edges: Vec<Option<usize>>,
}

impl SlotMap {
    /// Returns the arrangement for the end with `role`.
    pub fn new(table: &SignalTable, role: Role) -> Self {
        let (_, rx) = role.areas();
        let mut count = table.signals.len();
        let edges = table
            .signals
            .iter()
            .map(|signal| {
                (signal.area == rx && signal.latch.is_some()).then(|| {
                    count += 1;
                    count - 1
                })
            })
            .collect();
        Self { count, edges }
    }

    /// Returns the slots before the first exchange: every signal of `table` has its fail-safe value.
    pub(super) fn initial(&self, table: &SignalTable) -> Vec<Slot> {
        let signals = table.signals.iter().map(|signal| signal.fail_safe);
        let edges = std::iter::repeat(Slot::default());
        signals.chain(edges).take(self.count).collect()
    }
}
