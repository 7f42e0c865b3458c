//! The buffer that the simulator and the driver share: a header, then the slots.
//!
//! Words have 8 bytes in native byte order. Word 0 is the version of this layout, 1 the status, 2 the sequence, 3 the
//! age in nanoseconds, 4 the simulation time in nanoseconds (written by the simulator; [`NO_TIME`] until then), 5 the
//! granted time in nanoseconds, 6 the number of ticks so far, 7 the number of slots, 8 the number of values that the
//! simulator saturated while it converted them, 9 the number of those that were not a number, 10 a spare slot for a
//! signal that does not exist. The slots begin at word 11.

#![allow(unsafe_code, reason = "the memory belongs to the other language")]

use std::ptr::NonNull;
use std::sync::atomic::{AtomicU64, Ordering};

use tickbus_image::signal::Slot;

/// Version of the layout; the other side compares it with its own.
const VERSION: u64 = 2;

/// The simulation time until the simulator writes one.
pub const NO_TIME: u64 = i64::MIN.cast_unsigned();

/// Words before the first slot.
const HEADER: usize = 11;

/// The spare slot, counted from the first slot.
pub const SPARE_SLOT: i32 = -1;

/// One word of the header.
#[derive(Clone, Copy)]
#[repr(usize)]
pub enum Word {
    /// The version of the layout.
    Version = 0,
    /// The status of the last exchange.
    Status = 1,
    /// How many bus cycles have arrived.
    Sequence = 2,
    /// The age of the data in nanoseconds.
    Age = 3,
    /// The simulation time in nanoseconds, written by the simulator.
    SimulationTime = 4,
    /// The time up to which the simulation may run, in nanoseconds.
    Granted = 5,
    /// How many ticks there were.
    Ticks = 6,
    /// How many slots follow.
    SlotCount = 7,
    /// How many values exceeded their 64-bit integer; counted by the simulator.
    Saturated = 8,
    /// How many values were not a number and had to become an integer; counted by the simulator.
    NotANumber = 9,
}

/// The shared buffer of one driver, and the owner of its memory.
pub struct Shared<K> {
    words: NonNull<u64>,
    slots: usize,
    _keep: K,
}

// SAFETY: the memory is not bound to a thread, and on this side only `Shared` gives access to it.
unsafe impl<K: Send> Send for Shared<K> {}

impl<K> Shared<K> {
    /// Size in bytes of a buffer for this many slots.
    pub const fn bytes(slots: usize) -> usize {
        (HEADER + slots) * size_of::<u64>()
    }

    /// Takes over `memory` and writes the header; all else is zero. `None` if `memory` is not aligned for 8-byte words.
    ///
    /// # Safety
    ///
    /// `memory` must be valid for reads and writes of `bytes(slots)` bytes for as long as `keep` lives, and hold
    /// initialised bytes. While a method of this value runs, no other code may write there; while
    /// [`slots`](Self::slots) is borrowed, no other code may access the slots.
    pub unsafe fn new(memory: NonNull<u8>, slots: usize, keep: K) -> Option<Self> {
        let words = memory.cast::<u64>();
        if !words.is_aligned() {
            return None;
        }
        let mut shared = Self {
            words,
            slots,
            _keep: keep,
        };
        shared.slots().fill(Slot(0));
        shared.restart();
        Some(shared)
    }

    /// Writes the header as it is before the first tick.
    pub fn restart(&mut self) {
        let mut header = [0; HEADER];
        header[Word::Version as usize] = VERSION;
        header[Word::SimulationTime as usize] = NO_TIME;
        header[Word::SlotCount as usize] = self.slots as u64;
        for (word, value) in header.into_iter().enumerate() {
            self.header(word).store(value, Ordering::Relaxed);
        }
    }

    /// The slots, to which this side has exclusive access while they are borrowed.
    #[inline]
    pub fn slots(&mut self) -> &mut [Slot] {
        // SAFETY: `new` was promised HEADER + slots words, aligned and initialised, that live as long as `self`; a
        // `Slot` is a transparent u64. The simulator moves slots only before and after the exchange that borrows them,
        // on the thread that makes the call: Java's `tickbus.Signal` and `include/tickbus.h` require that of their
        // callers.
        unsafe {
            std::slice::from_raw_parts_mut(self.words.add(HEADER).as_ptr().cast(), self.slots)
        }
    }

    /// Reads a word of the header.
    #[inline]
    pub fn read(&self, word: Word) -> u64 {
        self.header(word as usize).load(Ordering::Relaxed)
    }

    /// Writes a word of the header.
    #[inline]
    pub fn write(&mut self, word: Word, value: u64) {
        self.header(word as usize).store(value, Ordering::Relaxed);
    }

    /// The simulator's threads may read the header at any time, so its words are atomic.
    #[inline]
    fn header(&self, word: usize) -> &AtomicU64 {
        debug_assert!(word < HEADER);
        // SAFETY: within the words that `new` was promised, aligned, alive as long as `self`; this
        // side reaches the header through atomics only.
        unsafe { AtomicU64::from_ptr(self.words.add(word).as_ptr()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_stands_before_the_slots() {
        let mut memory = vec![u64::MAX; 14];
        let start = NonNull::new(memory.as_mut_ptr().cast()).expect("a vector has memory");
        // SAFETY: 14 words are the header and three slots; the vector outlives `shared`.
        let mut shared = unsafe { Shared::new(start, 3, ()) }.expect("a vector of u64 is aligned");
        shared.slots()[2] = Slot(42);
        shared.write(Word::Sequence, 5);
        assert_eq!(shared.read(Word::Sequence), 5);
        assert_eq!(Shared::<()>::bytes(3), 112);
        assert_eq!(
            memory,
            [VERSION, 0, 5, 0, NO_TIME, 0, 0, 3, 0, 0, 0, 0, 0, 42]
        );
    }

    #[test]
    fn memory_that_is_not_aligned_is_refused() {
        let mut memory = [0_u64; 13];
        let start = NonNull::new(memory.as_mut_ptr().cast::<u8>()).expect("an array has memory");
        // SAFETY: one byte into 13 words leaves more than the 12 words that one slot needs.
        assert!(unsafe { Shared::new(start.add(1), 1, ()) }.is_none());
    }
}
