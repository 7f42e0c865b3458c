//! The four tables of one unit, over the two areas of its process image.

use std::ops::Range;

use super::table::{ADDRESSES, Span, Table};
use super::{Exception, take_bits};

/// Which of the two frames of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The one that this end writes: a client only reads it.
    Sends,
    /// The one that clients write.
    Holds,
}

/// Where the two frames lie in the tables.
///
/// Discrete inputs and input registers are `%I`, coils and holding registers `%Q`, each from 0 on. Beside that
/// `%I` may lie in the tables that can be written, too: from a register on, and from the coil on that is its
/// first bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Map {
    /// The frame of `%I`; that of `%Q` is the other one.
    pub input: Side,
    /// The holding register at which `%I` begins once more.
    pub window: Option<usize>,
}

/// A place in a frame, in bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    side: Side,
    bit: usize,
}

/// The tables of one unit at one moment.
#[derive(Debug)]
pub struct Tables<'a> {
    /// Where the frames lie.
    pub map: Map,
    /// The frame that this end writes.
    pub sends: &'a [u8],
    /// The frame that clients write; where its size is odd, with one byte more, which makes the last register
    /// whole.
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

    /// Where elements in a row lie.
    fn place(&self, table: Table, span: Span) -> Result<Place, Exception> {
        let input = self.map.input;
        let output = match input {
            Side::Sends => Side::Holds,
            Side::Holds => Side::Sends,
        };
        // No address reaches beyond, however long the frame is.
        if span.end() > ADDRESSES {
            return Err(Exception::ILLEGAL_DATA_ADDRESS);
        }
        // Where there is no window, it begins where no address reaches.
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
                return Ok(Place { side, bit });
            }
        }
        Err(Exception::ILLEGAL_DATA_ADDRESS)
    }

    /// Whether elements in a row are there to be read.
    ///
    /// # Errors
    ///
    /// They are not.
    pub fn check_read(&self, table: Table, span: Span) -> Result<(), Exception> {
        self.place(table, span).map(|_| ())
    }

    /// Whether elements in a row are there to be written.
    ///
    /// # Errors
    ///
    /// They are not, or are this end's own.
    pub fn check_write(&self, table: Table, span: Span) -> Result<(), Exception> {
        match self.place(table, span)?.side {
            Side::Holds => Ok(()),
            Side::Sends => Err(Exception::ILLEGAL_DATA_ADDRESS),
        }
    }

    /// Appends elements in a row to `reply`: bits from the lowest on, registers with the high byte first. Gives
    /// their bits of the frame that this end writes, if it was that.
    ///
    /// # Errors
    ///
    /// They are not there.
    pub fn read(
        &self,
        table: Table,
        span: Span,
        reply: &mut Vec<u8>,
    ) -> Result<Option<Range<usize>>, Exception> {
        let Place { side, bit } = self.place(table, span)?;
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

    /// Lets `write` change the frame, given the bit at which elements in a row begin; gives all their bits.
    ///
    /// # Errors
    ///
    /// They are not there, or are this end's own.
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
