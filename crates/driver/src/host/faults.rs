//! Injected faults of a hosted program, which works on frames.

use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::{Fault, FaultBoard, Faults, Slots, TickTime};
use tickbus_image::signal::{Area, DataType, Plan, Signal, SignalTable, Slot};

/// The faults of a program, which works on frames and not on slots.
#[derive(Debug)]
pub(super) struct FrameFaults {
    pub(super) faults: Faults,
    signals: Vec<Signal>,
    slots: Vec<Slot>,
    stations: Vec<StationFrames>,
    begun: Option<Nanos>,
    scans: u64,
    /// True once the program has written outputs; until then its peer has the fail-safe values.
    has_written: bool,
}

/// The frames of one station.
#[derive(Debug)]
struct StationFrames {
    writes: Plan,
    reads: Plan,
    /// The true inputs.
    truth: Box<[u8]>,
    /// Frames with the bent values; single signals are copied from here.
    sent: Box<[u8]>,
    received: Box<[u8]>,
}

impl FrameFaults {
    /// Creates an empty set of faults for a program at the end that writes and reads these areas. `inputs` are the
    /// bytes that the program sees before its next scan, one slice per station that it serves.
    pub(super) fn new<'a>(
        table: &SignalTable,
        (writes, reads): (Area, Area),
        inputs: impl Iterator<Item = &'a [u8]>,
        board: Arc<FaultBoard>,
    ) -> Self {
        let stations = inputs.zip(&table.stations).enumerate();
        Self {
            faults: Faults::new(board),
            signals: table.signals.clone(),
            slots: table
                .signals
                .iter()
                .map(|signal| signal.fail_safe)
                .collect(),
            stations: stations
                .map(|(index, (inputs, station))| StationFrames {
                    writes: Plan::new(table, index, writes),
                    reads: Plan::new(table, index, reads),
                    truth: inputs.into(),
                    sent: vec![0; station.bytes(writes)].into(),
                    received: vec![0; station.bytes(reads)].into(),
                })
                .collect(),
            begun: None,
            scans: 0,
            has_written: true,
        }
    }

    /// Creates the set with the faults of a driver.cfg; returns `None` if there are no faults.
    pub(super) fn of_list<'a>(
        list: &[Fault],
        table: &SignalTable,
        (writes, reads): (Area, Area),
        inputs: impl Iterator<Item = &'a [u8]>,
        board: Arc<FaultBoard>,
    ) -> Option<Self> {
        if list.is_empty() {
            return None;
        }
        let mut all = Self::new(table, (writes, reads), inputs, board);
        all.has_written = false;
        let slots = Slots {
            table,
            writes,
            edges: &[],
        };
        for fault in list {
            all.faults
                .add(fault, slots)
                .expect("a driver.cfg has no more faults than a driver");
        }
        Some(all)
    }

    /// Begins a scan with these inputs and outputs, and restores the true inputs.
    pub(super) fn begin_scan<'a>(
        &mut self,
        now: Nanos,
        frames: impl Iterator<Item = (&'a mut [u8], &'a [u8])>,
    ) {
        self.scans += 1;
        let moment = TickTime {
            time: now - *self.begun.get_or_insert(now),
            tick: self.scans,
        };
        for (station, (inputs, outputs)) in self.stations.iter().zip(frames) {
            inputs.copy_from_slice(&station.truth);
            station.reads.decode(inputs, &mut self.slots);
            if self.has_written {
                station.writes.decode(outputs, &mut self.slots);
            }
        }
        self.has_written = true;
        self.faults.begin_tick(moment, &mut self.slots);
    }

    /// Bends the inputs after they were read.
    pub(super) fn received<'a>(&mut self, frames: impl Iterator<Item = &'a mut [u8]>) {
        let mut frames: Vec<&mut [u8]> = frames.collect();
        for (station, inputs) in self.stations.iter_mut().zip(&frames) {
            station.truth.copy_from_slice(inputs);
        }
        if self.faults.active(false).next().is_none() {
            return;
        }
        for (station, inputs) in self.stations.iter().zip(&frames) {
            station.reads.decode(inputs, &mut self.slots);
        }
        self.faults.received(&mut self.slots);
        for station in &mut self.stations {
            station.reads.encode(&self.slots, &mut station.received);
        }
        for signal in self.faults.active(false) {
            let signal = &self.signals[signal];
            if let Some(inputs) = frames.get_mut(signal.station) {
                take_over(signal, &self.stations[signal.station].received, inputs);
            }
        }
    }

    /// Prepares the values for [`bend_outputs`](Self::bend_outputs), before the outputs are sent.
    pub(super) fn sending<'a>(&mut self, frames: impl Iterator<Item = &'a [u8]>) {
        if self.faults.active(true).next().is_none() {
            return;
        }
        for (station, outputs) in self.stations.iter().zip(frames) {
            station.writes.decode(outputs, &mut self.slots);
        }
        self.faults.sending(&mut self.slots);
        for station in &mut self.stations {
            station.writes.encode(&self.slots, &mut station.sent);
        }
    }

    /// Bends the outputs of a station; the program does not notice.
    pub(super) fn bend_outputs(&self, station: usize, outputs: &mut [u8]) {
        for signal in self.faults.active(true) {
            let signal = &self.signals[signal];
            if signal.station == station {
                take_over(signal, &self.stations[station].sent, outputs);
            }
        }
    }

    /// Runs after everything was sent.
    pub(super) fn sent(&mut self) {
        self.faults.sent(&mut self.slots);
    }
}

/// Copies the bits of one signal.
pub(super) fn take_over(signal: &Signal, from: &[u8], to: &mut [u8]) {
    if signal.data_type == DataType::Bool {
        let mask = 1 << signal.bit;
        to[signal.byte] = (to[signal.byte] & !mask) | (from[signal.byte] & mask);
    } else {
        let bytes = signal.byte..signal.byte + signal.data_type.size_bytes();
        to[bytes.clone()].copy_from_slice(&from[bytes]);
    }
}
