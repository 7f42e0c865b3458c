//! The extra work of some drivers around every exchange.

use tickbus_axis::Reflexes;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::{Faults, TickTime};
use tickbus_image::signal::Slot;

use super::heartbeat::Beat;

/// Changes the slots around an exchange. A driver without extra work has no `Extras`, and its tick pays for one check.
#[derive(Debug, Default)]
pub(super) struct Extras {
    /// The axes' work on every tick.
    pub(super) reflexes: Option<Reflexes>,
    /// Faults to inject.
    pub(super) faults: Option<Faults>,
    /// The heartbeats of this end.
    pub(super) beats: Box<[Beat]>,
}

impl Extras {
    /// Returns `None` if there is nothing to do.
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

    /// Runs first in the sending half, when the simulation hands its values over.
    #[cold]
    pub(super) fn handed_over(&mut self, slots: &mut [Slot]) {
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.sending(slots);
        }
    }

    /// Runs when a tick begins.
    #[cold]
    pub(super) fn begin_tick(&mut self, moment: TickTime, slots: &mut [Slot]) {
        if let Some(faults) = &mut self.faults {
            faults.begin_tick(moment, slots);
        }
    }

    /// Runs just before the slots are sent.
    #[cold]
    pub(super) fn sending(&mut self, now: Nanos, slots: &mut [Slot]) {
        for beat in &mut self.beats {
            beat.beat(now, slots);
        }
        if let Some(faults) = &mut self.faults {
            faults.sending(slots);
        }
    }

    /// Runs after the slots were sent.
    #[cold]
    pub(super) fn sent(&mut self, slots: &mut [Slot]) {
        if let Some(faults) = &mut self.faults {
            faults.sent(slots);
        }
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.sent(slots);
        }
    }

    /// Runs when the slots contain the received values.
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
