//! The copy of a tick that another thread can see.

use tickbus_base::time::Nanos;
use tickbus_image::signal::{Signal, Slot};

use super::tick_counters::TickTimes;
use super::{Code, TickCounters};

/// A copy of a tick at its end.
#[derive(Clone, Debug)]
pub struct View {
    /// The values of the signals, in the order of the signal table: written values as the simulation or the PLC program
    /// wrote them, read values as it saw them.
    pub slots: Box<[Slot]>,
    /// Per signal, the number of its latched edges so far; the counts wrap. Zero without a latch.
    pub edges: Box<[u32]>,
    /// Per station, the state of its data.
    pub stations: Box<[StationView]>,
    /// The time when the tick ended, on the clock of the line.
    pub now: Nanos,
    /// The number of the tick, from 1; 0 before the first.
    pub tick: u64,
    /// The number of ticks that the recording has from before the last reset, after which [`tick`](Self::tick) counts
    /// from 1 again.
    pub recorded_before: u64,
    /// The time of the tick, on the simulation's clock.
    pub time: Nanos,
    /// The status of the exchange.
    pub code: Code,
    pub(super) counters: TickCounters,
    pub(super) events_lost: u64,
    /// The distributions, if they were requested.
    pub(super) times: TickTimes,
    pub(super) has_times: bool,
}

/// One station in a [`View`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StationView {
    /// The station's status in the exchange.
    pub status: Code,
    /// The age of the station's data; [`Nanos::MAX`] if no data ever arrived.
    pub age: Nanos,
    /// True if the station's data are valid: its PLC runs, and signals that should change do.
    pub is_valid: bool,
    /// The values of the station that are fail-safe values.
    pub fail_safe: FailSafeValues,
    /// Bus cycles that have arrived.
    pub cycles: u64,
}

/// Which values that a station sends are fail-safe values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FailSafeValues {
    /// None: the data are the station's.
    None,
    /// Those of the signals that state one; the others keep their last value.
    Stated,
    /// All.
    All,
}

impl FailSafeValues {
    /// True if this signal of the station has its fail-safe value.
    pub fn has(self, signal: &Signal) -> bool {
        match self {
            Self::None => false,
            Self::Stated => signal.states_fail_safe,
            Self::All => true,
        }
    }
}

impl View {
    /// Creates the view before the first tick, with these values.
    pub(super) fn new(slots: Vec<Slot>, stations: usize) -> Self {
        let station = StationView {
            status: Code::Stale,
            age: Nanos::MAX,
            is_valid: true,
            fail_safe: FailSafeValues::All,
            cycles: 0,
        };
        Self {
            edges: vec![0; slots.len()].into(),
            slots: slots.into(),
            stations: vec![station; stations].into(),
            now: Nanos::ZERO,
            tick: 0,
            recorded_before: 0,
            time: Nanos::ZERO,
            code: Code::Stale,
            counters: TickCounters::default(),
            events_lost: 0,
            times: TickTimes::default(),
            has_times: false,
        }
    }
}
