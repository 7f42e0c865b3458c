//! The memory through which values pass between Python and a driver.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};

use tickbus_base::time::Nanos;
use tickbus_driver::Exchange;
use tickbus_image::signal::Slot;

/// Words that Python and a driver share.
pub(crate) type Words = Arc<[AtomicU64]>;

/// The slots as Python sees them, and the results of the last tick.
///
/// Python can write here at any time, and NumPy even without the interpreter's lock. All words are therefore atomic,
/// and the driver works on its own slots: a tick copies the values that this end writes from here, and those that it
/// reads to here.
pub(crate) struct Memory {
    /// The words of this driver, or of all drivers of a vector.
    pub(crate) block: Words,
    pub(crate) range: Range<usize>,
    closed: AtomicBool,
    sequence: AtomicU64,
    age: AtomicI64,
    granted: AtomicI64,
    ticks: AtomicU64,
}

impl Memory {
    /// Creates the memory with these values.
    pub(crate) fn new(slots: &[Slot]) -> Self {
        let block = slots.iter().map(|slot| AtomicU64::new(slot.0)).collect();
        Self::within(block, 0..slots.len())
    }

    /// Creates the memory in a part of a block, with the values that are there.
    pub(crate) fn within(block: Words, range: Range<usize>) -> Self {
        Self {
            block,
            range,
            closed: AtomicBool::new(false),
            sequence: AtomicU64::new(0),
            age: AtomicI64::new(Nanos::MAX.0),
            granted: AtomicI64::new(0),
            ticks: AtomicU64::new(0),
        }
    }

    fn words(&self) -> &[AtomicU64] {
        &self.block[self.range.clone()]
    }

    /// Returns the value of a slot.
    pub(crate) fn get(&self, slot: usize) -> Slot {
        Slot(self.words()[slot].load(Ordering::Relaxed))
    }

    /// Sets the value of a slot.
    pub(crate) fn set(&self, slot: usize, value: Slot) {
        self.words()[slot].store(value.0, Ordering::Relaxed);
    }

    /// Copies from this memory to `slots`.
    pub(crate) fn gather(&self, range: &Range<usize>, slots: &mut [Slot]) {
        let words = &self.words()[range.clone()];
        for (slot, word) in slots[range.clone()].iter_mut().zip(words) {
            slot.0 = word.load(Ordering::Relaxed);
        }
    }

    /// Copies from `slots` to this memory.
    pub(crate) fn scatter(&self, range: &Range<usize>, slots: &[Slot]) {
        let words = &self.words()[range.clone()];
        for (slot, word) in slots[range.clone()].iter().zip(words) {
            word.store(slot.0, Ordering::Relaxed);
        }
    }

    /// Takes these values, and counts ticks from zero again.
    pub(crate) fn restart(&self, slots: &[Slot]) {
        self.scatter(&(0..slots.len()), slots);
        self.tell(Exchange::NONE);
        self.ticks.store(0, Ordering::Relaxed);
    }

    /// Stores the result of a tick.
    pub(crate) fn tell(&self, done: Exchange) {
        self.sequence.store(done.sequence, Ordering::Relaxed);
        self.age.store(done.age.0, Ordering::Relaxed);
        self.granted.store(done.granted.0, Ordering::Relaxed);
    }

    /// Counts a tick when it begins.
    pub(crate) fn count(&self) {
        self.ticks.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn close(&self) {
        self.closed.store(true, Ordering::Relaxed);
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.closed.load(Ordering::Relaxed)
    }

    /// Returns the bus cycles that had arrived by the last tick.
    pub(crate) fn sequence(&self) -> u64 {
        self.sequence.load(Ordering::Relaxed)
    }

    /// Returns the age of the data at the last tick; [`Nanos::MAX`] if no data have arrived yet.
    pub(crate) fn age(&self) -> Nanos {
        Nanos(self.age.load(Ordering::Relaxed))
    }

    /// Returns the time up to which the simulation can run.
    pub(crate) fn granted(&self) -> Nanos {
        Nanos(self.granted.load(Ordering::Relaxed))
    }

    /// Returns the number of ticks so far.
    pub(crate) fn ticks(&self) -> u64 {
        self.ticks.load(Ordering::Relaxed)
    }
}
