//! Connects the image and the nodes.

use std::sync::Arc;

use opcua::types::{DataValue, NodeId, StatusCode, Variant};
use opcua_server::SubscriptionCache;
use opcua_server::address_space::NodeType;

use crate::pki::date;
use crate::values;
use tickbus_base::time::{Nanos, WallClock};
use tickbus_fieldbus::{Frames, Port, Receipt, Role, is_stale};
use tickbus_image::Event;
use tickbus_image::signal::{Plan, RawValues, Scale, Signal, SignalTable, Slot};

use super::manager::Nodes;
use super::space::Places;
use super::watched::{Variable, Watched};
use super::writers::Writers;

/// The time for a due notification to leave.
const TO_LEAVE: Nanos = Nanos::from_millis(100);

/// All signals, with their values in the image and in their nodes.
pub(super) struct Image {
    table: Arc<SignalTable>,
    role: Role,
    sends: RawValues,
    receives: RawValues,
    places: Vec<PublishedSignal>,
    frames: Vec<Box<[u8]>>,
    /// Has the variables with several signals.
    ids: Arc<Places>,
    /// Those of them whose value has changed, by their first signals.
    changed: Vec<usize>,
    show: Show,
    /// True if a write is an event even without a change.
    every_write: bool,
}

/// The place to publish values: the nodes of the crate's server, and their subscribers.
#[derive(Clone)]
pub(super) struct Show {
    pub(super) nodes: Arc<Nodes>,
    pub(super) subscriptions: Arc<SubscriptionCache>,
    pub(super) watched: Watched,
    pub(super) writers: Arc<Writers>,
    pub(super) wall: WallClock,
}

impl Show {
    /// A value with this status, timestamped now.
    fn value(&self, status: StatusCode, value: Variant) -> DataValue {
        let time = date((self.wall)());
        DataValue {
            // Empty if bad, so that the first good value is a change even for subscribers that do not monitor
            // the status.
            value: Some(if status.is_bad() {
                Variant::Empty
            } else {
                value
            }),
            status: Some(status),
            source_timestamp: Some(time),
            server_timestamp: Some(time),
            ..DataValue::default()
        }
    }

    /// Reports values that the sampling intervals of subscribers have held back.
    fn tell_due(&self, places: &[PublishedSignal]) {
        let node = |variable: Variable| {
            let place = &places[variable.signal];
            if variable.is_scaled {
                place.scaled.as_ref().map(|(node, _)| node)
            } else {
                Some(&place.node)
            }
        };
        let now = date((self.wall)());
        self.watched.tell_due(&self.subscriptions, now, node);
    }

    /// Sets a node's value and reports it to subscribers.
    fn put(&self, node: &NodeId, variable: Variable, value: &DataValue) {
        match self.nodes.address_space().write().find_mut(node) {
            Some(NodeType::Variable(shown)) => shown.set_data_value(value.clone()),
            // A method has no value.
            Some(NodeType::Method(_)) => return,
            _ => debug_assert!(false, "every signal has its nodes: {node}"),
        }
        self.watched
            .tell(&self.subscriptions, node, variable, value);
    }
}

/// A signal's nodes, and their current value.
struct PublishedSignal {
    node: NodeId,
    scaled: Option<(NodeId, Scale)>,
    /// The node's value; `None` at first.
    shown: Option<(u64, StatusCode)>,
    /// When the value was set.
    since: Nanos,
    /// True if a client has written the signal.
    written: bool,
}

impl Image {
    /// An image whose nodes have no values yet.
    pub(super) fn new(
        table: &Arc<SignalTable>,
        ids: &Arc<Places>,
        role: Role,
        port: &Port,
        show: Show,
        every_write: bool,
    ) -> Self {
        let (tx, rx) = role.areas();
        let place = |signal: usize| PublishedSignal {
            node: ids.node(signal).clone(),
            scaled: ids.scaled(table, signal),
            shown: None,
            since: Nanos::ZERO,
            written: false,
        };
        let mut receives = RawValues::new(table, rx);
        // Values not written by any client yet are treated as missing.
        let mut slots = vec![Slot::default(); table.signals.len()];
        let frames = (0..port.stations()).map(|station| {
            let plan = Plan::new(table, station, rx);
            let mut frame = vec![0; port.sizes(station).1];
            plan.fail_safe(&mut slots);
            plan.encode(&slots, &mut frame);
            receives.take(station, &frame);
            frame.into()
        });
        let frames = frames.collect();
        Self {
            table: Arc::clone(table),
            role,
            sends: RawValues::new(table, tx),
            receives,
            places: (0..table.signals.len()).map(place).collect(),
            frames,
            ids: Arc::clone(ids),
            changed: Vec::new(),
            show,
            every_write,
        }
    }

    /// A client has left.
    pub(super) fn forget_writers_that_left(&self) {
        self.show.writers.forget_gone();
    }

    /// Continues with another server, whose nodes have no values yet.
    pub(super) fn move_to(&mut self, show: Show) {
        self.show = show;
        for place in &mut self.places {
            place.shown = None;
        }
    }

    /// The number of monitored items that the server retains although no client is connected.
    pub(super) fn left_behind(&self) -> usize {
        self.show.watched.left_behind()
    }

    /// Writes the values of one list to the image, as one commit per station.
    pub(super) fn received(&mut self, port: &mut Port, now: Nanos, list: &[(usize, u64)]) {
        let mut touched = vec![false; self.frames.len()];
        for &(signal, bits) in list {
            // The port itself reports a change.
            if self.every_write && self.receives.bits(signal) == bits {
                let value = slot(&self.table.signals[signal], bits);
                let signal = u32::try_from(signal).expect("tables hold fewer than 2^32 signals");
                port.event(Event {
                    signal,
                    value,
                    time: now,
                });
            }
            self.receives.set(signal, bits);
            let place = &mut self.places[signal];
            place.written = true;
            // The write itself has set this node, but not the one in engineering units.
            place.shown = Some((bits, StatusCode::Good));
            self.put_scaled(signal);
            touched[self.table.signals[signal].station] = true;
        }
        port.together(|port| {
            for (station, _) in touched.iter().enumerate().filter(|(_, touched)| **touched) {
                let frame = &mut self.frames[station];
                self.receives.give(station, frame);
                port.received(station, now, frame);
            }
        });
    }

    /// Updates all nodes. Pulses that every subscriber has had time to see count as sent.
    pub(super) fn show(&mut self, port: &mut Port, now: Nanos) {
        let taken = port.take_all(now);
        if let Some(receipt) = taken.map(|frames| self.take(frames)) {
            self.show_what_is_sent(port, now);
            for (index, signal) in self.table.signals.iter().enumerate() {
                let is_sent = signal.area == self.role.areas().0;
                if is_sent
                    && let Some(span) = self.span(index)
                    && now - self.places[index].since >= span
                {
                    port.sent(&receipt.bits(signal.station, signal.address().bits()));
                }
            }
            if port.is_ending() {
                self.tell_who_has_the_last(port, now);
            }
        }
        for index in 0..self.places.len() {
            let signal = &self.table.signals[index];
            if signal.area == self.role.areas().1 {
                let age = port.peer_age(signal.station, now);
                let stale = is_stale(age, port.max_age(), true);
                let status = match (self.places[index].written, stale) {
                    (false, _) => StatusCode::BadWaitingForInitialData,
                    (true, true) => StatusCode::UncertainLastUsableValue,
                    (true, false) => StatusCode::Good,
                };
                self.put(now, index, self.receives.bits(index), status);
            }
        }
        self.show_wholes();
        self.show.tell_due(&self.places);
    }

    /// The time that the value of a signal must be shown; `None` without subscribers.
    fn span(&self, signal: usize) -> Option<Nanos> {
        let first = self.ids.wholes.first(signal);
        self.show.watched.span(first.unwrap_or(signal))
    }

    /// Updates the variables with several signals, once for all their changes.
    fn show_wholes(&mut self) {
        for first in std::mem::take(&mut self.changed) {
            let signals = self.ids.wholes.signals(first);
            let shown = signals
                .iter()
                .filter_map(|signal| self.places[*signal].shown);
            let mut known = shown
                .map(|(_, status)| status)
                .filter(|status| *status != StatusCode::BadWaitingForInitialData)
                .peekable();
            let status = match known.peek() {
                // Clients have written elements of it; the others have their fail-safe values.
                Some(_) => known
                    .find(|status| !status.is_good())
                    .unwrap_or(StatusCode::Good),
                None => StatusCode::BadWaitingForInitialData,
            };
            let Some(value) = self.ids.wholes.value(first) else {
                continue;
            };
            let variable = Variable {
                signal: first,
                is_scaled: false,
            };
            let value = self.show.value(status, value);
            self.show.put(&self.places[first].node, variable, &value);
        }
    }

    /// Reports to the port the stations whose subscribers have had time to see the last values.
    fn tell_who_has_the_last(&self, port: &mut Port, now: Nanos) {
        for station in 0..self.frames.len() {
            let mut spans = (self.table.signals.iter().enumerate())
                .filter(|(_, signal)| {
                    signal.station == station && signal.area == self.role.areas().0
                })
                .filter_map(|(index, _)| {
                    // No subscriber confirms a value: allow twice its time, and some for a notification to leave.
                    let span = self.span(index)?;
                    Some(now - self.places[index].since >= span + span + TO_LEAVE)
                });
            // A station without spans has no subscribers.
            if spans
                .next()
                .is_some_and(|first| first && spans.all(|seen| seen))
            {
                port.has_last(station);
            }
        }
    }

    /// Updates the nodes of these signals for a client that is reading them: their pulses count as sent.
    pub(super) fn show_to_reader(&mut self, port: &mut Port, now: Nanos, signals: &[usize]) {
        // Values that a client reads are not sent in a cycle, which a fault could lose.
        let all = 0..port.stations();
        let Some(receipt) = port.look(all, now).map(|frames| self.take(frames)) else {
            return;
        };
        self.show_what_is_sent(port, now);
        self.show_wholes();
        for &index in signals {
            let signal = &self.table.signals[index];
            if signal.area == self.role.areas().0 {
                port.sent(&receipt.bits(signal.station, signal.address().bits()));
            }
        }
    }

    /// Takes over the outgoing values.
    fn take(&mut self, mut frames: Frames<'_>) -> Receipt {
        for station in frames.stations() {
            self.sends.take(station, frames.frame(station));
        }
        frames.receipt().of_pulses()
    }

    fn show_what_is_sent(&mut self, port: &Port, now: Nanos) {
        for station in 0..self.frames.len() {
            let status = quality(port, now);
            for at in 0..self.sends.signals(station).len() {
                let index = self.sends.signals(station)[at];
                self.put(now, index, self.sends.bits(index), status);
            }
        }
    }

    /// Sets the nodes of a signal if the value is new, and reports it to subscribers.
    fn put(&mut self, now: Nanos, index: usize, bits: u64, status: StatusCode) {
        let place = &mut self.places[index];
        if place.shown == Some((bits, status)) {
            return;
        }
        if place.shown.is_none_or(|(before, _)| before != bits) {
            place.since = now;
        }
        place.shown = Some((bits, status));
        self.put_scaled(index);
        let raw = values::variant(self.table.signals[index].data_type, bits);
        if let Some(first) = self.ids.wholes.first(index) {
            self.ids.wholes.set(index, raw);
            if !self.changed.contains(&first) {
                self.changed.push(first);
            }
            return;
        }
        let variable = Variable {
            signal: index,
            is_scaled: false,
        };
        let value = self.show.value(status, raw);
        self.show.put(&self.places[index].node, variable, &value);
    }

    /// Updates the node in engineering units from the signal's own node.
    fn put_scaled(&self, index: usize) {
        let place = &self.places[index];
        let (Some((node, scale)), Some((bits, status))) = (&place.scaled, place.shown) else {
            return;
        };
        let raw = values::variant(self.table.signals[index].data_type, bits);
        let scaled = Variant::Double(scale.value(real(&raw)));
        let variable = Variable {
            signal: index,
            is_scaled: true,
        };
        self.show
            .put(node, variable, &self.show.value(status, scaled));
    }
}

/// The quality of the simulation's values.
fn quality(port: &Port, now: Nanos) -> StatusCode {
    let age = port.tick_age(now);
    match port.watchdog() {
        _ if age == Nanos::MAX => StatusCode::BadWaitingForInitialData,
        Some(limit) if age > limit => StatusCode::UncertainSubstituteValue,
        None if age > port.max_age() => StatusCode::UncertainLastUsableValue,
        _ => StatusCode::Good,
    }
}

/// The slot of a signal with these bits, converted to engineering units.
fn slot(signal: &Signal, bits: u64) -> Slot {
    if signal.is_integer_slot() {
        return Slot::from_unsigned(bits);
    }
    let raw = values::variant(signal.data_type, bits);
    let raw = match raw {
        Variant::Boolean(value) => f64::from(u8::from(value)),
        other => real(&other),
    };
    Slot::from_real(signal.scale.map_or(raw, |scale| scale.value(raw)))
}

/// A raw value as a double.
#[expect(
    clippy::cast_precision_loss,
    reason = "as everywhere that values are scaled"
)]
fn real(value: &Variant) -> f64 {
    match *value {
        Variant::SByte(value) => value.into(),
        Variant::Byte(value) => value.into(),
        Variant::Int16(value) => value.into(),
        Variant::UInt16(value) => value.into(),
        Variant::Int32(value) => value.into(),
        Variant::UInt32(value) => value.into(),
        Variant::Float(value) => value.into(),
        Variant::Int64(value) => value as f64,
        Variant::UInt64(value) => value as f64,
        Variant::Double(value) => value,
        _ => 0.0,
    }
}
