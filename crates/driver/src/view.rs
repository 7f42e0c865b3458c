//! What a tick shows of itself to another thread.

use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;

use super::tick_counters::TickTimes;
use super::{Code, TickCounters};

/// A tick as it ended, copied.
#[derive(Clone, Debug)]
pub struct View {
    /// The values of the signals, in the order of the signal table: as the simulation or the PLC program wrote them, and
    /// as it was shown those that it reads.
    pub slots: Box<[Slot]>,
    /// Per signal, how many of its latched edges there were so far; the counts wrap. Zero without a latch.
    pub edges: Box<[u32]>,
    /// Per station, what its peer has sent.
    pub stations: Box<[StationView]>,
    /// When the tick ended, on the clock of the line.
    pub now: Nanos,
    /// The number of the tick, from 1; 0 before the first.
    pub tick: u64,
    /// The time of the tick, as the simulation counts it.
    pub time: Nanos,
    /// The status of its exchange.
    pub code: Code,
    pub(super) counters: TickCounters,
    pub(super) events_lost: u64,
    /// The distributions, if they were asked for.
    pub(super) times: TickTimes,
    pub(super) has_times: bool,
}

/// One station in a [`View`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StationView {
    /// Its part of the exchange.
    pub status: Code,
    /// How old its data are; [`Nanos::MAX`] if there never were any.
    pub age: Nanos,
    /// Whether its data are valid: its PLC runs, and signals that should change do.
    pub is_valid: bool,
    /// Whether the slots of what it sends hold fail-safe values.
    pub is_fail_safe: bool,
    /// Bus cycles that have arrived.
    pub cycles: u64,
}

impl View {
    /// Before the first tick, with these values.
    pub(super) fn new(slots: Vec<Slot>, stations: usize) -> Self {
        let station = StationView {
            status: Code::Stale,
            age: Nanos::MAX,
            is_valid: true,
            is_fail_safe: true,
            cycles: 0,
        };
        Self {
            edges: vec![0; slots.len()].into(),
            slots: slots.into(),
            stations: vec![station; stations].into(),
            now: Nanos::ZERO,
            tick: 0,
            time: Nanos::ZERO,
            code: Code::Stale,
            counters: TickCounters::default(),
            events_lost: 0,
            times: TickTimes::default(),
            has_times: false,
        }
    }
}
