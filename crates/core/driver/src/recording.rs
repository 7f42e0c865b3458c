//! Recordings of a driver's ticks and of a hosted program's scans.

use std::sync::Arc;

use tickbus_base::time::{Clock, Nanos};
use tickbus_image::signal::Area;
use tickbus_record::{Columns, History, Recorder, RecorderError, Rows, When};

use super::{DriverError, SlotMap};
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
    let rows = rows(config, slots, sent);
    let recorder = Recorder::start(options, config.folder(), rows, lossless, clock)?;
    Ok(Some(recorder))
}

fn columns(config: &Config, slots: &SlotMap) -> Columns {
    let role = config.role.name();
    Columns::new(&config.name, role, &config.table, &slots.edges)
}

fn rows(config: &Config, slots: &SlotMap, sent: Option<Area>) -> Rows {
    let columns = columns(config, slots);
    match sent {
        Some(area) => Rows::sending(columns, &config.table, area),
        None => columns.into(),
    }
}

/// Lets the recorder feed a history, if the live page of `config` has one; without a recorder, starts one for that.
pub(super) fn remember(
    config: &Config,
    slots: &SlotMap,
    sent: Option<Area>,
    recorder: &mut Option<Recorder>,
    (lossless, clock): (bool, &Arc<dyn Clock>),
) -> Result<(), RecorderError> {
    let limit = config.page.as_ref().map_or(0, |page| page.history);
    if limit == 0 {
        return Ok(());
    }
    let history = || Arc::new(History::new(columns(config, slots), limit));
    match recorder {
        Some(recorder) if recorder.history().is_some() => {}
        Some(recorder) => recorder.remember(history()),
        none => {
            let rows = rows(config, slots, sent);
            *none = Some(Recorder::in_memory(history(), rows, lossless, clock)?);
        }
    }
    Ok(())
}

/// The ticks that a recording has so far. After a reset, ticks and simulation time continue where the recording was.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Recorded {
    /// The number and the time in the recording at the last reset.
    begin: (u64, Nanos),
    /// The number of the last tick, and the latest time.
    last: (u64, Nanos),
}

impl Recorded {
    /// Returns the number and the time of a tick in the recording.
    pub(super) fn tick(&mut self, number: u64, time: Nanos) -> (u64, Nanos) {
        let (before, begin) = self.begin;
        let tick = (before + number, begin + time);
        // The recorder lets no time go back, so that of a refused tick must not become the next beginning.
        self.last = (tick.0, self.last.1.max(tick.1));
        tick
    }

    /// Returns the number of ticks in the recording from before the last reset.
    pub(super) fn before(&self) -> u64 {
        self.begin.0
    }

    /// Begins to count again, one nanosecond after the last tick: two ticks at the same time would be one in VCD.
    pub(super) fn restart(&mut self) {
        let (number, time) = self.last;
        if number > 0 {
            self.begin = (number, time + Nanos(1));
        }
    }
}
