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
    /// As long as `on_for` if it is not stated.
    pub(crate) off_for: Option<Nanos>,
    /// The lamp blinks while these hold, and is off else.
    pub(crate) when: Option<Levels>,
    /// The time at which it began to blink; `None` while it does not blink.
    pub(crate) since: Option<Nanos>,
}

impl Blink {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let blinks = self.when.as_ref().is_none_or(|when| when.hold(io.slots));
        if !blinks {
            self.since = None;
            io.put_bit(self.signal, false);
            return Nanos::MAX;
        }
        let period = self.on_for + self.off_for.unwrap_or(self.on_for);
        let since = *self.since.get_or_insert(io.now);
        let phase = Nanos((io.now - since).0 % period.0);
        let on = phase < self.on_for;
        io.put_bit(self.signal, on);
        let change = if on { self.on_for } else { period };
        io.now + (change - phase)
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
    /// The count goes up each time this time has passed; `since` is the time of the last one.
    Every { every: Nanos, since: Nanos },
    /// The count is the PLC's own.
    Echo(Input),
}

impl LifeSign {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let next = match &mut self.source {
            Beat::Echo(input) => {
                self.count = input.value(io.slots);
                Nanos::MAX
            }
            Beat::Every { every, since } => {
                let beats = (io.now - *since).0 / every.0;
                *since += every.times(beats);
                #[expect(clippy::cast_precision_loss, reason = "a few beats")]
                let beats = beats as f64;
                self.count = wrapped(self.count + beats, self.limits);
                *since + *every
            }
        };
        io.put(self.signal, self.count);
        next
    }
}
