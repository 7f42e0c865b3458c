//! Replies by time alone.

use tickbus_base::time::Nanos;

use super::io::Io;
use super::levels::Levels;
use super::numbers::wrapped;
use super::signal::{Input, Output};

/// `kind = "blink"`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Blink {
    pub(crate) signal: Output,
    pub(crate) on_for: Nanos,
    pub(crate) off_for: Nanos,
    /// The lamp blinks while these hold, and is off else.
    pub(crate) when: Option<Levels>,
    /// The time since it was switched on; `None` while it does not blink.
    pub(crate) since: Option<Nanos>,
}

impl Blink {
    pub(crate) fn step(&mut self, passed: Nanos, io: &mut Io<'_>) -> bool {
        let blinks = self.when.as_ref().is_none_or(|when| when.hold(io.slots));
        let period = self.on_for + self.off_for;
        self.since = blinks.then(|| match self.since {
            None => Nanos::ZERO,
            Some(since) => Nanos((since + passed).0 % period.0),
        });
        let on = self.since.is_some_and(|since| since < self.on_for);
        io.put_bit(self.signal, on);
        blinks
    }
}

/// `kind = "life-sign"`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LifeSign {
    pub(crate) signal: Output,
    pub(crate) source: Beat,
    /// Beyond the second the count goes on at the first.
    pub(crate) limits: [f64; 2],
    pub(crate) count: f64,
}

/// Where the count comes from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Beat {
    /// The count goes up each time so much time has passed.
    Every { every: Nanos, since: Nanos },
    /// The count is the PLC's own.
    Echo(Input),
}

impl LifeSign {
    pub(crate) fn step(&mut self, passed: Nanos, io: &mut Io<'_>) -> bool {
        match &mut self.source {
            Beat::Echo(input) => self.count = input.value(io.slots),
            Beat::Every { every, since } => {
                let all = *since + passed;
                *since = Nanos(all.0 % every.0);
                #[expect(clippy::cast_precision_loss, reason = "a few beats")]
                let beats = (all.0 / every.0) as f64;
                self.count = wrapped(self.count + beats, self.limits);
            }
        }
        io.put(self.signal, self.count);
        matches!(self.source, Beat::Every { .. })
    }
}
