//! A tick: what is kept while it is under way, and its result.

use tickbus_base::time::Nanos;

use super::Code;

/// The result of an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exchange {
    /// [`Code::Fresh`], [`Code::Unchanged`], [`Code::Stale`], or an error.
    pub code: Code,
    /// Bus cycles that have arrived, over all stations.
    pub sequence: u64,
    /// Age of the oldest station's data; [`Nanos::MAX`] when nothing ever arrived.
    pub age: Nanos,
    /// The time up to which the simulation may run before the next exchange; on buses that do not step it,
    /// the simulation's own time.
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
    /// The time spent in its calls so far; measured only for ticks in the sample.
    pub(super) taken: Nanos,
}
