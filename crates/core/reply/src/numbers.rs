//! Replies that count, and switches at a number.

use tickbus_base::Threshold;
use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;

use super::io::Io;
use super::levels::Levels;
use super::signal::{Input, Output};

/// `kind = "switch"`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Switch {
    pub(crate) signal: Output,
    pub(crate) input: Input,
    pub(crate) threshold: Threshold,
}

impl Switch {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let on = self.threshold.update(self.input.value(io.slots));
        io.put_bit(self.signal, on);
        Nanos::MAX
    }
}

/// `kind = "counter"`: counts how often conditions begin to hold.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Counter {
    pub(crate) signal: Output,
    pub(crate) up: Levels,
    pub(crate) down: Option<Levels>,
    pub(crate) reset: Option<Levels>,
    /// Beyond one of them the count goes on at the other one.
    pub(crate) limits: [f64; 2],
    pub(crate) start: f64,
    pub(crate) count: f64,
    /// True for up and for down if it held in the previous tick: true before the first one, because a level is no edge.
    pub(crate) held: [bool; 2],
}

impl Counter {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let down = self.down.as_ref().is_some_and(|down| down.hold(io.slots));
        let hold = [self.up.hold(io.slots), down];
        for (index, by) in [1.0, -1.0].into_iter().enumerate() {
            if hold[index] && !self.held[index] {
                self.count = wrapped(self.count + by, self.limits);
            }
        }
        self.held = hold;
        if self
            .reset
            .as_ref()
            .is_some_and(|reset| reset.hold(io.slots))
        {
            self.count = self.start;
        }
        io.put(self.signal, self.count);
        Nanos::MAX
    }
}

/// `kind = "encoder"`: counts with a speed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Encoder {
    pub(crate) signal: Output,
    pub(crate) source: Speed,
    pub(crate) reset: Option<Levels>,
    pub(crate) limits: [f64; 2],
    pub(crate) start: f64,
    pub(crate) count: f64,
}

/// How fast an encoder counts, in counts per second, or a track runs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Speed {
    Number {
        input: Input,
        gain: f64,
    },
    Conditions {
        forward: Levels,
        reverse: Option<Levels>,
        rate: f64,
    },
}

impl Speed {
    /// The speed, per second.
    pub(crate) fn now(&self, slots: &[Slot]) -> f64 {
        match self {
            Self::Number { input, gain } => input.value(slots) * gain,
            Self::Conditions {
                forward,
                reverse,
                rate,
            } => {
                let reverse = reverse.as_ref().is_some_and(|back| back.hold(slots));
                match (forward.hold(slots), reverse) {
                    (true, false) => *rate,
                    (false, true) => -rate,
                    _ => 0.0,
                }
            }
        }
    }
}

impl Encoder {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let rate = self.source.now(io.slots);
        let next = self.count + rate * io.seconds;
        if next.is_finite() {
            self.count = wrapped(next, self.limits);
        }
        if self
            .reset
            .as_ref()
            .is_some_and(|reset| reset.hold(io.slots))
        {
            self.count = self.start;
        }
        io.put(self.signal, self.count.floor());
        io.next_tick_if(rate != 0.0)
    }
}

/// A count within limits, which goes on at the other limit beyond one.
pub(crate) fn wrapped(count: f64, [low, high]: [f64; 2]) -> f64 {
    (count - low).rem_euclid(high - low + 1.0) + low
}
