//! Byte orders of multi-byte values: the position of a byte or a bit. The tick swaps the bytes of whole values with the
//! `Order` in `plan/word.rs`.

use std::fmt;

/// How the bytes of a multi-byte value lie in the image; `A` is the most significant byte.
///
/// For 64-bit values the letters stand for 16-bit words in the same way, as Modbus gateways do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ByteOrder {
    /// Big-endian, as Siemens and most fieldbuses send.
    #[default]
    Abcd,
    /// Words swapped: the least significant 16-bit word first, each word big-endian.
    Cdab,
    /// Bytes swapped within each 16-bit word, words in order.
    Badc,
    /// Little-endian.
    Dcba,
}

impl ByteOrder {
    /// All byte orders.
    pub const ALL: [Self; 4] = [Self::Abcd, Self::Cdab, Self::Badc, Self::Dcba];

    /// The letters: `ABCD`, `CDAB`, `BADC` or `DCBA`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Abcd => "ABCD",
            Self::Cdab => "CDAB",
            Self::Badc => "BADC",
            Self::Dcba => "DCBA",
        }
    }

    /// The position in the image of the byte with this significance, as an offset from the value's first
    /// byte.
    ///
    /// `size` is that of the value in bytes: 1, 2, 4 or 8. `significance` 0 is its least significant byte.
    pub const fn byte_position(self, size: usize, significance: usize) -> usize {
        let big_endian = size - 1 - significance;
        if size < 2 {
            return big_endian;
        }
        match self {
            Self::Abcd => big_endian,
            Self::Cdab => (size - 2 - (big_endian & !1)) + (big_endian & 1),
            Self::Badc => big_endian ^ 1,
            Self::Dcba => significance,
        }
    }

    /// The position of bit `bit` of a value of `size` bytes: byte offset from the value's first byte, and bit
    /// within that byte.
    ///
    /// Bit n of a big-endian WORD at byte k is byte k + 1 − n/8, bit n mod 8.
    pub const fn bit_position(self, size: usize, bit: usize) -> (usize, usize) {
        (self.byte_position(size, bit / 8), bit % 8)
    }
}

impl fmt::Display for ByteOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The letters of a value in the order of its bytes in the image.
    fn letters(order: ByteOrder, size: usize) -> String {
        let mut image = vec!['?'; size];
        for (place, letter) in ('A'..).take(size).enumerate() {
            image[order.byte_position(size, size - 1 - place)] = letter;
        }
        image.into_iter().collect()
    }

    #[test]
    fn each_order_lays_four_bytes_as_its_name_says() {
        for order in ByteOrder::ALL {
            assert_eq!(letters(order, 4), order.name());
        }
    }

    #[test]
    fn eight_bytes_are_laid_in_words_and_two_in_one() {
        let laid = |size| ByteOrder::ALL.map(|order| letters(order, size));
        assert_eq!(laid(8), ["ABCDEFGH", "GHEFCDAB", "BADCFEHG", "HGFEDCBA"]);
        assert_eq!(laid(2), ["AB", "AB", "BA", "BA"]);
        assert_eq!(laid(1), ["A"; 4]);
    }

    #[test]
    fn bits_of_a_word_lie_as_the_rule_says() {
        for bit in 0..16 {
            assert_eq!(ByteOrder::Abcd.bit_position(2, bit), (1 - bit / 8, bit % 8));
            assert_eq!(ByteOrder::Dcba.bit_position(2, bit), (bit / 8, bit % 8));
        }
    }
}
