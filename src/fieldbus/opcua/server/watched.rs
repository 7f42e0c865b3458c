//! The monitored items of clients: who is told of a change, and for how long a value has to be shown.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use opcua::server::{MonitoredItemHandle, SubscriptionCache};
use opcua::types::{AttributeId, DataValue, NodeId};

use crate::time::Nanos;

/// A node that has a value: that of a signal, raw or in engineering units.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Variable {
    /// The position of the signal.
    pub(super) signal: usize,
    /// Whether its value is in engineering units.
    pub(super) is_scaled: bool,
}

/// The items that clients have made and not deleted, for each variable.
///
/// The crate keeps a list of its own, from which an item vanishes only when it is deleted by itself; of those whose
/// subscription ended as a whole it remembers, and tells, every one. So changes are told by this list.
#[derive(Clone, Debug, Default)]
pub(super) struct Watched(Arc<Mutex<Items>>);

#[derive(Debug, Default)]
struct Items {
    of: HashMap<Variable, HashMap<MonitoredItemHandle, Nanos>>,
    /// How many ended, by whichever way.
    ended: usize,
}

impl Watched {
    fn lock(&self) -> MutexGuard<'_, Items> {
        // A table is whole between any two of its changes.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// An item was made: a value has to be shown for `span` to be seen by it.
    pub(super) fn add(&self, variable: Variable, item: MonitoredItemHandle, span: Nanos) {
        let of = &mut self.lock().of;
        of.entry(variable).or_default().insert(item, span);
    }

    /// An item has ended.
    pub(super) fn remove(&self, variable: Variable, item: MonitoredItemHandle) {
        let mut items = self.lock();
        if let Some(of) = items.of.get_mut(&variable) {
            let was_there = of.remove(&item).is_some();
            if of.is_empty() {
                items.of.remove(&variable);
            }
            items.ended += usize::from(was_there);
        }
    }

    /// For how long the value of a signal has to be shown; `None` when nobody subscribes to it.
    pub(super) fn span(&self, signal: usize) -> Option<Nanos> {
        let items = self.lock();
        let both = [false, true].map(|is_scaled| Variable { signal, is_scaled });
        let spans = both.iter().filter_map(|variable| items.of.get(variable));
        spans.flat_map(HashMap::values).max().copied()
    }

    /// Tells all who subscribe to the variable, which is `node`.
    pub(super) fn tell(
        &self,
        subscriptions: &SubscriptionCache,
        node: &NodeId,
        variable: Variable,
        value: &DataValue,
    ) {
        let items = self.lock();
        let Some(of) = items.of.get(&variable) else {
            return;
        };
        let mut notifier = subscriptions.data_notifier();
        if let Some(mut batch) = notifier.notify_for(node, AttributeId::Value) {
            for item in of.keys() {
                batch.data_value_to_item(value.clone(), item);
            }
        }
    }

    /// How many items the crate may still remember, if none is alive; 0 otherwise.
    pub(super) fn left_behind(&self) -> usize {
        let items = self.lock();
        if items.of.is_empty() { items.ended } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_shown_for_the_slowest_of_those_who_watch_either_node_of_its_signal() {
        let watched = Watched::default();
        let item = |monitored_item_id| MonitoredItemHandle {
            subscription_id: 1,
            monitored_item_id,
        };
        let raw = Variable {
            signal: 7,
            is_scaled: false,
        };
        let scaled = Variable {
            is_scaled: true,
            ..raw
        };
        assert_eq!(watched.span(7), None);
        watched.add(raw, item(1), Nanos(10));
        watched.add(scaled, item(2), Nanos(30));
        assert_eq!(
            (watched.span(7), watched.left_behind()),
            (Some(Nanos(30)), 0)
        );
        watched.remove(scaled, item(2));
        assert_eq!(
            (watched.span(7), watched.left_behind()),
            (Some(Nanos(10)), 0)
        );
        watched.remove(raw, item(1));
        // An item that was never made does not count as one that ended.
        watched.remove(raw, item(3));
        assert_eq!((watched.span(7), watched.left_behind()), (None, 2));
    }
}
