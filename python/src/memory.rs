//! The memory through which values pass between Python and a driver.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};

use tickbus_base::time::Nanos;
use tickbus_driver::Exchange;
use tickbus_image::signal::Slot;

/// The slots as Python sees them, and what the last tick found.
///
/// Python may write here at any time, NumPy even without its interpreter's lock. So all words are atomic, and the driver works
/// on slots of its own: a tick copies what this end writes from here, and what it reads to here.
pub(crate) struct Memory {
    words: Box<[AtomicU64]>,
    closed: AtomicBool,
    sequence: AtomicU64,
    age: AtomicI64,
    granted: AtomicI64,
    ticks: AtomicU64,
}

impl Memory {
    /// With these values.
    pub(crate) fn new(slots: &[Slot]) -> Self {
        Self {
            words: slots.iter().map(|slot| AtomicU64::new(slot.0)).collect(),
            closed: AtomicBool::new(false),
            sequence: AtomicU64::new(0),
            age: AtomicI64::new(Nanos::MAX.0),
            granted: AtomicI64::new(0),
            ticks: AtomicU64::new(0),
        }
    }

    /// The words of all slots, which live as long as `self`.
    pub(crate) fn words(&self) -> &[AtomicU64] {
        &self.words
    }

    /// The value of a slot.
    pub(crate) fn get(&self, slot: usize) -> Slot {
        Slot(self.words[slot].load(Ordering::Relaxed))
    }

    /// Sets the value of a slot.
    pub(crate) fn set(&self, slot: usize, value: Slot) {
        self.words[slot].store(value.0, Ordering::Relaxed);
    }

    /// Copies from here to `slots`.
    pub(crate) fn gather(&self, range: &Range<usize>, slots: &mut [Slot]) {
        let words = &self.words[range.clone()];
        for (slot, word) in slots[range.clone()].iter_mut().zip(words) {
            slot.0 = word.load(Ordering::Relaxed);
        }
    }

    /// Copies from `slots` to here.
    pub(crate) fn scatter(&self, range: &Range<usize>, slots: &[Slot]) {
        let words = &self.words[range.clone()];
        for (slot, word) in slots[range.clone()].iter().zip(words) {
            word.store(slot.0, Ordering::Relaxed);
        }
    }

    /// Tells what a tick found.
    pub(crate) fn tell(&self, done: Exchange) {
        self.sequence.store(done.sequence, Ordering::Relaxed);
        self.age.store(done.age.0, Ordering::Relaxed);
        self.granted.store(done.granted.0, Ordering::Relaxed);
    }

    /// Counts a tick that begins.
    pub(crate) fn count(&self) {
        self.ticks.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn close(&self) {
        self.closed.store(true, Ordering::Relaxed);
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.closed.load(Ordering::Relaxed)
    }

    /// Bus cycles that had arrived by the last tick.
    pub(crate) fn sequence(&self) -> u64 {
        self.sequence.load(Ordering::Relaxed)
    }

    /// Age of the data at the last tick; [`Nanos::MAX`] if nothing has arrived yet.
    pub(crate) fn age(&self) -> Nanos {
        Nanos(self.age.load(Ordering::Relaxed))
    }

    /// How far the simulation may go.
    pub(crate) fn granted(&self) -> Nanos {
        Nanos(self.granted.load(Ordering::Relaxed))
    }

    /// How many ticks there were.
    pub(crate) fn ticks(&self) -> u64 {
        self.ticks.load(Ordering::Relaxed)
    }
}
