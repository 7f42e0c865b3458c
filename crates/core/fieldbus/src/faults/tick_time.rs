//! A moment of simulation time, as faults count it.

use tickbus_base::time::Nanos;

/// A tick: its time and its number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickTime {
    /// Time since the first tick.
    pub time: Nanos,
    /// Number of the tick; the first is 1.
    pub tick: u64,
}
