//! Recording a hosted program: its inputs and outputs in each scan.

use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::Role;
use tickbus_image::signal::{Plan, Slot};
use tickbus_record::{Recorder, Tally};

use super::{Code, DriverError, SlotMap, open};
use tickbus_driver_cfg::Config;

/// The recording of a hosted program, one tick per scan.
pub(super) struct Tape {
    recorder: Recorder,
    reads: Plan,
    writes: Plan,
    edges: Vec<Option<usize>>,
    slots: Vec<Slot>,
    scans: u64,
    /// The time of the first scan: times in the recording count from it.
    begun: Option<Nanos>,
}

impl Tape {
    /// Starts the recording that `config` asks for.
    pub(super) fn start(config: &Config, role: Role) -> Result<Option<Self>, DriverError> {
        let map = SlotMap::new(&config.table, role);
        let (writes, reads) = role.areas();
        let recorder = open::recorder(config, &map, false)?;
        Ok(recorder.map(|recorder| Self {
            recorder,
            reads: Plan::new(&config.table, 0, reads),
            writes: Plan::new(&config.table, 0, writes),
            slots: vec![Slot::default(); map.count],
            edges: map.edges,
            scans: 0,
            begun: None,
        }))
    }

    /// Counts edges of a signal since the previous scan.
    pub(super) fn edges(&mut self, signal: usize, count: u32) {
        if let Some(slot) = self.edges[signal] {
            self.slots[slot] = Slot::from_real(f64::from(count));
        }
    }

    /// Records a scan at `now`.
    pub(super) fn scan(&mut self, now: Nanos, code: Code, inputs: &[u8], outputs: &[u8]) {
        self.reads.decode(inputs, &mut self.slots);
        self.writes.decode(outputs, &mut self.slots);
        self.scans += 1;
        let time = now - *self.begun.get_or_insert(now);
        let none = std::iter::empty();
        self.recorder
            .record(self.scans, time, code.code(), none, &self.slots);
    }

    /// The recorder's counters.
    pub(super) fn tally(&self) -> Arc<Tally> {
        Arc::clone(self.recorder.tally())
    }
}
