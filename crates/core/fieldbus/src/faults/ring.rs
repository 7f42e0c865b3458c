//! A queue of frames that are held back.

use tickbus_base::time::Nanos;

/// A fixed number of frames of one size, each with the time at which it was put in.
#[derive(Debug)]
pub(super) struct Ring {
    size: usize,
    bytes: Box<[u8]>,
    taken: Box<[Nanos]>,
    first: usize,
    count: usize,
}

/// The maximum number of frames that a ring holds.
const FRAMES: usize = 4096;
/// The minimum number of frames that a ring holds, however large they are.
const LEAST_FRAMES: usize = 64;
/// The memory in bytes for a ring. Within the two limits above, this sets the number of frames.
const BYTES: usize = 8 << 20;

impl Ring {
    /// A ring for frames of `size` bytes.
    pub(super) fn new(size: usize) -> Self {
        Self::with_room(size, (BYTES / size.max(1)).clamp(LEAST_FRAMES, FRAMES))
    }

    fn with_room(size: usize, frames: usize) -> Self {
        Self {
            size,
            bytes: vec![0; size * frames].into(),
            taken: vec![Nanos::ZERO; frames].into(),
            first: 0,
            count: 0,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    pub(super) fn is_full(&self) -> bool {
        self.count == self.taken.len()
    }

    /// Returns true if at most two more frames fit.
    pub(super) fn is_nearly_full(&self) -> bool {
        self.count + 2 >= self.taken.len()
    }

    /// Appends a frame.
    ///
    /// # Panics
    ///
    /// If the ring [is full](Self::is_full).
    pub(super) fn push(&mut self, now: Nanos, bytes: &[u8]) {
        assert!(!self.is_full(), "no room for another frame");
        let place = (self.first + self.count) % self.taken.len();
        self.taken[place] = now;
        self.bytes[place * self.size..][..self.size].copy_from_slice(bytes);
        self.count += 1;
    }

    /// The oldest frame, and when it was put in.
    pub(super) fn front(&self) -> Option<(Nanos, &[u8])> {
        let bytes = &self.bytes[self.first * self.size..];
        (self.count > 0).then(|| (self.taken[self.first], &bytes[..self.size]))
    }

    /// Drops the oldest frame.
    pub(super) fn pop(&mut self) {
        if self.count > 0 {
            self.first = (self.first + 1) % self.taken.len();
            self.count -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_out_as_they_went_in() {
        let mut ring = Ring::with_room(2, 3);
        let mut next = 0_u8;
        for round in 0..5_u8 {
            for step in 0..3 {
                let number = round * 3 + step;
                ring.push(Nanos(i64::from(number)), &[number, !number]);
            }
            assert!(ring.is_full());
            while let Some((taken, bytes)) = ring.front() {
                assert_eq!((taken, bytes), (Nanos(i64::from(next)), &[next, !next][..]));
                ring.pop();
                next += 1;
            }
            // The next round starts at another index.
            ring.push(Nanos::ZERO, &[0, 0]);
            ring.pop();
        }
        assert!(ring.is_empty());
    }

    #[test]
    fn frames_of_no_bytes_are_frames() {
        let mut ring = Ring::new(0);
        ring.push(Nanos(5), &[]);
        assert_eq!(ring.front(), Some((Nanos(5), &[][..])));
    }
}
