//! A part that travels between two ends: a cylinder, a valve.

use tickbus_base::time::Nanos;

use super::io::Io;
use super::levels::Levels;
use super::part::{Part, Rates};
use super::signal::{Input, Output};

/// `kind = "cylinder"` and `kind = "valve"`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Travel {
    pub(crate) drive: Drive,
    /// The parts of the whole way per second: forth (extending, opening) and back.
    pub(crate) rates: Rates,
    /// The switches at the far end and at the near one.
    pub(crate) ends: [Option<Output>; 2],
    pub(crate) position: Option<Output>,
    /// The positions of the near end and of the far one.
    pub(crate) limits: [f64; 2],
    /// The state: the part of the way, from 0 to 1.
    pub(crate) part: Part,
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
    },
    /// A number that says where to go, within the limits.
    Target(Input),
}

impl Travel {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let [low, high] = self.limits;
        let to = match &self.drive {
            Drive::Target(input) => {
                let target = (input.value(io.slots) - low) / (high - low);
                // A target that is no number leaves the part where it is.
                (!target.is_nan()).then(|| target.clamp(0.0, 1.0))
            }
            Drive::Commands {
                forth,
                back,
                impulse,
            } => {
                let forth = forth.hold(io.slots);
                let back = back.as_ref().map_or(!forth, |back| back.hold(io.slots));
                match (forth, back) {
                    (true, false) => Some(1.0),
                    (false, true) => Some(0.0),
                    _ => self.part.to.filter(|_| *impulse),
                }
            }
        };
        let moves = self.part.step(to, self.rates, io);
        let [far, near] = self.ends;
        io.put_some(far, self.part.at >= 1.0);
        io.put_some(near, self.part.at <= 0.0);
        if let Some(position) = self.position {
            io.put(position, low + (high - low) * self.part.at);
        }
        match moves {
            false => Nanos::MAX,
            true if self.position.is_some() => io.now,
            true => self.part.due(self.rates),
        }
    }
}
