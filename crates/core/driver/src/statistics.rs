//! The counters of a driver.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::tick_counters::{TickCounters, TickTimes};
use tickbus_base::os::dropped_log_lines;
use tickbus_base::statistics::{Key, Statistics};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::FaultBoard;
use tickbus_fieldbus::{LinkStatus, SwallowedSignals, is_stale};
use tickbus_record::RecorderCounters;

/// Counters that any thread can read.
pub(crate) trait Counters: fmt::Debug + Send + Sync {
    /// Adds the counters.
    fn write(&self, statistics: &mut Statistics);
}

/// The counters of the program at this end or at the other one, if there is one. A reset replaces them.
#[derive(Clone, Debug)]
pub(super) struct ProgramCounters(Arc<Mutex<Option<Arc<dyn Counters>>>>);

impl ProgramCounters {
    pub(super) fn new(counters: Option<Arc<dyn Counters>>) -> Self {
        Self(Arc::new(Mutex::new(counters)))
    }

    pub(super) fn replace(&self, counters: Option<Arc<dyn Counters>>) {
        *self.lock() = counters;
    }

    fn write(&self, statistics: &mut Statistics) {
        let counters = self.lock().clone();
        if let Some(counters) = counters {
            counters.write(statistics);
        }
    }

    fn lock(&self) -> MutexGuard<'_, Option<Arc<dyn Counters>>> {
        // A pointer is whole after a panic, too.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The settings that a line has at present, which others look at.
#[derive(Clone, Debug)]
pub(super) struct BusFacts(Arc<Mutex<Facts>>);

#[derive(Clone, Debug)]
pub(super) struct Facts {
    /// The kind of bus.
    pub(super) kind: &'static str,
    pub(super) end: Option<LineEnd>,
    /// The host and port where the line connects or listens.
    pub(super) address: Option<String>,
    /// The watchdog of the ticks.
    pub(super) watchdog: Option<Nanos>,
}

/// The end of a connection that a line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineEnd {
    /// The peer connects.
    Server,
    /// The line connects.
    Client,
}

impl BusFacts {
    pub(super) fn of(config: &Config) -> Self {
        Self(Arc::new(Mutex::new(Facts::of(config))))
    }

    pub(super) fn set(&self, config: &Config) {
        *self.lock() = Facts::of(config);
    }

    pub(super) fn get(&self) -> Facts {
        self.lock().clone()
    }

    fn lock(&self) -> MutexGuard<'_, Facts> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Facts {
    fn of(config: &Config) -> Self {
        let bus = &config.bus;
        let is_server = bus.complaints().is_some();
        let server = is_server.then_some(LineEnd::Server);
        let client = bus.connects().then_some(LineEnd::Client);
        Self {
            kind: bus.kind(),
            end: server.or(client),
            address: bus.address(),
            watchdog: config.timing.watchdog,
        }
    }
}

/// The sources of the statistics of one end of a line, all readable from any thread.
#[derive(Clone, Debug)]
pub(super) struct Figures {
    pub(super) status: LinkStatus,
    pub(super) board: Arc<FaultBoard>,
    pub(super) swallowed: SwallowedSignals,
    pub(super) program: ProgramCounters,
    pub(super) record: Option<Arc<RecorderCounters>>,
    pub(super) bus: BusFacts,
}

/// The figures that only the ticks of a driver know, copied.
#[derive(Clone, Debug)]
pub(super) struct TickFigures {
    pub(super) config: Arc<Config>,
    pub(super) counters: TickCounters,
    /// Per station: time since its peer was last heard from, whether its data are valid, and its bus cycles.
    pub(super) stations: Vec<(Nanos, bool, u64)>,
    pub(super) events_lost: u64,
    pub(super) samples: TickTimes,
}

/// The data of a driver's statistics at one moment.
///
/// Copying them takes a microsecond or two, formatting them can take a hundred times as long: a caller that has locked
/// the driver releases it in between.
#[derive(Clone, Debug)]
pub struct Snapshot {
    pub(super) figures: Figures,
    pub(super) ticks: TickFigures,
    pub(super) now: Nanos,
}

impl Snapshot {
    /// Adds the saturated values and the NaN values that the simulator's language binding has converted.
    pub fn add_conversions(&mut self, [saturated, not_a_number]: [u64; 2]) {
        let counters = &mut self.ticks.counters;
        counters.saturated = counters.saturated.wrapping_add(saturated);
        counters.not_a_number = counters.not_a_number.wrapping_add(not_a_number);
    }

    /// Returns the statistics.
    pub fn statistics(&self) -> Statistics {
        let ages = self.ticks.stations.iter().map(|(age, _, _)| *age);
        self.figures.status.observe(self.now, ages);
        self.figures.statistics(self.now, Some(&self.ticks))
    }
}

impl Figures {
    /// Returns the statistics, without checking how old the stations' data are; `ticks` are a driver's.
    pub(super) fn statistics(&self, now: Nanos, ticks: Option<&TickFigures>) -> Statistics {
        self.status.observe_call(now);
        let mut statistics = Statistics::default();
        if let Some(ticks) = ticks {
            ticks.write_counters(&mut statistics);
        }
        self.status.write(now, &mut statistics);
        if let Some(ticks) = ticks {
            ticks.write_stations(self.status.max_age(), &mut statistics);
            ticks.samples.write(&mut statistics);
        }
        self.swallowed.write(&mut statistics);
        self.board.tell(self.status.driver());
        self.board.write(&mut statistics);
        self.program.write(&mut statistics);
        if let Some(record) = &self.record {
            record.write(&mut statistics);
        }
        statistics.count("log.dropped", dropped_log_lines());
        statistics
    }
}

impl TickFigures {
    fn write_counters(&self, statistics: &mut Statistics) {
        self.counters.write(statistics);
        let cycles = self.stations.iter().map(|(_, _, cycles)| cycles).sum();
        statistics.count("bus_cycles", cycles);
        statistics.count("events_lost", self.events_lost);
    }

    /// Adds the age of each station's data and its number of bus cycles; adds nothing for a single station.
    fn write_stations(&self, max_age: Nanos, statistics: &mut Statistics) {
        if self.stations.len() < 2 {
            return;
        }
        let sections = &self.config.table.stations;
        for ((age, is_valid, cycles), section) in self.stations.iter().zip(sections) {
            let key = |tail| Key::of("station", &section.name, tail);
            let stale = is_stale(*age, max_age, *is_valid);
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
