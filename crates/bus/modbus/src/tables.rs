//! The four tables of one unit, and the bits of its two frames that their elements carry.

use std::ops::Range;

use tickbus_fieldbus::{Row, RowPart, copy_bits, count_while};

use super::table::{ADDRESSES, Span, Table};
use super::{Exception, Piece};

/// One of the two frames of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The frame that this end writes, and clients only read.
    Sends,
    /// The frame that clients write.
    Holds,
}

/// The elements of each table that exist, and what they carry.
#[derive(Clone, Debug, Default)]
pub struct Map {
    tables: [Layout; Table::ALL.len()],
    /// The eight bits that function 7 reads.
    exception_status: Option<(Table, Span)>,
    /// The holding registers with which the queues of function 24 begin.
    queues: Vec<usize>,
    /// True if an element of one table is never one of another table as well.
    is_placed: bool,
}

/// The same for one table.
#[derive(Clone, Debug, Default)]
struct Layout {
    /// The offsets of the elements that exist, in order; no two ranges meet.
    exist: Vec<Range<usize>>,
    parts: Row<Part>,
    /// For each part, the number of its run: parts that follow each other in the table, perhaps with gaps, and in the frame
    /// without any.
    runs: Vec<u32>,
}

/// Bits of a frame, and the bits of a table that carry them in the same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Part {
    side: Side,
    /// The first bit in the table, counted as in [`Piece::wire`].
    wire: usize,
    /// The first bit in the frame.
    bit: usize,
    bits: usize,
}

impl Part {
    fn end(self) -> usize {
        self.wire + self.bits
    }

    /// True if this part continues another one in the frame, and comes behind it in the table.
    fn follows(&self, other: &Self) -> bool {
        let continues = self.side == other.side && self.bit == other.bit + other.bits;
        continues && self.wire >= other.end()
    }
}

impl RowPart for Part {
    #[inline]
    fn bits(&self) -> Range<usize> {
        self.wire..self.end()
    }

    fn append(&mut self, next: &Self) -> bool {
        let continues = next.wire == self.end() && next.follows(self);
        if continues {
            self.bits += next.bits;
        }
        continues
    }
}

impl Layout {
    fn add(&mut self, elements: Range<usize>) {
        let elements = elements.start.min(ADDRESSES)..elements.end.min(ADDRESSES);
        if !elements.is_empty() {
            self.exist.push(elements);
        }
    }

    /// Orders what was added.
    fn finish(&mut self) {
        self.exist.sort_by_key(|range| range.start);
        self.exist.dedup_by(|next, range| {
            let meet = next.start <= range.end;
            if meet {
                range.end = range.end.max(next.end);
            }
            meet
        });
        self.parts.finish();
        let mut run = 0;
        let mut last: Option<&Part> = None;
        let runs = self.parts.parts().iter().map(|part| {
            run += u32::from(last.is_some_and(|last| !part.follows(last)));
            last = Some(part);
            run
        });
        self.runs = runs.collect();
    }

    /// The parts of the frames that consecutive elements carry, with the `width` of an element in bits.
    #[inline]
    fn find(&self, span: Span, width: usize) -> Result<Found<'_>, Exception> {
        let place = count_while(&self.exist, |range| range.end <= span.first);
        let holds = |range: &Range<usize>| range.start <= span.first && span.end() <= range.end;
        if !self.exist.get(place).is_some_and(holds) {
            return Err(Exception::ILLEGAL_DATA_ADDRESS);
        }
        let (from, end) = (span.first * width, span.end() * width);
        let found = self.parts.find(&(from..end));
        let runs = &self.runs[found.clone()];
        let is_one_run = runs.first().is_some_and(|first| runs.last() == Some(first));
        Ok(Found {
            parts: &self.parts.parts()[found],
            is_one_run,
            from,
            end,
        })
    }
}

/// The parts of the frames that consecutive elements carry.
#[derive(Clone, Copy, Debug, Default)]
struct Found<'a> {
    /// Parts that reach into the elements or, if others overlap them, end before.
    parts: &'a [Part],
    /// True if the parts follow each other in the frame.
    is_one_run: bool,
    /// The bits of the elements in the table.
    from: usize,
    end: usize,
}

impl<'a> Found<'a> {
    /// The parts within the elements.
    fn parts(self) -> impl Iterator<Item = Part> + use<'a> {
        self.parts.iter().filter_map(move |part| {
            let wire = part.wire.max(self.from);
            let end = part.end().min(self.end);
            (wire < end).then(|| Part {
                wire,
                bit: part.bit + wire - part.wire,
                bits: end - wire,
                ..*part
            })
        })
    }

    /// All parts within the elements as one, if they follow each other in the frame. Its place in the table is that of the
    /// first.
    fn run(self) -> Option<Part> {
        let (first, last) = (self.parts.first()?, self.parts.last()?);
        let cut = self.from.saturating_sub(first.wire);
        let end = last.bit + last.bits - last.end().saturating_sub(self.end);
        self.is_one_run.then(|| Part {
            wire: first.wire + cut,
            bit: first.bit + cut,
            bits: end - first.bit - cut,
            ..*first
        })
    }

    /// The only part, if it carries all elements, and has whole bytes of its frame.
    fn whole(self) -> Option<(Side, Range<usize>)> {
        let [part] = self.parts else {
            return None;
        };
        let bit = (part.bit + self.from).checked_sub(part.wire)?;
        let bits = self.end - self.from;
        let fits = part.wire <= self.from && self.end <= part.end();
        let bytes = bit / 8..(bit + bits) / 8;
        (fits && (bit | bits).is_multiple_of(8)).then_some((part.side, bytes))
    }

    fn has(self, side: Side) -> bool {
        match self.parts {
            // A single part reaches into the elements.
            [part] => part.side == side,
            _ => self.parts().any(|part| part.side == side),
        }
    }
}

impl Map {
    /// Both areas as wholes: discrete inputs and input registers are `%I`, coils and holding registers `%Q`, each
    /// from 0 on. In addition `%I` may be repeated in the writable tables: from the register `window` on, and
    /// from the coil that is the first bit of that register.
    ///
    /// `input` is the side of `%I`, and the frames have `sends` and `holds` bytes. If `holds` is odd, the frame has an
    /// additional byte that completes the last register.
    pub fn of_areas(input: Side, window: Option<usize>, sends: usize, holds: usize) -> Self {
        let output = match input {
            Side::Sends => Side::Holds,
            Side::Holds => Side::Sends,
        };
        let mut map = Self::default();
        for table in Table::ALL {
            let layout = &mut map.tables[table as usize];
            let areas = if table.is_writable() {
                [Some((0, output)), window.map(|window| (window, input))]
            } else {
                [Some((0, input)), None]
            };
            for (register, side) in areas.into_iter().flatten() {
                let bytes = match side {
                    Side::Sends => sends,
                    Side::Holds => holds,
                };
                let first = register * 16 / table.width();
                layout.add(first..first + table.elements(bytes));
                let bytes = match side {
                    Side::Holds if !table.is_bits() => bytes.next_multiple_of(2),
                    _ => bytes,
                };
                layout.parts.push(Part {
                    side,
                    wire: register * 16,
                    bit: 0,
                    bits: bytes * 8,
                });
            }
            layout.finish();
        }
        map
    }

    /// The elements that `pieces` touch, and those that are `reserved`, which carry nothing. No two pieces share bits
    /// unless clients write both.
    pub fn of_places(pieces: &[(Side, Piece)], reserved: &[(Table, Span)]) -> Self {
        let mut map = Self {
            is_placed: true,
            ..Self::default()
        };
        for (table, span) in reserved {
            map.tables[*table as usize].add(span.first..span.end());
        }
        for (side, piece) in pieces {
            let layout = &mut map.tables[piece.table as usize];
            let span = piece.span();
            layout.add(span.first..span.end());
            layout.parts.push(Part {
                side: *side,
                wire: piece.wire,
                bit: piece.bit,
                bits: piece.bits,
            });
        }
        map.tables.iter_mut().for_each(Layout::finish);
        map
    }

    /// The same map, whose eight bits from `first` on function 7 reads, and whose holding registers `queues` function 24
    /// can read as queues. Elements that do not exist are left out.
    #[must_use]
    pub fn with_extras(mut self, status: Option<(Table, usize)>, queues: &[usize]) -> Self {
        let status = status.map(|(table, first)| (table, Span { first, count: 8 }));
        self.exception_status = status.filter(|(table, span)| self.find(*table, *span).is_ok());
        let exists = |first: usize| {
            let span = Span { first, count: 1 };
            self.find(Table::HoldingRegisters, span).is_ok()
        };
        let queues = queues.iter().copied();
        self.queues = queues.filter(|first| exists(*first)).collect();
        self
    }

    /// The eight bits that function 7 reads, if it exists.
    pub(super) fn exception_status(&self) -> Option<(Table, Span)> {
        self.exception_status
    }

    /// The holding registers with which the queues of function 24 begin.
    pub(super) fn queues(&self) -> &[usize] {
        &self.queues
    }

    /// The bits of the frame on `side` that consecutive elements carry. Scattered elements that are neighbours in the frame
    /// come as one range.
    pub fn bits(
        &self,
        side: Side,
        (table, span): (Table, Span),
    ) -> impl Iterator<Item = Range<usize>> {
        let found = self.find(table, span).unwrap_or_default();
        let run = found.run();
        let singly = if run.is_some() {
            Found::default()
        } else {
            found
        };
        let all = run.into_iter().chain(singly.parts());
        all.filter(move |part| part.side == side)
            .map(|part| part.bit..part.bit + part.bits)
    }

    /// Returns true if consecutive elements carry any bits of the frame on `side`.
    pub(super) fn carries(&self, side: Side, (table, span): (Table, Span)) -> bool {
        self.find(table, span).is_ok_and(|found| found.has(side))
    }

    /// Numbers for the bits of consecutive elements: two elements have a number in common if they are the same bits.
    pub(super) fn numbers(&self, (table, span): (Table, Span)) -> Range<usize> {
        let width = table.width();
        if self.is_placed {
            let base = table as usize * ADDRESSES * 16;
            return base + span.first * width..base + span.end() * width;
        }
        let mut bits = self.bits(Side::Holds, (table, span));
        bits.next().unwrap_or_default()
    }

    fn find(&self, table: Table, span: Span) -> Result<Found<'_>, Exception> {
        self.tables[table as usize].find(span, table.width())
    }
}

/// The tables of one unit at one moment.
#[derive(Debug)]
pub struct Tables<'a> {
    /// The mapping of the frames.
    pub map: &'a Map,
    /// The frame that this end writes.
    pub sends: &'a [u8],
    /// The frame that clients write; if its size is odd, with an additional byte that completes the last
    /// register.
    pub holds: &'a mut [u8],
}

impl Tables<'_> {
    /// Checks that consecutive elements can be read.
    ///
    /// # Errors
    ///
    /// The elements do not exist.
    pub fn check_read(&self, table: Table, span: Span) -> Result<(), Exception> {
        self.map.find(table, span).map(|_| ())
    }

    /// Checks that consecutive elements can be written.
    ///
    /// # Errors
    ///
    /// The elements do not exist, or some are in the frame that this end writes.
    pub fn check_write(&self, table: Table, span: Span) -> Result<(), Exception> {
        if self.map.find(table, span)?.has(Side::Sends) {
            return Err(Exception::ILLEGAL_DATA_ADDRESS);
        }
        Ok(())
    }

    /// Appends consecutive elements to `reply`: bits from the lowest on, registers with the high byte first. Bits that
    /// carry nothing are 0.
    ///
    /// # Errors
    ///
    /// The elements do not exist.
    pub fn read(&self, table: Table, span: Span, reply: &mut Vec<u8>) -> Result<(), Exception> {
        let found = self.map.find(table, span)?;
        if let Some((side, bytes)) = found.whole() {
            reply.extend_from_slice(&self.frame(side)[bytes]);
            return Ok(());
        }
        let begin = reply.len();
        reply.resize(begin + (found.end - found.from).div_ceil(8), 0);
        self.gather(found, &mut reply[begin..]);
        Ok(())
    }

    /// Writes `values` into consecutive elements; they are arranged as [`read`](Self::read) appends them.
    ///
    /// # Errors
    ///
    /// As for [`check_write`](Self::check_write).
    ///
    /// # Panics
    ///
    /// If there are fewer values than elements.
    pub fn put(&mut self, table: Table, span: Span, values: &[u8]) -> Result<(), Exception> {
        let found = self.map.find(table, span)?;
        if found.has(Side::Sends) {
            return Err(Exception::ILLEGAL_DATA_ADDRESS);
        }
        if let Some((_, bytes)) = found.whole() {
            let length = bytes.len();
            self.holds[bytes].copy_from_slice(&values[..length]);
            return Ok(());
        }
        for part in found.parts() {
            let from = part.wire - found.from;
            copy_bits(values, from, part.bits, self.holds, part.bit);
        }
        Ok(())
    }

    fn gather(&self, found: Found<'_>, values: &mut [u8]) {
        for part in found.parts() {
            let frame = self.frame(part.side);
            copy_bits(frame, part.bit, part.bits, values, part.wire - found.from);
        }
    }

    fn frame(&self, side: Side) -> &[u8] {
        match side {
            Side::Sends => self.sends,
            Side::Holds => &*self.holds,
        }
    }
}
