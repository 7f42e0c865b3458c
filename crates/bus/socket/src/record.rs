//! Splits a stream of bytes into records of one size.

use std::fmt;

/// The approximate size of a read, if a record is not larger.
const READ_BYTES: usize = 16 * 1024;

/// Splits a stream into records of one size, however the network has segmented it.
///
/// Bytes are put in through [`space`](Self::space) and [`arrived`](Self::arrived), and records are taken by
/// [`take`](Self::take) until that returns `None`. Nothing is allocated in the process.
#[derive(Debug)]
pub struct Records {
    size: usize,
    /// A whole number of records long, so that there is always space for at least one byte.
    buffer: Box<[u8]>,
    /// The bytes that have arrived and have not been taken.
    start: usize,
    end: usize,
}

/// The received part of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Partial {
    /// Bytes that have arrived.
    pub have: usize,
    /// Bytes of a record.
    pub of: usize,
}

impl fmt::Display for Partial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} bytes", self.have, self.of)
    }
}

impl Records {
    /// Splits a stream into records of `size` bytes. With a size of 0 there are no records: everything that
    /// arrives stays [`partial`](Self::partial).
    pub fn new(size: usize) -> Self {
        let at_once = READ_BYTES.checked_div(size).unwrap_or(1).max(1);
        Self {
            size,
            buffer: vec![0; at_once * size.max(1)].into(),
            start: 0,
            end: 0,
        }
    }

    /// The space for the next bytes of the stream. Never empty once all records have been taken.
    pub fn space(&mut self) -> &mut [u8] {
        if self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        if self.size == 0 {
            self.end = 0;
        }
        &mut self.buffer[self.end..]
    }

    /// `count` bytes were put at the beginning of [`space`](Self::space).
    ///
    /// # Panics
    ///
    /// When there was not that much space.
    pub fn arrived(&mut self, count: usize) {
        let space = self.buffer.len() - self.end;
        assert!(
            count <= space,
            "{count} bytes do not fit into a space of {space}"
        );
        self.end += count;
    }

    /// The next whole record, if it has arrived.
    pub fn take(&mut self) -> Option<&[u8]> {
        if self.size == 0 || self.end - self.start < self.size {
            return None;
        }
        let record = self.start..self.start + self.size;
        self.start = record.end;
        Some(&self.buffer[record])
    }

    /// The number of bytes that have arrived and have not been taken.
    pub fn waiting(&self) -> usize {
        self.end - self.start
    }

    /// The received part of an incomplete record; `None` between two records, and while whole ones have not been taken.
    pub fn partial(&self) -> Option<Partial> {
        let (have, of) = (self.waiting(), self.size);
        (have > 0 && (of == 0 || have < of)).then_some(Partial { have, of })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Puts in all of `bytes`, in pieces as the space requires; returns the records.
    fn feed(records: &mut Records, mut bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut whole = Vec::new();
        while !bytes.is_empty() {
            let space = records.space();
            let count = space.len().min(bytes.len());
            space[..count].copy_from_slice(&bytes[..count]);
            records.arrived(count);
            bytes = &bytes[count..];
            while let Some(record) = records.take() {
                whole.push(record.to_vec());
            }
        }
        whole
    }

    #[test]
    fn a_record_in_two_pieces_is_one_record() {
        let mut records = Records::new(4);
        assert_eq!(feed(&mut records, &[1, 2, 3]), Vec::<Vec<u8>>::new());
        assert_eq!(records.partial(), Some(Partial { have: 3, of: 4 }));
        assert_eq!(feed(&mut records, &[4]), [[1, 2, 3, 4]]);
        assert_eq!(records.partial(), None);
    }

    #[test]
    fn three_records_in_one_piece_are_three_records_in_order() {
        let mut records = Records::new(2);
        assert_eq!(
            feed(&mut records, &[1, 2, 3, 4, 5, 6, 7]),
            [[1, 2], [3, 4], [5, 6]]
        );
        assert_eq!(
            records.partial().expect("a rest").to_string(),
            "1 of 2 bytes"
        );
    }

    #[test]
    fn records_that_wait_are_no_partial_one() {
        let mut records = Records::new(2);
        records.space()[..3].copy_from_slice(&[1, 2, 3]);
        records.arrived(3);
        assert_eq!(records.partial(), None);
        assert_eq!(records.take(), Some(&[1, 2][..]));
        assert_eq!(records.partial(), Some(Partial { have: 1, of: 2 }));
    }

    #[test]
    fn a_record_larger_than_what_is_usually_read_at_once_fits() {
        let record: Vec<u8> = (0..=READ_BYTES).map(|n| n.to_le_bytes()[0]).collect();
        let mut records = Records::new(record.len());
        assert_eq!(feed(&mut records, &record), [record]);
    }

    #[test]
    fn records_of_no_bytes_never_come() {
        let mut records = Records::new(0);
        assert_eq!(records.partial(), None);
        assert_eq!(feed(&mut records, &[1, 2, 3]), Vec::<Vec<u8>>::new());
        assert_eq!(records.partial(), Some(Partial { have: 1, of: 0 }));
    }

    #[test]
    #[should_panic(expected = "do not fit")]
    fn more_than_there_was_space_for_did_not_arrive() {
        let mut records = Records::new(4);
        let space = records.space().len();
        records.arrived(space + 1);
    }

    /// A stream, and the positions where the network segments it.
    fn cut_stream() -> impl Strategy<Value = (usize, Vec<u8>, Vec<usize>)> {
        let stream = proptest::collection::vec(any::<u8>(), 0..2_000);
        let cuts = proptest::collection::vec(1..700_usize, 1..40);
        (1..600_usize, stream, cuts)
    }

    proptest! {
        /// Any stream with any segmentation (and so with any truncation) gives its whole records and no others, and the
        /// rest is counted.
        #[test]
        fn every_cutting_gives_the_same_records((size, stream, cuts) in cut_stream()) {
            let mut records = Records::new(size);
            let mut whole: Vec<Vec<u8>> = Vec::new();
            let (mut rest, mut cuts) = (&stream[..], cuts.iter().cycle());
            while !rest.is_empty() {
                let (piece, after) = rest.split_at(rest.len().min(*cuts.next().expect("endless")));
                whole.extend(feed(&mut records, piece));
                rest = after;
            }
            let expected: Vec<&[u8]> = stream.chunks_exact(size).collect();
            prop_assert_eq!(whole, expected);
            let have = stream.len() % size;
            prop_assert_eq!(records.partial(), (have > 0).then_some(Partial { have, of: size }));
        }

        /// A bit flipped by the network changes only that bit, and cannot shift a record.
        #[test]
        fn a_flipped_bit_stays_where_it_is(
            (size, mut stream, _) in cut_stream(), at in any::<usize>(), bit in 0..8_u8,
        ) {
            prop_assume!(!stream.is_empty());
            let at = at % stream.len();
            stream[at] ^= 1 << bit;
            let whole = feed(&mut Records::new(size), &stream);
            prop_assert_eq!(whole, stream.chunks_exact(size).collect::<Vec<_>>());
        }
    }
}
