//! The four tables of one unit, mapped to the two areas of its process image.

use std::ops::Range;

use super::table::{ADDRESSES, Span, Table};
use super::{Exception, take_bits};

/// One of the two frames of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The frame that this end writes, and clients only read.
    Sends,
    /// The frame that clients write.
    Holds,
}

/// The mapping of the two frames to the tables.
///
/// Discrete inputs and input registers are `%I`, coils and holding registers `%Q`, each starting at 0. In
/// addition `%I` may be repeated in the writable tables: from the register `window` on, and from the coil
/// that is the first bit of that register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Map {
    /// The frame of `%I`; `%Q` is the other one.
    pub input: Side,
    /// The holding register at which `%I` is repeated.
    pub window: Option<usize>,
}

/// Bits of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct FrameBits {
    side: Side,
    bit: usize,
}

/// The tables of one unit at one moment.
#[derive(Debug)]
pub struct Tables<'a> {
    /// The mapping of the frames.
    pub map: Map,
    /// The frame that this end writes.
    pub sends: &'a [u8],
    /// The frame that clients write; if its size is odd, with an additional byte that completes the last
    /// register.
    pub holds: &'a mut [u8],
    /// The size of that frame.
    pub holds_len: usize,
}

impl Tables<'_> {
    fn len(&self, side: Side) -> usize {
        match side {
            Side::Sends => self.sends.len(),
            Side::Holds => self.holds_len,
        }
    }

    /// The bits of consecutive elements.
    fn place(&self, table: Table, span: Span) -> Result<FrameBits, Exception> {
        let input = self.map.input;
        let output = match input {
            Side::Sends => Side::Holds,
            Side::Holds => Side::Sends,
        };
        // No address reaches further, however long the frame is.
        if span.end() > ADDRESSES {
            return Err(Exception::ILLEGAL_DATA_ADDRESS);
        }
        // Without a window, one that no address reaches.
        let window = self.map.window.unwrap_or(ADDRESSES);
        let windows = if table.is_writable() {
            [(0, output), (window, input)]
        } else {
            [(0, input), (ADDRESSES, input)]
        };
        for (register, side) in windows {
            let first = register * 16 / table.width();
            let behind = first + table.elements(self.len(side));
            if span.first >= first && span.end() <= behind {
                let bit = (span.first - first) * table.width();
                return Ok(FrameBits { side, bit });
            }
        }
        Err(Exception::ILLEGAL_DATA_ADDRESS)
    }

    /// Checks that consecutive elements can be read.
    ///
    /// # Errors
    ///
    /// The elements do not exist.
    pub fn check_read(&self, table: Table, span: Span) -> Result<(), Exception> {
        self.place(table, span).map(|_| ())
    }

    /// Checks that consecutive elements can be written.
    ///
    /// # Errors
    ///
    /// The elements do not exist, or are in the frame that this end writes.
    pub fn check_write(&self, table: Table, span: Span) -> Result<(), Exception> {
        match self.place(table, span)?.side {
            Side::Holds => Ok(()),
            Side::Sends => Err(Exception::ILLEGAL_DATA_ADDRESS),
        }
    }

    /// Appends consecutive elements to `reply`: bits from the lowest on, registers with the high byte first.
    /// If they are in the frame that this end writes, returns their bits in it.
    ///
    /// # Errors
    ///
    /// The elements do not exist.
    pub fn read(
        &self,
        table: Table,
        span: Span,
        reply: &mut Vec<u8>,
    ) -> Result<Option<Range<usize>>, Exception> {
        let FrameBits { side, bit } = self.place(table, span)?;
        let frame = match side {
            Side::Sends => self.sends,
            Side::Holds => &*self.holds,
        };
        let bits = span.count * table.width();
        if table.is_bits() {
            let begin = reply.len();
            reply.resize(begin + bits.div_ceil(8), 0);
            take_bits(frame, bit, bits, &mut reply[begin..]);
        } else {
            let (begin, end) = (bit / 8, (bit + bits) / 8);
            reply.extend_from_slice(&frame[begin..end.min(frame.len())]);
            if end > frame.len() {
                reply.push(0);
            }
        }
        let read = bit..(bit + bits).min(frame.len() * 8);
        Ok((side == Side::Sends).then_some(read))
    }

    /// Lets `write` change the frame, given the bit at which consecutive elements begin; returns all their
    /// bits.
    ///
    /// # Errors
    ///
    /// The elements do not exist, or are in the frame that this end writes.
    pub fn write(
        &mut self,
        table: Table,
        span: Span,
        write: impl FnOnce(&mut [u8], usize),
    ) -> Result<Range<usize>, Exception> {
        self.check_write(table, span)?;
        let bit = self.place(table, span)?.bit;
        write(self.holds, bit);
        Ok(bit..bit + span.count * table.width())
    }
}
