//! The extra work of some ends of a line around every exchange: of a driver's tick, and of a program's scan.

use std::sync::Arc;

use tickbus_axis::Reflexes;
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::{Fault, FaultBoard, Faults, Slots, TickTime};
use tickbus_image::signal::Slot;
use tickbus_reply::Replies;

use super::heartbeat::Beat;
use super::tap::Tap;

/// Changes the slots around an exchange.
#[derive(Debug, Default)]
pub(super) struct Extras {
    /// The axes' work on every tick.
    reflexes: Option<Reflexes>,
    /// The signals that the driver makes where the simulation does not.
    replies: Option<Replies>,
    /// The simulation's time at the last tick.
    time: Nanos,
    /// The heartbeats of this end.
    beats: Box<[Beat]>,
    /// Faults to inject; `None` until one can come.
    faults: Option<Faults>,
    /// True if there is anything to do; an end without extra work pays for this check only.
    is_busy: bool,
    /// True if anything changes the slots in this tick: faults that wait for their moment do not.
    changes_slots: bool,
}

impl Extras {
    pub(super) fn new(
        reflexes: Option<Reflexes>,
        replies: Option<Replies>,
        beats: Box<[Beat]>,
    ) -> Self {
        let mut extras = Self {
            reflexes,
            replies,
            beats,
            ..Self::default()
        };
        extras.rest();
        extras
    }

    /// Takes the work of `fresh`, whose reflexes, replies and heartbeats are at their beginning, and ends all faults.
    pub(super) fn restart(&mut self, fresh: Self) {
        (self.reflexes, self.beats) = (fresh.reflexes, fresh.beats);
        (self.replies, self.time) = (fresh.replies, fresh.time);
        if let Some(faults) = &mut self.faults {
            faults.restart();
        }
        self.rest();
    }

    #[inline]
    pub(super) const fn is_busy(&self) -> bool {
        self.is_busy
    }

    /// Returns true if the slots are to be changed around the rest of this tick.
    #[inline]
    pub(super) const fn changes_slots(&self) -> bool {
        self.changes_slots
    }

    /// Notes whether there is anything left to do: called at the end of a busy tick, whose faults may be over.
    #[inline(never)]
    pub(super) fn rest(&mut self) {
        let is_faulty = || self.faults.as_ref().is_some_and(|faults| !faults.is_idle());
        self.is_busy = self.works_on_every_tick() || is_faulty();
        self.note_changes();
    }

    /// Returns true if there is work in every tick.
    pub(super) const fn works_on_every_tick(&self) -> bool {
        self.reflexes.is_some() || self.replies.is_some() || !self.beats.is_empty()
    }

    fn note_changes(&mut self) {
        let is_bent = || self.faults.as_ref().is_some_and(Faults::change_values);
        self.changes_slots = self.works_on_every_tick() || is_bent();
    }

    /// Makes room for faults, so that a tick need not allocate memory for them.
    pub(super) fn make_room(&mut self, board: &Arc<FaultBoard>) -> &mut Faults {
        self.faults
            .get_or_insert_with(|| Faults::new(Arc::clone(board)))
    }

    /// Injects a fault, which can begin at the next tick. Returns the fault's number.
    pub(super) fn inject(
        &mut self,
        fault: &Fault,
        slots: Slots<'_>,
        board: &Arc<FaultBoard>,
    ) -> Result<u32, Mistake> {
        let id = self.make_room(board).add(fault, slots)?;
        self.is_busy = true;
        Ok(id)
    }

    /// Ends a fault at the next tick. Returns false if no fault has this number.
    pub(super) fn end_fault(&mut self, id: u32) -> bool {
        self.faults.as_mut().is_some_and(|faults| faults.end(id))
    }

    /// Returns whether [`next_model_change`](Self::next_model_change) may have one.
    #[inline]
    pub(super) fn has_model_change(&self) -> bool {
        let faults = self.faults.as_ref();
        faults.is_some_and(Faults::has_model_change)
    }

    /// Returns the next change of a fault of the simulation's model that the model has not been told.
    #[inline]
    pub(super) fn next_model_change(&mut self) -> Option<(usize, Option<f64>)> {
        self.faults.as_mut()?.next_model_change()
    }

    /// Takes over the faults that another thread has ordered; needs [room](Self::make_room).
    pub(super) fn obey(&mut self, tap: &mut Tap) {
        if let Some(faults) = &mut self.faults {
            tap.obey(faults);
            self.is_busy = true;
        }
    }

    /// Returns the signals that a fault changes at this moment: those that this end writes, or those that it reads.
    pub(super) fn bent(&self, written: bool) -> impl Iterator<Item = usize> {
        let faults = self.faults.iter();
        faults.flat_map(move |faults| faults.active(written))
    }

    /// Returns the signals that are heartbeats.
    pub(super) fn beating(&self) -> impl Iterator<Item = usize> {
        self.beats.iter().map(Beat::signal)
    }

    /// Runs first in the sending half, when the simulation hands its values over; `time` is the simulation's, or `None`
    /// if that of the last tick goes on.
    #[inline(never)]
    pub(super) fn handed_over(&mut self, time: Option<Nanos>, slots: &mut [Slot]) {
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.sending(slots);
        }
        if let Some(replies) = &mut self.replies {
            self.time = time.unwrap_or(self.time);
            replies.step(self.time, slots);
        }
    }

    /// Lets the caller write the signal of a reply for a while; see [`Replies::borrow`].
    pub(super) fn borrow_reply(&mut self, signal: usize, borrowed: bool) {
        if let Some(replies) = &mut self.replies {
            replies.borrow(signal, borrowed);
        }
    }

    /// Runs when a tick begins.
    #[inline(never)]
    pub(super) fn begin_tick(&mut self, moment: TickTime, slots: &mut [Slot]) {
        if let Some(faults) = &mut self.faults {
            faults.begin_tick(moment, slots);
        }
        self.note_changes();
    }

    /// Runs just before [`sending`](Self::sending): counts up the heartbeats that are due.
    #[inline(never)]
    pub(super) fn beat(&mut self, now: Nanos, slots: &mut [Slot]) {
        for beat in &mut self.beats {
            beat.beat(now, slots);
        }
    }

    /// Runs just before the slots are sent.
    #[inline(never)]
    pub(super) fn sending(&mut self, slots: &mut [Slot]) {
        if let Some(faults) = &mut self.faults {
            faults.sending(slots);
        }
    }

    /// Runs after the slots were sent.
    #[inline(never)]
    pub(super) fn sent(&mut self, slots: &mut [Slot]) {
        if let Some(faults) = &mut self.faults {
            faults.sent(slots);
        }
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.sent(slots);
        }
    }

    /// Runs when the slots contain the received values.
    #[inline(never)]
    pub(super) fn received(&mut self, slots: &mut [Slot]) {
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.received(slots);
        }
        if let Some(faults) = &mut self.faults {
            faults.received(slots);
        }
    }
}
