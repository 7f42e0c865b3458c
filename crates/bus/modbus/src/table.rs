//! The four tables, and the arrangement of their elements in bytes.

use std::fmt;

/// One of the four tables of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Table {
    /// Bits that a client reads and writes.
    Coils,
    /// Bits that a client reads.
    DiscreteInputs,
    /// 16-bit words that a client reads.
    InputRegisters,
    /// 16-bit words that a client reads and writes.
    HoldingRegisters,
}

/// The number of elements that a 16-bit address reaches.
pub(super) const ADDRESSES: usize = 0x1_0000;

impl Table {
    /// All tables.
    pub const ALL: [Self; 4] = [
        Self::Coils,
        Self::DiscreteInputs,
        Self::InputRegisters,
        Self::HoldingRegisters,
    ];

    /// The name of one element, as spelled in addresses.
    pub const fn element(self) -> &'static str {
        match self {
            Self::Coils => "coil",
            Self::DiscreteInputs => "discrete-input",
            Self::InputRegisters => "input-register",
            Self::HoldingRegisters => "holding-register",
        }
    }

    /// The first digit of the elements' numbers.
    pub const fn digit(self) -> char {
        match self {
            Self::Coils => '0',
            Self::DiscreteInputs => '1',
            Self::InputRegisters => '3',
            Self::HoldingRegisters => '4',
        }
    }

    /// True if the elements are bits; otherwise they are 16-bit words.
    pub const fn is_bits(self) -> bool {
        matches!(self, Self::Coils | Self::DiscreteInputs)
    }

    /// True if a client may write the table.
    pub const fn is_writable(self) -> bool {
        matches!(self, Self::Coils | Self::HoldingRegisters)
    }

    /// Bits of one element.
    pub const fn width(self) -> usize {
        if self.is_bits() { 1 } else { 16 }
    }

    /// The number of elements for this many bytes of an image. A single last byte makes half a register,
    /// which can be requested.
    pub const fn elements(self, bytes: usize) -> usize {
        if self.is_bits() {
            bytes * 8
        } else {
            bytes.div_ceil(2)
        }
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Coils => "coils",
            Self::DiscreteInputs => "discrete inputs",
            Self::InputRegisters => "input registers",
            Self::HoldingRegisters => "holding registers",
        })
    }
}

/// Consecutive elements, from a wire offset on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Span {
    /// Offset of the first, from 0.
    pub first: usize,
    /// The number of elements.
    pub count: usize,
}

impl Span {
    /// The offset just beyond the last.
    pub const fn end(self) -> usize {
        self.first + self.count
    }
}

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.count {
            0 | 1 => write!(f, "{}", self.first),
            count => write!(f, "{}..{}", self.first, self.first + count - 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_alone_is_eight_bits_and_a_register() {
        assert_eq!(Table::Coils.elements(3), 24);
        assert_eq!(Table::InputRegisters.elements(3), 2);
        assert_eq!(Table::HoldingRegisters.elements(0), 0);
    }
}
