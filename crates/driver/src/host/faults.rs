//! Injected faults of a hosted program, which works on frames.

use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::{Fault, FaultBoard, Faults, Slots, TickTime};
use tickbus_image::signal::{Area, DataType, Plan, Signal, SignalTable, Slot};

/// The faults of a program that works on frames, not on slots.
#[derive(Debug)]
pub(super) struct FrameFaults {
    faults: Faults,
    signals: Vec<Signal>,
    writes: Plan,
    reads: Plan,
    slots: Vec<Slot>,
    /// The true inputs.
    truth: Box<[u8]>,
    /// Frames with the bent values, from which single signals are copied.
    sent: Box<[u8]>,
    received: Box<[u8]>,
    begun: Option<Nanos>,
    scans: u64,
}

impl FrameFaults {
    /// The faults of the first station of `table`, for an end that writes and reads these areas; `inputs` are
    /// the bytes that its program sees before its first scan. `None` without faults.
    pub(super) fn new(
        list: &[Fault],
        table: &SignalTable,
        (writes, reads): (Area, Area),
        inputs: &[u8],
        board: Arc<FaultBoard>,
    ) -> Option<Self> {
        if list.is_empty() {
            return None;
        }
        let mut faults = Faults::new(board);
        let slots = Slots {
            table,
            writes,
            edges: &[],
        };
        for fault in list {
            faults
                .add(fault, slots)
                .expect("a driver.cfg has no more faults than a driver");
        }
        let station = &table.stations[0];
        Some(Self {
            faults,
            signals: table.signals.clone(),
            writes: Plan::new(table, 0, writes),
            reads: Plan::new(table, 0, reads),
            slots: table
                .signals
                .iter()
                .map(|signal| signal.fail_safe)
                .collect(),
            truth: inputs.into(),
            sent: vec![0; station.bytes(writes)].into(),
            received: vec![0; station.bytes(reads)].into(),
            begun: None,
            scans: 0,
        })
    }

    /// Begins a scan: restores the true inputs.
    pub(super) fn begin_scan(&mut self, now: Nanos, inputs: &mut [u8], outputs: &[u8]) {
        inputs.copy_from_slice(&self.truth);
        self.scans += 1;
        let moment = TickTime {
            time: now - *self.begun.get_or_insert(now),
            tick: self.scans,
        };
        self.reads.decode(inputs, &mut self.slots);
        self.writes.decode(outputs, &mut self.slots);
        self.faults.begin_tick(moment, &mut self.slots);
    }

    /// The inputs were read: bends them.
    pub(super) fn received(&mut self, inputs: &mut [u8]) {
        self.truth.copy_from_slice(inputs);
        if self.faults.active(false).next().is_none() {
            return;
        }
        self.reads.decode(inputs, &mut self.slots);
        self.faults.received(&mut self.slots);
        self.reads.encode(&self.slots, &mut self.received);
        for signal in self.faults.active(false) {
            take_over(&self.signals[signal], &self.received, inputs);
        }
    }

    /// The outputs are about to be sent: bends them without the program's knowledge.
    pub(super) fn sending(&mut self, outputs: &mut [u8]) {
        if self.faults.active(true).next().is_none() {
            return;
        }
        self.writes.decode(outputs, &mut self.slots);
        self.faults.sending(&mut self.slots);
        self.writes.encode(&self.slots, &mut self.sent);
        for signal in self.faults.active(true) {
            take_over(&self.signals[signal], &self.sent, outputs);
        }
        self.faults.sent(&mut self.slots);
    }
}

/// Copies the bits of one signal.
fn take_over(signal: &Signal, from: &[u8], to: &mut [u8]) {
    if signal.data_type == DataType::Bool {
        let mask = 1 << signal.bit;
        to[signal.byte] = (to[signal.byte] & !mask) | (from[signal.byte] & mask);
    } else {
        let bytes = signal.byte..signal.byte + signal.data_type.size_bytes();
        to[bytes.clone()].copy_from_slice(&from[bytes]);
    }
}
