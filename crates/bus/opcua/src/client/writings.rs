//! The written values: changed signals, in one Write.

use opcua::types::{AttributeId, DataValue, NodeId, NumericRange, StatusCode, WriteValue};

use crate::pki::meaning;
use crate::values;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::{Port, Receipt};
use tickbus_image::signal::{Area, RawValues, SignalTable};

use super::Field;

/// The signals that are written, and the server's current values.
#[derive(Debug)]
pub(super) struct Writings {
    values: RawValues,
    /// The bits that the server has accepted; `None` for none yet.
    known: Vec<Option<u64>>,
    /// The pending Write: indices of signals, and their bits, with the receipt of their frames.
    flight: Option<(Vec<(usize, u64)>, Receipt)>,
    /// The signals that the server refuses, as last logged.
    refused: Vec<Option<StatusCode>>,
}

impl Writings {
    /// Writings without any accepted values.
    pub(super) fn new(table: &SignalTable, area: Area) -> Self {
        let count = table.signals.len();
        Self {
            values: RawValues::new(table, area),
            known: vec![None; count],
            flight: None,
            refused: vec![None; count],
        }
    }

    /// True if an answer is pending.
    pub(super) fn is_under_way(&self) -> bool {
        self.flight.is_some()
    }

    /// The values to write now; may be empty. The outgoing frame then counts as sent.
    pub(super) fn due(
        &mut self,
        port: &mut Port,
        now: Nanos,
        fields: &[Field],
        nodes: &[NodeId],
    ) -> Vec<WriteValue> {
        let Some(mut frames) = port.take_all(now) else {
            return Vec::new();
        };
        let mut flight = Vec::new();
        for station in frames.stations() {
            self.values.take(station, frames.frame(station));
            for &signal in self.values.signals(station) {
                let bits = self.values.bits(signal);
                if self.known[signal] != Some(bits) {
                    flight.push((signal, bits));
                }
            }
        }
        let receipt = frames.receipt();
        if flight.is_empty() {
            port.sent(&receipt);
            return Vec::new();
        }
        let write = |&(signal, bits): &(usize, u64)| WriteValue {
            node_id: nodes[signal].clone(),
            attribute_id: AttributeId::Value as u32,
            index_range: NumericRange::None,
            // Without status and timestamps: many servers accept only the bare value.
            value: DataValue::value_only(values::variant(fields[signal].data_type, bits)),
        };
        let list = flight.iter().map(write).collect();
        self.flight = Some((flight, receipt));
        list
    }

    /// The server has answered.
    pub(super) fn answered(
        &mut self,
        port: &mut Port,
        table: &SignalTable,
        statuses: &[StatusCode],
    ) {
        let Some((flight, receipt)) = self.flight.take() else {
            return;
        };
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
        if whole {
            port.sent(&receipt);
        } else {
            for station in 0..port.stations() {
                for &signal in self.values.signals(station) {
                    if self.known[signal].is_some() {
                        let bits = table.signals[signal].address().bits();
                        port.sent(&receipt.bits(station, bits));
                    }
                }
            }
        }
        if self.refused.iter().all(Option::is_none) {
            port.tell("refused", "none");
        }
    }
}
