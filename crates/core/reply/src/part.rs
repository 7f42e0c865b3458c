//! A part of a way, or of full speed, that goes to an end at a constant rate.

use tickbus_base::time::Nanos;

use super::io::{Io, seconds};

/// A remainder of the way that is only rounding: a way of ten ticks takes ten ticks.
const ROUNDING: f64 = 1e-9;

/// The parts of the whole per second. Infinite if the whole takes no time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rates {
    pub(crate) forth: f64,
    /// As fast as forth if the reply does not state it.
    pub(crate) back: Option<f64>,
}

impl Rates {
    /// The rates for the times of the whole way.
    pub(crate) fn of(forth: Nanos, back: Option<Nanos>) -> Self {
        let rate = |whole| 1.0 / seconds(whole);
        Self {
            forth: rate(forth),
            back: back.map(rate),
        }
    }

    /// The rate of a way that goes forth if `ahead` is not negative.
    fn towards(self, ahead: f64) -> f64 {
        match self.back {
            Some(back) if ahead < 0.0 => back,
            _ => self.forth,
        }
    }
}

/// How far a motor or a travelling part is. A tick that has nothing to show need not step it: the next one that does makes
/// up for the time between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part {
    /// From 0 to 1.
    pub(crate) at: f64,
    /// Where it goes; `None` if it stands.
    pub(crate) to: Option<f64>,
    /// The end of the last tick that stepped it.
    time: Nanos,
}

impl Part {
    pub(crate) const fn new(at: f64) -> Self {
        Self {
            at,
            to: None,
            time: Nanos::ZERO,
        }
    }

    /// Goes to `to` in this tick. Returns true if it is still under way.
    pub(crate) fn step(&mut self, to: Option<f64>, rates: Rates, io: &Io<'_>) -> bool {
        let before = io.now - io.passed;
        if self.time < before {
            self.approach(rates, seconds(before - self.time));
        }
        (self.to, self.time) = (to, io.now);
        self.approach(rates, io.seconds)
    }

    /// When it next leaves or reaches an end, if it is under way.
    pub(crate) fn due(&self, rates: Rates) -> Nanos {
        if self.at <= 0.0 || self.at >= 1.0 {
            // The last tick took no time: the next one leaves the end.
            return self.time;
        }
        let ahead = self.to.map_or(0.0, |to| to - self.at);
        // Rather too early than too late: a part that is not there yet is asked again.
        let way = (ahead.abs() - 2.0 * ROUNDING).max(0.0);
        #[expect(clippy::cast_possible_truncation, reason = "a longer time is never")]
        let time = Nanos((way / rates.towards(ahead) * 1e9) as i64);
        self.time + time
    }

    /// Goes on for some seconds. Returns true if it is still under way.
    fn approach(&mut self, rates: Rates, seconds: f64) -> bool {
        let Some(to) = self.to else {
            return false;
        };
        let ahead = to - self.at;
        let rate = rates.towards(ahead);
        // An infinite rate needs no time.
        let far = if rate.is_infinite() {
            1.0
        } else {
            rate * seconds
        };
        if ahead.abs() <= far + ROUNDING {
            self.at = to;
            return false;
        }
        self.at += far.copysign(ahead);
        true
    }
}
