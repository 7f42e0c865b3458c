//! What some drivers do around every exchange, and most do not.

use tickbus_axis::Reflexes;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::{Faults, TickTime};
use tickbus_image::signal::Slot;

use super::heartbeat::Beat;

/// What is done to the slots around an exchange. A driver without any of it has none of this, and its tick pays for one
/// look.
#[derive(Debug, Default)]
pub(super) struct Extras {
    /// What the axes need done on every tick.
    pub(super) reflexes: Option<Reflexes>,
    /// Faults to inject.
    pub(super) faults: Option<Faults>,
    /// The heartbeats of this end.
    pub(super) beats: Box<[Beat]>,
}

impl Extras {
    /// `None` if there is nothing to do.
    pub(super) fn new(reflexes: Option<Reflexes>, beats: Box<[Beat]>) -> Option<Box<Self>> {
        let any = reflexes.is_some() || !beats.is_empty();
        any.then(|| {
            Box::new(Self {
                reflexes,
                faults: None,
                beats,
            })
        })
    }

    /// The simulation hands its values over: the first thing in the half that sends.
    #[cold]
    pub(super) fn handed_over(&mut self, slots: &mut [Slot]) {
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.sending(slots);
        }
    }

    /// A tick begins.
    #[cold]
    pub(super) fn begin_tick(&mut self, moment: TickTime, slots: &mut [Slot]) {
        if let Some(faults) = &mut self.faults {
            faults.begin_tick(moment, slots);
        }
    }

    /// The slots are about to be sent.
    #[cold]
    pub(super) fn sending(&mut self, now: Nanos, slots: &mut [Slot]) {
        for beat in &mut self.beats {
            beat.beat(now, slots);
        }
        if let Some(faults) = &mut self.faults {
            faults.sending(slots);
        }
    }

    /// The slots were sent.
    #[cold]
    pub(super) fn sent(&mut self, slots: &mut [Slot]) {
        if let Some(faults) = &mut self.faults {
            faults.sent(slots);
        }
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.sent(slots);
        }
    }

    /// The slots have what was received.
    #[cold]
    pub(super) fn received(&mut self, slots: &mut [Slot]) {
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.received(slots);
        }
        if let Some(faults) = &mut self.faults {
            faults.received(slots);
        }
    }
}
