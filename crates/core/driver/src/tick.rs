//! A tick: the data kept while it runs, and its result.

use tickbus_base::time::Nanos;

use super::Code;

/// The result of an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exchange {
    /// [`Code::Fresh`], [`Code::Unchanged`], [`Code::Stale`], or an error.
    pub code: Code,
    /// Number of bus cycles that have arrived, over all stations.
    pub sequence: u64,
    /// Age of the oldest station's data; [`Nanos::MAX`] when nothing ever arrived.
    pub age: Nanos,
    /// The time up to which the simulation can run before the next exchange. On buses that do not step the simulation,
    /// this is its own time.
    pub granted: Nanos,
}

impl Exchange {
    /// The state before the first exchange.
    pub const NONE: Self = Self {
        code: Code::Stale,
        sequence: 0,
        age: Nanos::MAX,
        granted: Nanos::ZERO,
    };
}

/// A tick that has begun and not ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tick {
    /// Simulation time; if the simulation gives none, the clock's time since the first tick.
    pub(super) time: Nanos,
    /// The time on the line when it began.
    pub(super) now: Nanos,
    /// The time spent in this tick's calls so far; measured only for ticks in the sample.
    pub(super) taken: Nanos,
}
