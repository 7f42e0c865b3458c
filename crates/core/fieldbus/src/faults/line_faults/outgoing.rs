//! The frames that a station sends while answers are slow.

use tickbus_base::time::Nanos;

use super::super::ring::Ring;
use super::Taken;

/// How long a pulse may hold up the frames behind it while the peer polls only other bits. Peers poll more often than
/// that.
pub(super) const PATIENCE: Nanos = Nanos::from_secs(1);

/// Outgoing frames.
#[derive(Debug)]
pub(super) struct Outgoing {
    /// The mask of latched bits: the peer must see each change of these.
    latched: Box<[u8]>,
    /// The newest bytes of the image.
    pub(super) newest: Box<[u8]>,
    /// The bytes that the bus sends.
    pub(super) current: Box<[u8]>,
    /// The bytes that the peer received last.
    pub(super) sent: Box<[u8]>,
    /// The mask of bits that the peer reads: all at first; a bit that the peer has not read for [`PATIENCE`] is
    /// removed.
    pub(super) read: Box<[u8]>,
    /// True if the peer has read anything since `current` was set. `held_up` is the time since when a pulse in
    /// `current` has held up the frames behind it nevertheless.
    pub(super) reads: bool,
    held_up: Option<Nanos>,
    /// Changes that are held back.
    pub(super) waiting: Option<Ring>,
    /// When the bus last took or repeated an image. `values-late` does not hold back the next image after a link was
    /// down, on a new connection, or after a pause of more than [`PATIENCE`] such as after a lost request: the outage
    /// has delayed that image already.
    pub(super) taken: Taken,
    /// True if the frame of the current cycle repeats the previous one.
    pub(super) repeats: bool,
    /// True if the station is cut off in the current cycle: the bus was given old bytes, so that it has something to send.
    pub(super) is_cut: bool,
    /// How many waiting changes, from the oldest on, wait only for their edges: the peer has newer values already.
    overtaken: usize,
    /// The origin of the bytes that the bus was given, and thus the one to notify when they were sent.
    pub(super) given: Given,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Given {
    /// The image, which keeps its pulses until they were sent.
    Image,
    /// The ring: the image released these bytes long ago.
    Held,
}

impl Outgoing {
    /// The frames of a station that sent `last_sent` last; the bus took these bytes at `taken`.
    pub(super) fn new(last_sent: Box<[u8]>, latched: Box<[u8]>, taken: Taken) -> Self {
        Self {
            latched,
            newest: last_sent.clone(),
            current: last_sent.clone(),
            read: vec![0xFF; last_sent.len()].into(),
            sent: last_sent,
            reads: false,
            held_up: None,
            waiting: None,
            repeats: false,
            is_cut: false,
            taken,
            overtaken: 0,
            given: Given::Image,
        }
    }

    /// Returns true if the image's bytes go to the bus directly.
    pub(super) fn is_through(&self, slow: Nanos) -> bool {
        slow == Nanos::ZERO
            && self.waiting.as_ref().is_none_or(Ring::is_empty)
            && !(self.given == Given::Held && self.has_unseen(&self.current))
    }

    /// The bus takes the image at `now`. Returns true if the line has already delayed the image, so that no fault has
    /// to.
    pub(super) fn catches_up(&mut self, now: Nanos) -> bool {
        let has_paused = self.has_paused(now);
        self.taken = Taken::At(now);
        has_paused
    }

    /// Returns true if the bus last took an image on another connection, or more than [`PATIENCE`] ago.
    pub(super) fn has_paused(&self, now: Nanos) -> bool {
        match self.taken {
            Taken::Never => false,
            Taken::At(time) => now - time > PATIENCE,
            Taken::Before => true,
        }
    }

    /// Returns true if replacing `current` by `next` would lose a latched bit that the peer has not seen.
    fn loses(&self, next: &[u8]) -> bool {
        let bytes = self.current.iter().zip(&self.sent).zip(next);
        let mut bits = bytes.zip(self.watched());
        bits.any(|(((current, sent), next), watched)| {
            (current ^ sent) & (current ^ next) & watched != 0
        })
    }

    /// The latched bits that the peer reads.
    fn watched(&self) -> impl Iterator<Item = u8> {
        let bytes = self.latched.iter().zip(&self.read);
        bytes.map(|(latched, read)| latched & read)
    }

    /// Returns true if the peer has polled for [`PATIENCE`] without reading the pulse in `current`. Such a peer does
    /// not read that bit, and the bits that it does read must not wait forever.
    fn is_left_out(&mut self, now: Nanos) -> bool {
        if !self.reads {
            return false;
        }
        if now < *self.held_up.get_or_insert(now) + PATIENCE {
            return false;
        }
        let bytes = self.current.iter().zip(&self.sent);
        for (read, (current, sent)) in self.read.iter_mut().zip(bytes) {
            *read &= !(current ^ sent);
        }
        true
    }

    /// Returns true if a latched bit of `bytes` differs from the one that the peer has seen.
    fn has_unseen(&self, bytes: &[u8]) -> bool {
        let mut bits = bytes.iter().zip(&self.sent).zip(self.watched());
        bits.any(|((bytes, sent), watched)| (bytes ^ sent) & watched != 0)
    }

    /// Holds the image's bytes back and finds the bytes that are due by `now`; returns true if something was sent
    /// early.
    pub(super) fn hold(&mut self, now: Nanos, slow: Nanos, image: &[u8]) -> bool {
        let mut hurried = false;
        self.given = Given::Held;
        let was_behind = self.catches_up(now);
        if *image != *self.newest {
            self.newest.copy_from_slice(image);
            if self.waiting.as_ref().is_some_and(Ring::is_full) {
                hurried = true;
                self.advance();
            }
            if let Some(ring) = &mut self.waiting {
                ring.push(now, image);
            }
        }
        if slow == Nanos::ZERO || was_behind {
            // The fault or the outage is over: values become current at once, and edges are shown one at a time.
            take_bits(&mut self.current, &self.newest, |byte| !self.latched[byte]);
            self.overtaken = self.waiting.as_ref().map_or(0, Ring::len);
        }
        while let Some((taken, next)) = self.waiting.as_ref().and_then(Ring::front) {
            let due = self.overtaken > 0 || taken + slow <= now;
            if !due {
                break;
            }
            if self.loses(next) {
                if !self.is_left_out(now) {
                    break;
                }
                hurried = true;
            }
            self.advance();
        }
        hurried
    }

    /// Makes the oldest held change the bytes that the bus sends.
    fn advance(&mut self) {
        if let Some(ring) = &mut self.waiting
            && let Some((_, next)) = ring.front()
        {
            // Values do not go back, even if the next fault began before all edges were shown.
            let is_overtaken = self.overtaken > 0;
            self.overtaken = self.overtaken.saturating_sub(1);
            take_bits(&mut self.current, next, |byte| {
                if is_overtaken {
                    self.latched[byte]
                } else {
                    u8::MAX
                }
            });
            ring.pop();
            (self.reads, self.held_up) = (false, None);
        }
    }
}

/// Copies from `next` the bits that `mask` gives for each byte.
fn take_bits(current: &mut [u8], next: &[u8], mask: impl Fn(usize) -> u8) {
    for (byte, (current, next)) in current.iter_mut().zip(next).enumerate() {
        let mask = mask(byte);
        *current = *current & !mask | next & mask;
    }
}
