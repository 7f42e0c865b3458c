//! A motor behind a contactor or a drive.

use tickbus_base::time::Nanos;

use super::delay::Delay;
use super::io::Io;
use super::levels::Levels;
use super::part::{Part, Rates};
use super::signal::{Input, Output};

/// `kind = "motor"`: the contactor's feedback, the speed, and the overload relay.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Motor {
    pub(crate) contactor: Levels,
    /// The contactor's own delays.
    pub(crate) contact: Delay,
    /// The parts of full speed per second: from standstill, and back.
    pub(crate) rates: Rates,
    pub(crate) full_speed: f64,
    /// The speed that a drive is told to run at, from 0 to full speed; without it, full speed.
    pub(crate) target: Option<Input>,
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
    pub(crate) part: Part,
    pub(crate) has_tripped: bool,
}

impl Motor {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let holds = |levels: &Option<Levels>, io: &Io<'_>| {
            levels.as_ref().is_some_and(|levels| levels.hold(io.slots))
        };
        if holds(&self.trip, io) {
            self.has_tripped = true;
        } else if self.reset.is_none() || holds(&self.reset, io) {
            self.has_tripped = false;
        }
        let wanted = self.contactor.hold(io.slots) && !self.has_tripped;
        let runs = self.contact.step(wanted, io.now);
        let to = match self.target {
            _ if !runs => Some(0.0),
            Some(target) => {
                let part = target.value(io.slots) / self.full_speed;
                // A target that is no number leaves the speed where it is.
                (!part.is_nan()).then(|| part.clamp(0.0, 1.0))
            }
            None => Some(1.0),
        };
        let moves = self.part.step(to, self.rates, io);
        let is_there = match self.target {
            Some(_) => runs && !moves,
            None => self.part.at >= 1.0,
        };
        io.put_some(self.running, runs);
        io.put_some(self.at_speed, is_there);
        io.put_some(self.overload, self.has_tripped);
        io.put_some(self.healthy, !self.has_tripped);
        if let Some(speed) = self.speed {
            io.put(speed, self.part.at * self.full_speed);
        }
        let due = self.contact.due();
        match moves {
            false => due,
            true if self.speed.is_some() => io.now,
            true => self.part.due(self.rates).min(due),
        }
    }
}
