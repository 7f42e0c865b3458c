//! Recordings of a driver's ticks and of a hosted program's scans.

use std::sync::Arc;

use tickbus_base::time::{Clock, Nanos};
use tickbus_fieldbus::Role;
use tickbus_image::signal::{Area, Plan, Slot};
use tickbus_record::{Columns, Recorder, RecorderCounters, Rows, When};

use super::{Code, DriverError, SlotMap};
use tickbus_driver_cfg::Config;

/// Starts the recording that `config` asks for. The values of the area `sent` have not passed the codec yet.
pub(super) fn recorder(
    config: &Config,
    slots: &SlotMap,
    sent: Option<Area>,
    lossless: bool,
    clock: &Arc<dyn Clock>,
) -> Result<Option<Recorder>, DriverError> {
    let wanted = config.record.as_ref();
    let Some(options) = wanted.filter(|options| options.when == When::Always) else {
        return Ok(None);
    };
    let columns = Columns::new(
        &config.name,
        config.role.name(),
        &config.table,
        &slots.edges,
    );
    let rows = match sent {
        Some(area) => Rows::sending(columns, &config.table, area),
        None => columns.into(),
    };
    let recorder = Recorder::start(options, config.folder(), rows, lossless, clock)?;
    Ok(Some(recorder))
}

/// The recording of a hosted program, one tick per scan.
pub(super) struct ScanRecorder {
    recorder: Recorder,
    reads: Plan,
    writes: Plan,
    edges: Vec<Option<usize>>,
    slots: Vec<Slot>,
    scans: u64,
    /// The time of the first scan; times in the recording are relative to it.
    begun: Option<Nanos>,
}

impl ScanRecorder {
    /// Starts the recording that `config` asks for. A `lossless` recording makes scans wait instead of dropping them.
    pub(super) fn start(
        config: &Config,
        role: Role,
        lossless: bool,
        clock: &Arc<dyn Clock>,
    ) -> Result<Option<Self>, DriverError> {
        let map = SlotMap::new(&config.table, role);
        let (writes, reads) = role.areas();
        let recorder = recorder(config, &map, None, lossless, clock)?;
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

    /// Returns the recorder's counters.
    pub(super) fn counters(&self) -> Arc<RecorderCounters> {
        Arc::clone(self.recorder.counters())
    }
}
