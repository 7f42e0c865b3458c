//! The counters and measurements of the tick.

use super::Code;
use tickbus_base::statistics::Statistics;
use tickbus_base::time::{Nanos, TimeHistogram};

/// Counters of the tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickCounters {
    /// Exchanges.
    pub ticks: u64,
    /// Exchanges that found a new bus cycle.
    pub fresh: u64,
    /// Exchanges that found the link alive, but no new cycle.
    pub unchanged: u64,
    /// Exchanges that found no data younger than `max_age`.
    pub stale: u64,
    /// Exchanges that failed.
    pub failed: u64,
    /// Values beyond the range of their type, sent as its nearest limit.
    pub saturated: u64,
    /// NaN values, sent as the fail-safe value.
    pub not_a_number: u64,
}

impl TickCounters {
    pub(super) fn count(&mut self, code: Code) {
        let counter = match code {
            Code::Fresh => &mut self.fresh,
            Code::Unchanged => &mut self.unchanged,
            Code::Stale => &mut self.stale,
            _ => &mut self.failed,
        };
        *counter += 1;
    }
}

impl TickCounters {
    pub(super) fn write(&self, statistics: &mut Statistics) {
        statistics.count("ticks", self.ticks);
        statistics.count("fresh", self.fresh);
        statistics.count("unchanged", self.unchanged);
        statistics.count("stale", self.stale);
        statistics.count("failed", self.failed);
        statistics.count("saturated", self.saturated);
        statistics.count("not_a_number", self.not_a_number);
    }
}

/// One tick out of this many is timed: the second reading of the clock costs half as much as a small exchange.
const SAMPLED: u64 = 32;

/// Distributions over a sample of the ticks.
#[derive(Clone, Debug, Default)]
pub(super) struct TickTimes {
    /// Duration of an exchange.
    exchange: TimeHistogram,
    /// Age of the data that it delivers.
    age: TimeHistogram,
}

impl TickTimes {
    /// Returns true if this tick is in the sample.
    #[inline]
    pub(super) const fn takes(tick: u64) -> bool {
        tick.is_multiple_of(SAMPLED)
    }

    /// Adds a tick to the sample. Its calls took `span`, and delivered data of `age`, which is `Nanos::MAX` if no data
    /// ever arrived.
    pub(super) fn add(&mut self, span: Nanos, age: Nanos) {
        self.exchange.record(span);
        if age != Nanos::MAX {
            self.age.record(age);
        }
    }

    /// Becomes a copy of `other`, without allocating memory.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.exchange.copy_from(&other.exchange);
        self.age.copy_from(&other.age);
    }

    /// Adds both distributions to the statistics.
    pub(super) fn write(&self, statistics: &mut Statistics) {
        statistics.distribution("exchange", &self.exchange);
        statistics.distribution("age", &self.age);
    }
}
