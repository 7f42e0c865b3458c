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

/// Copies `count` bits of `source`, from bit `from` on, to the beginning of `target`; unused bits of the last byte
/// become zero.
///
/// # Panics
///
/// When either slice is too short.
pub fn take_bits(source: &[u8], from: usize, count: usize, target: &mut [u8]) {
    let (byte, shift) = (from / 8, from % 8);
    let bytes = count.div_ceil(8);
    for (index, target) in target[..bytes].iter_mut().enumerate() {
        let low = source[byte + index] >> shift;
        // The last bits may end within the current byte.
        let high = match source.get(byte + index + 1) {
            Some(next) if shift > 0 => next << (8 - shift),
            _ => 0,
        };
        *target = low | high;
    }
    if !count.is_multiple_of(8) {
        target[bytes - 1] &= (1 << (count % 8)) - 1;
    }
}

/// Copies `count` bits of `source`, from bit `from` on, to `target`, from bit `to` on; other bits do not change.
///
/// # Panics
///
/// When either slice is too short.
pub(super) fn copy_bits(source: &[u8], from: usize, count: usize, target: &mut [u8], to: usize) {
    if (from | to | count).is_multiple_of(8) {
        // The most common size, for which a call of memcpy takes longer than the copy.
        if count == 16 {
            target[to / 8..][..2].copy_from_slice(&source[from / 8..][..2]);
            return;
        }
        target[to / 8..(to + count) / 8].copy_from_slice(&source[from / 8..(from + count) / 8]);
        return;
    }
    // Whole bytes of the target at once, and the bits behind them one by one.
    let whole = if to.is_multiple_of(8) {
        count / 8 * 8
    } else {
        0
    };
    if whole > 0 {
        take_bits(source, from, whole, &mut target[to / 8..]);
    }
    for index in whole..count {
        let (from, to) = (from + index, to + index);
        let bit = source[from / 8] >> (from % 8) & 1;
        let mask = 1 << (to % 8);
        if bit == 0 {
            target[to / 8] &= !mask;
        } else {
            target[to / 8] |= mask;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bit(bytes: &[u8], at: usize) -> bool {
        bytes[at / 8] >> (at % 8) & 1 == 1
    }

    proptest! {
        #[test]
        fn bits_are_taken_and_put_one_for_one(
            source in prop::collection::vec(any::<u8>(), 1..40),
            other in prop::collection::vec(any::<u8>(), 40),
            from in 0_usize..320, count in 1_usize..320,
        ) {
            let bits = source.len() * 8;
            let from = from % bits;
            let count = 1 + (count - 1) % (bits - from);
            let mut taken = vec![0xFF; count.div_ceil(8)];
            take_bits(&source, from, count, &mut taken);
            for index in 0..taken.len() * 8 {
                let expected = index < count && bit(&source, from + index);
                prop_assert_eq!(bit(&taken, index), expected);
            }
            let mut target = other.clone();
            copy_bits(&taken, 0, count, &mut target, from);
            for index in 0..target.len() * 8 {
                let within = (from..from + count).contains(&index);
                let expected = bit(if within { &source } else { &other }, index);
                prop_assert_eq!(bit(&target, index), expected);
            }
        }
    }

    #[test]
    fn a_byte_alone_is_eight_bits_and_a_register() {
        assert_eq!(Table::Coils.elements(3), 24);
        assert_eq!(Table::InputRegisters.elements(3), 2);
        assert_eq!(Table::HoldingRegisters.elements(0), 0);
    }
}
