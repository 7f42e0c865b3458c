//! One axis per message: an image sent over the wire in parts.

use std::ops::Range;

/// Size of the part number at the start of every message.
const SELECTOR: usize = 2;

/// The split of an area into parts: each axis is one, numbered from 1; everything else is part 0.
///
/// A message is the part's number as a big-endian UINT, then its bytes, then zeros up to the common size of
/// all messages in this direction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parts {
    /// By number: the ranges of the part's bytes, in order.
    pieces: Box<[Vec<Range<usize>>]>,
    /// Size of the whole area in bytes.
    area: usize,
    longest: usize,
}

impl Parts {
    /// Splits an area of `area` bytes; `axes` are the ranges of the structures.
    pub fn new(area: usize, axes: impl IntoIterator<Item = Range<usize>>) -> Self {
        let mut pieces: Vec<Vec<Range<usize>>> = vec![Vec::new()];
        let mut taken = vec![false; area];
        for axis in axes {
            taken[axis.clone()].fill(true);
            pieces.push(vec![axis]);
        }
        let mut at = 0;
        for run in taken.chunk_by(|one, other| one == other) {
            let piece = at..at + run.len();
            at = piece.end;
            if !run[0] {
                pieces[0].push(piece);
            }
        }
        let bytes = |part: &Vec<Range<usize>>| part.iter().map(ExactSizeIterator::len).sum();
        Self {
            longest: pieces.iter().map(bytes).max().unwrap_or(0),
            pieces: pieces.into(),
            area,
        }
    }

    /// Size of a message; 0 if there is nothing to send.
    pub fn message_bytes(&self) -> usize {
        if self.area == 0 {
            0
        } else {
            SELECTOR + self.longest
        }
    }

    fn count(&self) -> usize {
        self.pieces.len()
    }

    fn is_empty(&self, part: usize) -> bool {
        self.pieces[part].is_empty()
    }

    fn differ(&self, part: usize, one: &[u8], other: &[u8]) -> bool {
        let mut pieces = self.pieces[part].iter();
        pieces.any(|piece| one[piece.clone()] != other[piece.clone()])
    }

    /// Copies a part of `frame` into a message.
    fn write(&self, part: usize, frame: &[u8], message: &mut [u8]) {
        let number = u16::try_from(part).expect("a driver has fewer axes");
        let (selector, mut bytes) = message.split_at_mut(SELECTOR);
        selector.copy_from_slice(&number.to_be_bytes());
        for piece in &self.pieces[part] {
            let (place, rest) = bytes.split_at_mut(piece.len());
            place.copy_from_slice(&frame[piece.clone()]);
            bytes = rest;
        }
        bytes.fill(0);
    }

    /// Copies the part in a message into `frame`; returns its number of bytes.
    fn read(&self, message: &[u8], frame: &mut [u8]) -> Result<usize, String> {
        let (selector, mut bytes) = message.split_at(SELECTOR);
        let number = usize::from(u16::from_be_bytes([selector[0], selector[1]]));
        if number >= self.count() || self.is_empty(number) {
            let axes = self.count() - 1;
            return Err(format!(
                "a message is for axis {number}, but there are {axes}, from 1 on{}; both ends need the same \
                 [[axis]] tables",
                if self.is_empty(0) {
                    ", and nothing beside them"
                } else {
                    ", and 0 for what is beside them"
                }
            ));
        }
        for piece in &self.pieces[number] {
            let (from, rest) = bytes.split_at(piece.len());
            frame[piece.clone()].copy_from_slice(from);
            bytes = rest;
        }
        Ok(self.pieces[number].iter().map(Range::len).sum())
    }
}

/// The messages of one connection in both directions.
#[derive(Debug)]
pub(super) struct Messages {
    sends: Parts,
    receives: Parts,
    /// The frame as the peer has it, and as it will be after the last message.
    there: Box<[u8]>,
    /// True if the peer has received the part, for each.
    known: Box<[bool]>,
    /// The frame made of the parts received so far; the others are zero.
    come: Box<[u8]>,
    /// The last message: its part, its bytes, and whether they are new to the peer.
    part: usize,
    filled: Box<[u8]>,
    news: bool,
}

impl Messages {
    pub(super) fn new(sends: Parts, receives: Parts) -> Self {
        Self {
            there: vec![0; sends.area].into(),
            filled: vec![0; sends.area].into(),
            known: vec![false; sends.count()].into(),
            come: vec![0; receives.area].into(),
            part: 0,
            news: false,
            sends,
            receives,
        }
    }

    pub(super) fn sizes(&self) -> (usize, usize) {
        (self.sends.message_bytes(), self.receives.message_bytes())
    }

    pub(super) fn begin(&mut self) {
        self.known.fill(false);
        self.come.fill(0);
        self.part = 0;
    }

    /// The whole frame after this message's part was received, and the number of bytes in that part.
    pub(super) fn received(&mut self, message: &[u8]) -> Result<(&[u8], usize), String> {
        let bytes = self.receives.read(message, &mut self.come)?;
        Ok((&self.come, bytes))
    }

    /// Makes a message of the part that is due: the next changed one, or otherwise simply the next one.
    pub(super) fn fill(&mut self, frame: &[u8], message: &mut [u8]) {
        let count = self.sends.count();
        let next = || (1..=count).map(|step| (self.part + step) % count);
        let changed = next().find(|part| {
            !self.sends.is_empty(*part)
                && (!self.known[*part] || self.sends.differ(*part, &self.there, frame))
        });
        let any = next().find(|part| !self.sends.is_empty(*part));
        self.news = changed.is_some();
        self.part = changed.or(any).unwrap_or(0);
        self.filled.copy_from_slice(frame);
        self.sends.write(self.part, frame, message);
    }

    pub(super) fn is_news(&self) -> bool {
        self.news
    }

    /// The peer has the last message; returns the ranges of the frame in it.
    pub(super) fn sent(&mut self) -> &[Range<usize>] {
        let pieces = &self.sends.pieces[self.part];
        for piece in pieces {
            self.there[piece.clone()].copy_from_slice(&self.filled[piece.clone()]);
        }
        self.known[self.part] = true;
        pieces
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two axes of 3 bytes, with a byte between them and one after them.
    fn parts() -> Parts {
        Parts::new(8, [0..3, 4..7])
    }

    #[test]
    fn a_message_has_the_number_of_its_part_and_the_bytes_of_it() {
        let parts = parts();
        assert_eq!(parts.message_bytes(), 5);
        let frame = [1, 2, 3, 4, 5, 6, 7, 8];
        let mut whole = [0; 8];
        for (part, message) in [
            (0, [0, 0, 4, 8, 0]),
            (1, [0, 1, 1, 2, 3]),
            (2, [0, 2, 5, 6, 7]),
        ] {
            let mut space = [9; 5];
            parts.write(part, &frame, &mut space);
            assert_eq!(space, message);
            parts.read(&message, &mut whole).expect("a part");
        }
        assert_eq!(whole, frame);
        let told = parts
            .read(&[0, 3, 0, 0, 0], &mut whole)
            .expect_err("no such axis");
        assert!(told.contains("axis 3, but there are 2"), "{told}");
    }

    #[test]
    fn what_has_changed_goes_first_and_all_parts_go_in_turn() {
        let mut messages = Messages::new(parts(), Parts::new(0, []));
        assert_eq!(messages.sizes(), (5, 0));
        let mut space = [0; 5];
        let mut turn = |messages: &mut Messages, frame: &[u8; 8]| {
            messages.fill(frame, &mut space);
            let news = messages.is_news();
            messages.sent();
            (space[1], news)
        };
        let mut frame = [0; 8];
        let all: Vec<_> = (0..4).map(|_| turn(&mut messages, &frame)).collect();
        assert_eq!(
            all,
            [(1, true), (2, true), (0, true), (1, false)],
            "whatever it has, each part goes once"
        );
        frame[3] = 1;
        assert_eq!(turn(&mut messages, &frame), (0, true));
        assert_eq!(turn(&mut messages, &frame), (1, false));
        (frame[0], frame[4]) = (1, 1);
        assert_eq!(turn(&mut messages, &frame), (2, true));
        frame[5] = 1;
        assert_eq!(
            turn(&mut messages, &frame),
            (1, true),
            "none waits for ever"
        );
        assert_eq!(turn(&mut messages, &frame), (2, true));
        messages.begin();
        assert_eq!(turn(&mut messages, &frame), (1, true));
    }

    #[test]
    fn a_message_that_was_not_taken_is_still_news() {
        let mut messages = Messages::new(parts(), parts());
        let mut space = [0; 5];
        for _ in 0..3 {
            messages.fill(&[0; 8], &mut space);
            messages.sent();
        }
        messages.fill(&[1; 8], &mut space);
        let first = space;
        messages.fill(&[1; 8], &mut space);
        assert!(messages.is_news() && space != first);
        assert_eq!(messages.sent().first(), Some(&(4..7)));
    }
}
