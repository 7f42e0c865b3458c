//! What a driver counts.

use std::fmt;

use super::Code;
use crate::time::{Nanos, Spans};

/// Counters of the tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Exchanges.
    pub ticks: u64,
    /// Exchanges that found a new bus cycle.
    pub fresh: u64,
    /// Exchanges that found the link alive, but no new cycle.
    pub unchanged: u64,
    /// Exchanges that found nothing newer than the limit of age.
    pub stale: u64,
    /// Exchanges that failed.
    pub failed: u64,
    /// Values beyond the range of their type, sent as the nearest end of it.
    pub saturated: u64,
    /// NaN values, sent as the fail-safe value.
    pub not_a_number: u64,
}

impl Counters {
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

/// One `key=value` per line.
impl fmt::Display for Counters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            ticks,
            fresh,
            unchanged,
            stale,
            failed,
            saturated,
            not_a_number,
        } = self;
        writeln!(
            f,
            "ticks={ticks}\nfresh={fresh}\nunchanged={unchanged}\nstale={stale}"
        )?;
        writeln!(
            f,
            "failed={failed}\nsaturated={saturated}\nnot_a_number={not_a_number}"
        )
    }
}

/// One tick in so many is timed: a second look at the clock takes half as long as a small exchange.
const SAMPLED: u64 = 32;

/// Distributions over the ticks, from samples.
#[derive(Clone, Debug, Default)]
pub(super) struct Samples {
    /// How long an exchange takes.
    exchange: Spans,
    /// How old the data are that it delivers.
    age: Spans,
}

impl Samples {
    /// Whether this tick is one of the sample.
    #[inline]
    pub(super) const fn takes(tick: u64) -> bool {
        tick.is_multiple_of(SAMPLED)
    }

    /// Takes the sample of a tick whose calls took `span`, and delivered data of `age`; `Nanos::MAX` where there
    /// never were any.
    pub(super) fn add(&mut self, span: Nanos, age: Nanos) {
        self.exchange.record(span);
        if age != Nanos::MAX {
            self.age.record(age);
        }
    }

    /// Appends both, one `key=value` a line.
    pub(super) fn write(&self, text: &mut String) {
        self.exchange.write("exchange", text);
        self.age.write("age", text);
    }
}
