//! A number that follows another one slowly, such as a temperature.

use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::Random;

use super::io::{Io, seconds};
use super::levels::Levels;
use super::signal::{Input, Output};

/// `kind = "lag"`: of the first order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lag {
    pub(crate) signal: Output,
    pub(crate) source: Source,
    /// The time constant: after it, 63 % of a step are there.
    pub(crate) time: Nanos,
    /// The length of the last tick, and the part of the way in it.
    pub(crate) tick: (Nanos, f64),
    pub(crate) limits: [f64; 2],
    /// How far the noise goes to either side.
    pub(crate) noise: f64,
    pub(crate) random: Random,
    /// The state, without its noise; before the first tick, where it begins, or `None` for where it leads.
    pub(crate) at: Option<f64>,
}

/// Where the number leads.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Source {
    Number {
        input: Input,
        gain: f64,
        offset: f64,
    },
    Condition {
        when: Levels,
        on: f64,
        off: f64,
    },
}

impl Lag {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let passed = io.passed;
        let [low, high] = self.limits;
        let to = match &self.source {
            Source::Number {
                input,
                gain,
                offset,
            } => input.value(io.slots) * gain + offset,
            Source::Condition { when, on, off } => {
                if when.hold(io.slots) {
                    *on
                } else {
                    *off
                }
            }
        };
        let before = self.at.unwrap_or(to);
        if passed != self.tick.0 {
            // Exact for any length of the tick.
            self.tick = (passed, -(-io.seconds / seconds(self.time)).exp_m1());
        }
        let next = before + (to - before) * self.tick.1;
        // An input that is no number leaves the value where it is.
        let at = if next.is_nan() {
            before
        } else {
            next.clamp(low, high)
        };
        if !at.is_nan() {
            self.at = Some(at);
        }
        if self.noise == 0.0 {
            io.put(self.signal, at.clamp(low, high));
            return io.next_tick_if((at - before).abs() > 0.0 || passed == Nanos::ZERO);
        }
        let noise = self.noise * self.random.around_zero();
        io.put(self.signal, (at + noise).clamp(low, high));
        io.now
    }
}
