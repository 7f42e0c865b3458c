//! The monitored items of clients: the receivers of a change, and the time that a value must be shown to be seen.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use opcua::types::{AttributeId, DataValue, DateTime, NodeId};
use opcua_server::{MonitoredItemHandle, SubscriptionCache};

use tickbus_base::time::Nanos;

/// A node with a value: a signal's, raw or in engineering units.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Variable {
    /// The index of the signal.
    pub(super) signal: usize,
    /// True if the value is in engineering units.
    pub(super) is_scaled: bool,
}

/// The sampling interval of a monitored item, and the time that a value must be shown for the item to see it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rhythm {
    /// The time after a change for which the crate holds the next one back.
    pub(super) sampling: Nanos,
    pub(super) span: Nanos,
}

/// A monitored item.
///
/// async-opcua 0.19 holds back a value whose source time is less than the sampling interval after that of the last
/// value that passed. At the next publish it checks if that interval is over; if not, it never checks again, and the
/// value is not seen until the next one. So a value that may have been held back is reported again when it is due.
#[derive(Debug)]
struct Item {
    rhythm: Rhythm,
    /// The latest source time reported to the item.
    latest: Ticks,
    /// The value that may be held back, and the end of that time.
    held: Option<(Ticks, DataValue)>,
}

impl Item {
    fn sampling(&self) -> Ticks {
        self.rhythm.sampling.0 / NANOS_PER_TICK
    }

    /// A value is reported to the item for the first time.
    fn told(&mut self, value: &DataValue) {
        let source = ticks(value.source_timestamp);
        let now = ticks(value.server_timestamp);
        let free = self.latest.saturating_add(self.sampling());
        if self.held.is_some() || source < free {
            // Values are timestamped by clients' clocks, which may be ahead of this one.
            let due = self.latest.min(now).saturating_add(self.sampling());
            let due = self.held.as_ref().map_or(due, |(due, _)| *due);
            self.held = Some((due, value.clone()));
        }
        self.latest = self.latest.max(source);
    }

    /// The value to report again, with a source time that makes it pass in any case.
    fn due(&mut self, now: Ticks) -> Option<DataValue> {
        let (_, value) = self.held.take_if(|(due, _)| *due <= now)?;
        self.latest = self.latest.saturating_add(self.sampling()).max(now);
        Some(DataValue {
            source_timestamp: Some(DateTime::from(self.latest)),
            ..value
        })
    }
}

/// Time in OPC UA's unit of 100 ns.
type Ticks = i64;

const NANOS_PER_TICK: i64 = 100;

fn ticks(time: Option<DateTime>) -> Ticks {
    time.map_or(0, |time| time.ticks())
}

/// The existing monitored items of each variable.
///
/// The crate has its own list, from which an item is only removed when it is deleted itself; items whose subscription
/// ended as a whole stay in it and still get reports. So changes are reported by this list.
#[derive(Clone, Debug, Default)]
pub(super) struct Watched(Arc<Mutex<Items>>);

#[derive(Debug, Default)]
struct Items {
    of: HashMap<Variable, HashMap<MonitoredItemHandle, Item>>,
    /// The number of items that have ended for any reason.
    ended: usize,
}

impl Watched {
    fn lock(&self) -> MutexGuard<'_, Items> {
        // The table is consistent after every change, so a poisoned lock is safe to use.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// An item was created; its first value has this source time.
    pub(super) fn add(
        &self,
        variable: Variable,
        item: MonitoredItemHandle,
        rhythm: Rhythm,
        first: Option<DateTime>,
    ) {
        let made = Item {
            rhythm,
            latest: ticks(first),
            held: None,
        };
        let of = &mut self.lock().of;
        of.entry(variable).or_default().insert(item, made);
    }

    /// The rhythm of an item was changed.
    pub(super) fn modify(&self, variable: Variable, item: MonitoredItemHandle, rhythm: Rhythm) {
        let mut items = self.lock();
        let of = items.of.get_mut(&variable);
        if let Some(item) = of.and_then(|of| of.get_mut(&item)) {
            item.rhythm = rhythm;
        }
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

    /// The time that the value of a signal must be shown; `None` without subscribers.
    pub(super) fn span(&self, signal: usize) -> Option<Nanos> {
        let items = self.lock();
        let both = [false, true].map(|is_scaled| Variable { signal, is_scaled });
        let spans = both.iter().filter_map(|variable| items.of.get(variable));
        spans
            .flat_map(HashMap::values)
            .map(|item| item.rhythm.span)
            .max()
    }

    /// Reports a value to all subscribers of the variable, which is `node`.
    pub(super) fn tell(
        &self,
        subscriptions: &SubscriptionCache,
        node: &NodeId,
        variable: Variable,
        value: &DataValue,
    ) {
        let mut items = self.lock();
        let Some(of) = items.of.get_mut(&variable) else {
            return;
        };
        for item in of.values_mut() {
            item.told(value);
        }
        let mut notifier = subscriptions.data_notifier();
        if let Some(mut batch) = notifier.notify_for(node, AttributeId::Value) {
            for item in of.keys() {
                batch.data_value_to_item(value.clone(), item);
            }
        }
    }

    /// Reports values again that the crate has held back and would drop.
    pub(super) fn tell_due<'n>(
        &self,
        subscriptions: &SubscriptionCache,
        now: DateTime,
        node: impl Fn(Variable) -> Option<&'n NodeId>,
    ) {
        let mut items = self.lock();
        let mut due = Vec::new();
        for (&variable, of) in &mut items.of {
            for (&handle, item) in of {
                due.extend(item.due(now.ticks()).map(|value| (variable, handle, value)));
            }
        }
        if due.is_empty() {
            return;
        }
        let mut notifier = subscriptions.data_notifier();
        for (variable, handle, value) in due {
            let batch =
                node(variable).and_then(|node| notifier.notify_for(node, AttributeId::Value));
            if let Some(mut batch) = batch {
                batch.data_value_to_item(value, &handle);
            }
        }
    }

    /// The number of ended items that the crate may retain, if no item exists any more; 0 otherwise.
    pub(super) fn left_behind(&self) -> usize {
        let items = self.lock();
        if items.of.is_empty() { items.ended } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rhythm(sampling: i64, span: i64) -> Rhythm {
        Rhythm {
            sampling: Nanos(sampling),
            span: Nanos(span),
        }
    }

    /// A value with these timestamps, in ticks.
    fn value(value: i16, source: Ticks, server: Ticks) -> DataValue {
        DataValue {
            source_timestamp: Some(DateTime::from(source)),
            server_timestamp: Some(DateTime::from(server)),
            ..DataValue::new_now(value)
        }
    }

    /// An item that samples every 10 ticks, with its first value at tick 100.
    fn item() -> Item {
        Item {
            rhythm: rhythm(10 * NANOS_PER_TICK, 0),
            latest: 100,
            held: None,
        }
    }

    #[test]
    fn the_last_value_within_a_sampling_interval_is_told_again_when_it_is_over() {
        let mut item = item();
        item.told(&value(1, 104, 104));
        item.told(&value(2, 107, 107));
        assert_eq!(item.due(109), None);
        let again = item.due(110).expect("it is over");
        assert_eq!(again.value, Some(2_i16.into()));
        assert_eq!(item.due(1000), None, "once is enough");
    }

    #[test]
    fn a_value_that_comes_after_the_sampling_interval_is_told_once() {
        let mut item = item();
        item.told(&value(1, 110, 110));
        assert_eq!(item.due(1000), None);
    }

    #[test]
    fn a_value_that_is_older_than_the_last_one_passes_when_it_is_told_again() {
        let mut item = item();
        // One client's clock is ahead of the next one's.
        item.told(&value(1, 5000, 111));
        item.told(&value(2, 112, 112));
        let again = item.due(122).expect("it is over");
        assert_eq!(again.value, Some(2_i16.into()));
        assert!(ticks(again.source_timestamp) >= 5010);
    }

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
        watched.add(raw, item(1), rhythm(5, 20), None);
        watched.add(scaled, item(2), rhythm(5, 30), None);
        watched.modify(raw, item(1), rhythm(5, 10));
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
        // An item that was never created does not count as ended.
        watched.remove(raw, item(3));
        assert_eq!((watched.span(7), watched.left_behind()), (None, 2));
    }
}
