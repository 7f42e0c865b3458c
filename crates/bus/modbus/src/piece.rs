//! The place of each signal in the tables, bit by bit.

use crate::table::{ADDRESSES, Span, Table};
use crate::{ElementAddress, TagAddress};
use tickbus_base::Mistake;
use tickbus_image::signal::{DataType, Signal};

/// Bits of a frame, and the bits of a table that carry them in the same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    /// The table.
    pub table: Table,
    /// The first bit in the table. For a coil or discrete input it is the offset; registers are taken as
    /// consecutive bytes in wire order, high byte first, and bit n of byte k is 8k + n.
    pub wire: usize,
    /// The first bit in the frame; bit n of byte k is 8k + n.
    pub bit: usize,
    /// The number of bits; at most [`LONGEST`](Self::LONGEST).
    pub bits: usize,
    /// True if the rest of a partly filled register belongs to the image as well, and is written as zero.
    pub fills: bool,
}

impl Piece {
    /// Number of bits of the longest signal.
    pub const LONGEST: usize = 64;

    /// The elements that the piece touches.
    pub const fn span(self) -> Span {
        let width = self.table.width();
        let first = self.wire / width;
        let end = (self.wire + self.bits).div_ceil(width);
        Span {
            first,
            count: end - first,
        }
    }

    /// The part of this piece within the bits `begin..end` of the table.
    pub(crate) fn within(self, begin: usize, end: usize) -> Option<Self> {
        let from = self.wire.max(begin);
        let to = (self.wire + self.bits).min(end);
        (from < to).then(|| Self {
            wire: from,
            bit: self.bit + from - self.wire,
            bits: to - from,
            ..self
        })
    }

    /// The bits that writing the piece affects: whole registers if it fills them.
    pub(crate) fn claim(self) -> std::ops::Range<usize> {
        if self.fills {
            let (span, width) = (self.span(), self.table.width());
            span.first * width..span.end() * width
        } else {
            self.wire..self.wire + self.bits
        }
    }

    /// The piece of a `signal` with its own place `spot`.
    ///
    /// # Errors
    ///
    /// The signal does not fit there; the message has the remedy.
    pub(crate) fn of_tag(signal: &Signal, spot: TagAddress) -> Result<Self, Mistake> {
        let ElementAddress { table, offset } = spot.place;
        let data_type = signal.data_type;
        if let Some(stated) = spot.data_type
            && stated != data_type
        {
            return Err(Mistake::new(
                format!("the address says {stated}, and the signal is {data_type}"),
                format!(
                    "write \"type\" in its [[signal]] section as the device has it, or \":{data_type}\""
                ),
            ));
        }
        let bits = signal.address().bits();
        let (bit, bits) = (bits.start, bits.len());
        let first = offset * table.width();
        let within = if table.is_bits() {
            if data_type != DataType::Bool {
                return Err(Mistake::new(
                    format!("a {data_type} does not fit into a {}", table.element()),
                    "that is a single bit, for a BOOL; a longer value lies in registers",
                ));
            }
            0
        } else {
            match (bits, spot.bit) {
                // Bits 0 to 7 of a register are in its second byte, the low one; bits 8 to 15 in its first.
                (1, Some(bit)) => 8 * (1 - usize::from(bit / 8)) + usize::from(bit % 8),
                (1, None) => {
                    return Err(Mistake::new(
                        format!("a BOOL is one bit, and a {} has 16", table.element()),
                        "name the bit behind a dot, from 0 for the lowest to 15, as in \"400021.5\"",
                    ));
                }
                (8, Some(half @ (0 | 8))) => 8 - usize::from(half),
                (8, _) => {
                    return Err(Mistake::new(
                        format!("a {data_type} is half of a {}", table.element()),
                        "write \"400021.0\" for the low byte and \"400021.8\" for the high one",
                    ));
                }
                (_, Some(_)) => {
                    return Err(Mistake::new(
                        format!("the address names a bit, and the signal is a {data_type}"),
                        "remove the dot and what follows it, or write type = \"BOOL\"",
                    ));
                }
                (_, None) => 0,
            }
        };
        let piece = Self {
            table,
            wire: first + within,
            bit,
            bits,
            fills: false,
        };
        if piece.span().end() > ADDRESSES {
            return Err(Mistake::new(
                format!(
                    "a {data_type} from {} on reaches beyond the table",
                    spot.place
                ),
                "the last offset is 65535",
            ));
        }
        Ok(piece)
    }
}
