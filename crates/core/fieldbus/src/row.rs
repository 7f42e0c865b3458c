//! Parts in a row of bits, such as a table or a data block, found by the bits that they cover.

use std::ops::Range;

/// A part of a row: bits that follow each other there.
pub trait RowPart {
    /// The bits of the row that this part covers.
    fn bits(&self) -> Range<usize>;

    /// Appends `next`, which does not begin before this part, if it continues this part; returns true if so.
    fn append(&mut self, next: &Self) -> bool;
}

/// Parts in a row, perhaps with gaps, and perhaps over each other.
#[derive(Clone, Debug)]
pub struct Row<P> {
    /// In the order of their first bits.
    parts: Vec<P>,
    /// For each part, where it and those before it end.
    ends: Vec<usize>,
}

impl<P> Default for Row<P> {
    fn default() -> Self {
        Self {
            parts: Vec::new(),
            ends: Vec::new(),
        }
    }
}

impl<P: RowPart> Row<P> {
    /// Adds a part, in any order. It is found after [`finish`](Self::finish).
    pub fn push(&mut self, part: P) {
        self.parts.push(part);
    }

    /// Orders the parts that were added; parts that continue each other become one.
    pub fn finish(&mut self) {
        self.parts.sort_by_key(|part| part.bits().start);
        self.parts.dedup_by(|next, part| part.append(next));
        let ends = self.parts.iter().scan(0, |end, part| {
            *end = part.bits().end.max(*end);
            Some(*end)
        });
        self.ends = ends.collect();
    }

    /// The parts in the order of their first bits.
    pub fn parts(&self) -> &[P] {
        &self.parts
    }

    /// The bit behind the last part.
    pub fn end(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    /// The positions of the parts that reach into `bits`. Where parts lie over each other, some in between may end before.
    #[inline]
    pub fn find(&self, bits: &Range<usize>) -> Range<usize> {
        let first = count_while(&self.ends, |end| *end <= bits.start);
        let count = count_while(&self.parts[first..], |part| part.bits().start < bits.end);
        first..first + count
    }
}

/// The number of items at the beginning of `list` for which `is_before` is true; it must be false for all behind them. Fast for
/// short lists, which are the usual ones.
#[inline]
pub fn count_while<T>(list: &[T], is_before: impl Fn(&T) -> bool) -> usize {
    const FEW: usize = 4;
    if list.len() > FEW {
        return list.partition_point(is_before);
    }
    let other = list.iter().position(|item| !is_before(item));
    other.unwrap_or(list.len())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    impl RowPart for Range<usize> {
        fn bits(&self) -> Range<usize> {
            self.clone()
        }

        fn append(&mut self, next: &Self) -> bool {
            let continues = self.end == next.start;
            if continues {
                self.end = next.end;
            }
            continues
        }
    }

    fn row(parts: impl IntoIterator<Item = Range<usize>>) -> Row<Range<usize>> {
        let mut row = Row::default();
        parts.into_iter().for_each(|part| row.push(part));
        row.finish();
        row
    }

    #[test]
    fn neighbours_become_one_part() {
        let row = row([9..10, 16..32, 8..9, 12..13]);
        assert_eq!(row.parts(), [8..10, 12..13, 16..32]);
        assert_eq!(row.end(), 32);
        assert_eq!(row.find(&(0..8)), 0..0);
        assert_eq!(row.find(&(9..13)), 0..2);
        assert_eq!(row.find(&(32..40)), 3..3);
    }

    proptest! {
        #[test]
        fn each_part_that_reaches_into_bits_is_found(
            parts in prop::collection::vec((0_usize..200, 1_usize..40), 0..12),
            from in 0_usize..240, count in 1_usize..60,
        ) {
            let row = row(parts.into_iter().map(|(first, bits)| first..first + bits));
            let bits = from..from + count;
            let found = row.find(&bits);
            for (at, part) in row.parts().iter().enumerate() {
                let reaches = part.start < bits.end && bits.start < part.end;
                prop_assert!(!reaches || found.contains(&at), "{:?} of {:?}", bits, row);
            }
            if let Some(first) = row.parts().get(found.start).filter(|_| !found.is_empty()) {
                prop_assert!(first.end > bits.start);
            }
        }
    }
}
