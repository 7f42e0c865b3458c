//! Bytes of a frame as words: 64 bits are processed at a time.

use std::ops::Range;

/// Eight bytes of a frame from `byte` on, or as many as there are, as a number whose least significant byte comes first.
#[inline]
pub(super) fn word_at(bytes: &[u8], byte: usize) -> u64 {
    let rest = &bytes[byte..];
    match rest.first_chunk() {
        Some(word) => u64::from_le_bytes(*word),
        None => short_word(rest),
    }
}

/// Up to seven bytes as a number. The first and the last bytes may overlap: a call that copies a few would cost more.
#[inline]
fn short_word(bytes: &[u8]) -> u64 {
    fn ends<const N: usize>(bytes: &[u8], number: fn([u8; N]) -> u64) -> Option<u64> {
        let (first, last) = (bytes.first_chunk()?, bytes.last_chunk()?);
        Some(number(*first) | number(*last) << (8 * (bytes.len() - N)))
    }
    ends(bytes, |four| u32::from_le_bytes(four).into())
        .or_else(|| ends(bytes, |two| u16::from_le_bytes(two).into()))
        .or_else(|| ends(bytes, |[one]| one.into()))
        .unwrap_or(0)
}

/// The bits of the eight bytes from `byte` on that are among `bits` of the frame.
pub(super) fn among(byte: usize, bits: &Range<usize>) -> u64 {
    let below = |end: usize| match end.saturating_sub(byte * 8) {
        end @ 0..64 => (1 << end) - 1,
        _ => u64::MAX,
    };
    below(bits.end) & !below(bits.start)
}
