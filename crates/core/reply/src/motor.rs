//! A motor behind a contactor.

use tickbus_base::time::Nanos;

use super::delay::Delay;
use super::io::{Io, seconds};
use super::levels::Levels;
use super::signal::Output;

/// `kind = "motor"`: the contactor's feedback, the speed, and the overload relay.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Motor {
    pub(crate) contactor: Levels,
    /// The contactor's own delays.
    pub(crate) contact: Delay,
    /// The parts of full speed per second: from standstill, and back.
    pub(crate) rates: [f64; 2],
    pub(crate) full_speed: f64,
    /// The overload relay trips while these hold.
    pub(crate) trip: Option<Levels>,
    /// A relay that has tripped stays so until these hold; without them, until `trip` no longer holds.
    pub(crate) reset: Option<Levels>,
    pub(crate) running: Option<Output>,
    pub(crate) at_speed: Option<Output>,
    pub(crate) speed: Option<Output>,
    pub(crate) overload: Option<Output>,
    pub(crate) healthy: Option<Output>,
    /// The state: the part of full speed, from 0 to 1.
    pub(crate) part: f64,
    pub(crate) has_tripped: bool,
}

impl Motor {
    pub(crate) fn step(&mut self, passed: Nanos, io: &mut Io<'_>) -> bool {
        let holds = |levels: &Option<Levels>, io: &Io<'_>| {
            levels.as_ref().is_some_and(|levels| levels.hold(io.slots))
        };
        if holds(&self.trip, io) {
            self.has_tripped = true;
        } else if self.reset.is_none() || holds(&self.reset, io) {
            self.has_tripped = false;
        }
        let wanted = self.contactor.hold(io.slots) && !self.has_tripped;
        let runs = self.contact.step(wanted, passed);
        let (to, rate) = if runs {
            (1.0, self.rates[0])
        } else {
            (0.0, self.rates[1])
        };
        self.part = approach(self.part, to, rate, io.seconds);
        io.put_some(self.running, runs);
        io.put_some(self.at_speed, self.part >= 1.0);
        io.put_some(self.overload, self.has_tripped);
        io.put_some(self.healthy, !self.has_tripped);
        if let Some(speed) = self.speed {
            io.put(speed, self.part * self.full_speed);
        }
        self.contact.is_waiting() || (to - self.part).abs() > 0.0
    }
}

/// The part of a way per second, where the whole way takes this time; infinite where that is none.
pub(crate) fn rate(whole: Nanos) -> f64 {
    1.0 / seconds(whole)
}

/// Goes from `at` towards `to` for some seconds. A remainder that is only rounding is gone as well, so that a way of ten
/// ticks takes ten ticks.
pub(crate) fn approach(at: f64, to: f64, rate: f64, seconds: f64) -> f64 {
    const ROUNDING: f64 = 1e-9;
    let far = if rate.is_infinite() {
        1.0
    } else {
        rate * seconds
    };
    let ahead = to - at;
    if ahead.abs() <= far + ROUNDING {
        to
    } else {
        at + far.copysign(ahead)
    }
}
