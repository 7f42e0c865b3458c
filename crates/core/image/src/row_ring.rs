//! A ring of rows between two threads, lock-free and wait-free: ticks to be recorded, events of a bus.

use crate::signal::Slot;
use crate::sync::{Arc, AtomicU64, AtomicUsize, Ordering};

#[derive(Debug)]
struct Shared {
    /// The rows, one after another. Atomic words, written relaxed and ordered by the indices, keep this free
    /// of unsafe code.
    words: Box<[AtomicU64]>,
    /// Capacity in rows, a power of two.
    rows: usize,
    /// Words of one row.
    size: usize,
    /// Rows ever pushed; the place of row n is n modulo the capacity.
    pushed: AtomicUsize,
    /// Rows ever taken.
    taken: AtomicUsize,
}

impl Shared {
    fn place(&self, row: usize) -> &[AtomicU64] {
        let start = (row & (self.rows - 1)) * self.size;
        &self.words[start..start + self.size]
    }
}

/// The side that appends rows.
#[derive(Debug)]
pub struct RowWriter {
    shared: Arc<Shared>,
    pushed: usize,
    /// The last known value of `taken`: reading it again costs a transfer of the other thread's cache line.
    taken: usize,
}

/// The side that takes rows.
#[derive(Debug)]
pub struct RowReader {
    shared: Arc<Shared>,
}

/// Creates a ring for `rows` rows (rounded up to a power of two) of `size` words each.
pub fn row_ring(rows: usize, size: usize) -> (RowWriter, RowReader) {
    let rows = rows.max(1).next_power_of_two();
    let shared = Arc::new(Shared {
        words: (0..rows * size).map(|_| AtomicU64::new(0)).collect(),
        rows,
        size,
        pushed: AtomicUsize::new(0),
        taken: AtomicUsize::new(0),
    });
    let writer = RowWriter {
        shared: Arc::clone(&shared),
        pushed: 0,
        taken: 0,
    };
    (writer, RowReader { shared })
}

impl RowWriter {
    /// Appends a row, `head` followed by `slots`, together `size` words. Takes no lock, makes no system
    /// call, allocates nothing. Returns false, and appends nothing, if the ring is full.
    ///
    /// # Panics
    ///
    /// When `head` is longer than a row.
    #[inline]
    pub fn push(&mut self, head: &[u64], slots: &[Slot]) -> bool {
        if self.is_full() {
            return false;
        }
        let place = self.shared.place(self.pushed);
        let (place_head, place_slots) = place.split_at(head.len());
        for (word, value) in place_head.iter().zip(head) {
            word.store(*value, Ordering::Relaxed);
        }
        for (word, slot) in place_slots.iter().zip(slots) {
            word.store(slot.0, Ordering::Relaxed);
        }
        self.pushed = self.pushed.wrapping_add(1);
        self.shared.pushed.store(self.pushed, Ordering::Release);
        true
    }

    /// True if there is no room for another row.
    #[inline]
    pub fn is_full(&mut self) -> bool {
        let rows = self.shared.rows;
        if self.pushed.wrapping_sub(self.taken) == rows {
            self.taken = self.shared.taken.load(Ordering::Acquire);
        }
        self.pushed.wrapping_sub(self.taken) == rows
    }

    /// True if more than half of the ring is in use.
    #[inline]
    pub fn is_half_full(&mut self) -> bool {
        let half = self.shared.rows / 2;
        if self.pushed.wrapping_sub(self.taken) > half {
            self.taken = self.shared.taken.load(Ordering::Acquire);
        }
        self.pushed.wrapping_sub(self.taken) > half
    }
}

impl RowReader {
    /// Copies the oldest row into `words`, which must be one row long, and frees its place; false if the ring is
    /// empty.
    pub fn take(&mut self, words: &mut [u64]) -> bool {
        let shared = &*self.shared;
        let taken = shared.taken.load(Ordering::Relaxed);
        if taken == shared.pushed.load(Ordering::Acquire) {
            return false;
        }
        for (word, place) in words.iter_mut().zip(shared.place(taken)) {
            *word = place.load(Ordering::Relaxed);
        }
        shared.taken.store(taken.wrapping_add(1), Ordering::Release);
        true
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn rows_come_out_in_order_and_a_full_ring_takes_none() {
        let (mut writer, mut reader) = row_ring(4, 3);
        for n in 0..4 {
            assert!(writer.push(&[n], &[Slot(n + 1), Slot(n + 2)]));
        }
        assert!(!writer.push(&[9], &[Slot(9), Slot(9)]));
        let mut words = [0; 3];
        for n in 0..4 {
            assert!(reader.take(&mut words));
            assert_eq!(words, [n, n + 1, n + 2]);
        }
        assert!(!reader.take(&mut words));
        assert!(writer.push(&[9], &[Slot(9), Slot(9)]));
    }

    #[test]
    fn threads_never_tear_a_row() {
        const SENT: u64 = if cfg!(miri) { 300 } else { 100_000 };
        let (mut writer, mut reader) = row_ring(8, 5);
        let pushing = std::thread::spawn(move || {
            (0..SENT)
                .filter(|n| writer.push(&[*n], &[Slot(*n); 4]))
                .count()
        });
        let (mut words, mut seen, mut last) = ([0; 5], 0, None);
        let mut take_all = || {
            while reader.take(&mut words) {
                assert_eq!(words, [words[0]; 5]);
                assert!(last < Some(words[0]));
                last = Some(words[0]);
                seen += 1;
            }
        };
        while !pushing.is_finished() {
            take_all();
        }
        // Only joining makes the last rows visible for certain.
        let pushed = pushing.join().expect("no panic");
        take_all();
        assert_eq!(pushed, seen);
    }
}

#[cfg(all(test, loom))]
mod loom_tests {
    use super::*;

    #[test]
    fn loom_rows_arrive_whole_and_in_order() {
        loom::model(|| {
            let (mut writer, mut reader) = row_ring(2, 2);
            let pushing = loom::thread::spawn(move || {
                for n in 1..=3 {
                    writer.push(&[n], &[Slot(n)]);
                }
            });
            let (mut words, mut last) = ([0; 2], 0);
            for _ in 0..3 {
                if reader.take(&mut words) {
                    assert_eq!(words[0], words[1]);
                    assert!(words[0] > last);
                    last = words[0];
                }
            }
            pushing.join().unwrap();
        });
    }
}
