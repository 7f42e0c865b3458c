//! What is written: changed signals, in one Write.

use opcua::types::{AttributeId, DataValue, NodeId, NumericRange, StatusCode, WriteValue};

use crate::pki::meaning;
use crate::values::{self, Values};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::Port;
use tickbus_image::signal::{Area, SignalTable, Slot};

use super::Field;

/// The signals that are written, and the values that the server has.
#[derive(Debug)]
pub(super) struct Writings {
    values: Values,
    /// The bits that the server has accepted; `None` for none yet.
    known: Vec<Option<Slot>>,
    /// The pending Write: indices of signals, and their bits.
    flight: Option<Vec<(usize, Slot)>>,
    /// The signals that the server refuses, as last logged.
    refused: Vec<Option<StatusCode>>,
}

impl Writings {
    /// Nothing written yet.
    pub(super) fn new(table: &SignalTable, area: Area) -> Self {
        let count = table.signals.len();
        Self {
            values: Values::new(table, area),
            known: vec![None; count],
            flight: None,
            refused: vec![None; count],
        }
    }

    /// Whether an answer is pending.
    pub(super) fn is_under_way(&self) -> bool {
        self.flight.is_some()
    }

    /// The values to write now; empty for none. The outgoing frame then counts as sent.
    pub(super) fn due(
        &mut self,
        port: &mut Port,
        now: Nanos,
        fields: &[Field],
        nodes: &[NodeId],
    ) -> Vec<WriteValue> {
        let mut flight = Vec::new();
        for station in 0..port.stations() {
            self.values.take(station, port.outgoing(station, now));
            for &signal in self.values.signals(station) {
                let bits = self.values.bits(signal);
                if self.known[signal] != Some(bits) {
                    flight.push((signal, bits));
                }
            }
        }
        if flight.is_empty() {
            (0..port.stations()).for_each(|station| port.sent(station));
            return Vec::new();
        }
        let write = |&(signal, bits): &(usize, Slot)| WriteValue {
            node_id: nodes[signal].clone(),
            attribute_id: AttributeId::Value as u32,
            index_range: NumericRange::None,
            // Without status and timestamps: many servers accept only the bare value.
            value: DataValue::value_only(values::variant(fields[signal].data_type, bits)),
        };
        let list = flight.iter().map(write).collect();
        self.flight = Some(flight);
        list
    }

    /// The server has answered.
    pub(super) fn answered(
        &mut self,
        port: &mut Port,
        table: &SignalTable,
        statuses: &[StatusCode],
    ) {
        let flight = self.flight.take().unwrap_or_default();
        let mut whole = true;
        for (at, (signal, bits)) in flight.into_iter().enumerate() {
            let status = statuses
                .get(at)
                .copied()
                .unwrap_or(StatusCode::BadUnknownResponse);
            let name = &table.signals[signal].name;
            if status.is_bad() {
                whole = false;
                self.known[signal] = None;
                port.count("opcua.writes_refused");
                if self.refused[signal] != Some(status) {
                    let why = meaning(status);
                    log::warn!(
                        "the server does not take the value of \"{name}\" ({why}); it is tried again"
                    );
                    port.tell("refused", &format!("{name}: {why}"));
                }
                self.refused[signal] = Some(status);
            } else {
                self.known[signal] = Some(bits);
                if self.refused[signal].take().is_some() {
                    log::info!("the server takes the value of \"{name}\" again");
                }
            }
        }
        for station in 0..port.stations() {
            if whole {
                port.sent(station);
                continue;
            }
            for &signal in self.values.signals(station) {
                if self.known[signal].is_some() {
                    let signal = &table.signals[signal];
                    port.sent_bits(station, signal.address().bits());
                }
            }
        }
        if self.refused.iter().all(Option::is_none) {
            port.tell("refused", "none");
        }
    }
}
