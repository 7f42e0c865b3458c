//! A bit that follows another one later.

use tickbus_base::time::Nanos;

use super::io::Io;
use super::levels::Levels;
use super::signal::Output;

/// An on delay and an off delay.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Delay {
    pub(crate) on_after: Nanos,
    pub(crate) off_after: Nanos,
    is_on: bool,
    /// How long the input has differed from the output.
    differs: Option<Nanos>,
}

impl Delay {
    pub(crate) fn new(on_after: Nanos, off_after: Nanos) -> Self {
        Self {
            on_after,
            off_after,
            ..Self::default()
        }
    }

    /// True while the output is to follow later.
    pub(crate) const fn is_waiting(&self) -> bool {
        self.differs.is_some()
    }

    /// Returns the delayed bit.
    pub(crate) fn step(&mut self, input: bool, passed: Nanos) -> bool {
        if input == self.is_on {
            self.differs = None;
        } else {
            // The delay begins in the tick in which the input is seen to differ.
            let differs = self.differs.map_or(Nanos::ZERO, |before| before + passed);
            let due = if input { self.on_after } else { self.off_after };
            self.differs = Some(differs);
            if differs >= due {
                (self.is_on, self.differs) = (input, None);
            }
        }
        self.is_on
    }
}

/// `kind = "follows"`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Follows {
    pub(crate) signal: Output,
    pub(crate) when: Levels,
    pub(crate) inverted: bool,
    pub(crate) delay: Delay,
}

impl Follows {
    pub(crate) fn step(&mut self, passed: Nanos, io: &mut Io<'_>) -> bool {
        let on = self.delay.step(self.when.hold(io.slots), passed);
        io.put_bit(self.signal, on != self.inverted);
        self.delay.is_waiting()
    }
}
