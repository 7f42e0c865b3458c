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
    /// When the output follows the input, if they differ.
    due: Option<Nanos>,
}

impl Delay {
    pub(crate) fn new(on_after: Nanos, off_after: Nanos) -> Self {
        Self {
            on_after,
            off_after,
            ..Self::default()
        }
    }

    /// When the output follows the input; never if it does.
    pub(crate) fn due(&self) -> Nanos {
        self.due.unwrap_or(Nanos::MAX)
    }

    /// Returns the delayed bit.
    pub(crate) fn step(&mut self, input: bool, now: Nanos) -> bool {
        if input == self.is_on {
            self.due = None;
        } else {
            // The delay begins in the tick in which the input is seen to differ.
            let after = if input { self.on_after } else { self.off_after };
            let due = *self.due.get_or_insert(now + after);
            if now >= due {
                (self.is_on, self.due) = (input, None);
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
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let on = self.delay.step(self.when.hold(io.slots), io.now);
        io.put_bit(self.signal, on != self.inverted);
        self.delay.due()
    }
}
