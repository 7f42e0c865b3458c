//! The values of a tick, as replies read and make them.

use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::FaultBoard;
use tickbus_image::signal::Slot;

use super::awake::Awake;
use super::signal::Output;

/// One signal, as far as a reply makes it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Made {
    /// The value that a simulation leaves there if it does not write the signal.
    pub(crate) rest: Slot,
    pub(crate) ours: Slot,
    pub(crate) writer: Writer,
    /// The place of the note that the simulation writes it.
    pub(crate) note: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Writer {
    Reply,
    Simulation,
    /// Somebody has taken the signal for a while.
    Borrowed,
    /// The reply again, whatever its signal has now.
    Returned,
    /// The reply, whatever its signal has.
    Always,
}

/// The values of a tick, from which replies read and into which they write.
pub(crate) struct Io<'a> {
    pub(crate) slots: &'a mut [Slot],
    pub(crate) made: &'a mut [Made],
    pub(crate) board: &'a FaultBoard,
    pub(crate) awake: &'a mut Awake,
    /// The time at the end of the tick, since the first one.
    pub(crate) now: Nanos,
    /// The length of the tick, and the same in seconds.
    pub(crate) passed: Nanos,
    pub(crate) seconds: f64,
}

impl Io<'_> {
    /// When a reply has work next that changes in every tick while it moves.
    pub(crate) const fn next_tick_if(&self, moves: bool) -> Nanos {
        if moves { self.now } else { Nanos::MAX }
    }

    /// True if the simulation writes the signal, in the place of the reply.
    pub(crate) fn is_of_simulation(&self, output: Output) -> bool {
        self.made[output.signal()].writer == Writer::Simulation
    }

    pub(crate) fn put_bit(&mut self, output: Output, on: bool) {
        self.put_slot(output.signal(), Slot::from_real(f64::from(u8::from(on))));
    }

    pub(crate) fn put_some(&mut self, output: Option<Output>, on: bool) {
        if let Some(output) = output {
            self.put_bit(output, on);
        }
    }

    pub(crate) fn put(&mut self, output: Output, value: f64) {
        self.put_slot(output.signal(), output.form.slot(value));
    }

    /// Puts again what a reply has put there before, unless the simulation writes the signal.
    pub(crate) fn keep(&mut self, signal: usize) {
        self.put_slot(signal, self.made[signal].ours);
    }

    #[inline]
    pub(crate) fn put_slot(&mut self, signal: usize, slot: Slot) {
        let (there, made) = (&mut self.slots[signal], &mut self.made[signal]);
        let is_free = *there == made.ours || there.0 == 0 || *there == made.rest;
        if is_free && made.writer == Writer::Reply {
            if *there != slot {
                self.awake.changed(signal);
            }
            (*there, made.ours) = (slot, slot);
        } else {
            self.put_otherwise(signal, slot);
        }
    }

    #[cold]
    fn put_otherwise(&mut self, signal: usize, slot: Slot) {
        let (there, made) = (&mut self.slots[signal], &mut self.made[signal]);
        self.awake.changed(signal);
        match made.writer {
            Writer::Reply => {
                made.writer = Writer::Simulation;
                self.board.mark(made.note as usize);
            }
            Writer::Returned => {
                (*there, made.ours, made.writer) = (slot, slot, Writer::Reply);
            }
            Writer::Always => (*there, made.ours) = (slot, slot),
            Writer::Simulation | Writer::Borrowed => {}
        }
    }
}

/// A time in seconds.
#[expect(clippy::cast_precision_loss, reason = "a tick is short")]
pub(crate) fn seconds(time: Nanos) -> f64 {
    time.0 as f64 / 1e9
}
