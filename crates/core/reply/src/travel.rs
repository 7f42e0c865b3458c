//! A part that travels between two ends: a cylinder, a valve.

use super::io::Io;
use super::levels::Levels;
use super::motor::approach;
use super::signal::{Input, Output};

/// `kind = "cylinder"` and `kind = "valve"`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Travel {
    pub(crate) drive: Drive,
    /// The parts of the whole way per second: forth (extending, opening) and back.
    pub(crate) rates: [f64; 2],
    /// The switches at the far end and at the near one.
    pub(crate) ends: [Option<Output>; 2],
    pub(crate) position: Option<Output>,
    /// The positions of the near end and of the far one.
    pub(crate) limits: [f64; 2],
    /// The state: the part of the way, from 0 to 1.
    pub(crate) part: f64,
}

/// The source of the motion.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Drive {
    /// Valves. Without a command back, a spring moves the part back.
    Commands {
        forth: Levels,
        back: Option<Levels>,
        /// True if a command that is over goes on acting until the other one comes.
        impulse: bool,
        /// Where the last command leads; `None` before the first.
        last: Option<f64>,
    },
    /// A number that says where to go, within the limits.
    Target(Input),
}

impl Travel {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> bool {
        let [low, high] = self.limits;
        let to = match &mut self.drive {
            Drive::Target(input) => {
                let target = (input.value(io.slots) - low) / (high - low);
                // A target that is no number leaves the part where it is.
                (!target.is_nan()).then(|| target.clamp(0.0, 1.0))
            }
            Drive::Commands {
                forth,
                back,
                impulse,
                last,
            } => {
                let forth = forth.hold(io.slots);
                let back = back.as_ref().map_or(!forth, |back| back.hold(io.slots));
                let to = match (forth, back) {
                    (true, false) => Some(1.0),
                    (false, true) => Some(0.0),
                    _ => last.filter(|_| *impulse),
                };
                *last = to;
                to
            }
        };
        if let Some(to) = to {
            let rate = self.rates[usize::from(to < self.part)];
            self.part = approach(self.part, to, rate, io.seconds);
        }
        let [far, near] = self.ends;
        io.put_some(far, self.part >= 1.0);
        io.put_some(near, self.part <= 0.0);
        if let Some(position) = self.position {
            io.put(position, low + (high - low) * self.part);
        }
        to.is_some_and(|to| (to - self.part).abs() > 0.0)
    }
}
