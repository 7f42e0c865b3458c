//! The counters of a driver.

use std::fmt;
use std::sync::Arc;

use super::host::ProgramCounters;
use super::tick_counters::{TickCounters, TickTimes};
use tickbus_base::os::dropped_log_lines;
use tickbus_base::statistics::{Key, Statistics};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::FaultBoard;
use tickbus_fieldbus::{LinkStatus, is_stale};
use tickbus_record::RecorderCounters;

/// The data of a driver's statistics at one moment.
///
/// Copying them takes a microsecond or two, formatting them can take a hundred times as long: a caller that has locked
/// the driver releases it in between.
#[derive(Clone, Debug)]
pub struct Snapshot {
    pub(super) config: Arc<Config>,
    pub(super) counters: TickCounters,
    /// Per station: time since its peer was last heard from, whether its data are valid, and its bus cycles.
    pub(super) stations: Vec<(Nanos, bool, u64)>,
    pub(super) events_lost: u64,
    pub(super) now: Nanos,
    pub(super) samples: TickTimes,
    pub(super) status: LinkStatus,
    pub(super) board: Arc<FaultBoard>,
    pub(super) program: Option<ProgramCounters>,
    pub(super) record: Option<Arc<RecorderCounters>>,
}

impl Snapshot {
    /// Adds the saturated values and the NaN values that the simulator's language binding has converted.
    pub fn add_conversions(&mut self, [saturated, not_a_number]: [u64; 2]) {
        let counters = &mut self.counters;
        counters.saturated = counters.saturated.wrapping_add(saturated);
        counters.not_a_number = counters.not_a_number.wrapping_add(not_a_number);
    }

    /// Returns the statistics.
    pub fn statistics(&self) -> Statistics {
        let ages = self.stations.iter().map(|(age, _, _)| *age);
        self.status.observe(self.now, ages);
        self.gather()
    }

    /// Returns the statistics, without checking how old the stations' data are.
    pub(super) fn gather(&self) -> Statistics {
        self.status.observe_call(self.now);
        let mut statistics = Statistics::default();
        self.counters.write(&mut statistics);
        let cycles = self.stations.iter().map(|(_, _, cycles)| cycles).sum();
        statistics.count("bus_cycles", cycles);
        statistics.count("events_lost", self.events_lost);
        self.status.write(self.now, &mut statistics);
        self.write_stations(&mut statistics);
        self.samples.write(&mut statistics);
        self.board.tell(self.status.driver());
        self.board.write(&mut statistics);
        if let Some(program) = &self.program {
            program.write(&mut statistics);
        }
        if let Some(record) = &self.record {
            record.write(&mut statistics);
        }
        statistics.count("log.dropped", dropped_log_lines());
        statistics
    }

    /// Adds the age of each station's data and its number of bus cycles; adds nothing for a single station.
    fn write_stations(&self, statistics: &mut Statistics) {
        if self.stations.len() < 2 {
            return;
        }
        let sections = &self.config.table.stations;
        for ((age, is_valid, cycles), section) in self.stations.iter().zip(sections) {
            let key = |tail| Key::of("station", &section.name, tail);
            let stale = is_stale(*age, self.config.timing.max_age, *is_valid);
            statistics.text(key("stale"), if stale { "true" } else { "false" });
            if *age != Nanos::MAX {
                statistics.number(key("age_ms"), age.as_micros() / 1e3, 3);
            }
            statistics.count(key("bus_cycles"), *cycles);
        }
    }
}

/// Writes one `key=value` per line.
impl fmt::Display for Snapshot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.statistics().fmt(f)
    }
}
