//! Copies bits between byte strings, in which bit n is bit n mod 8 of byte n / 8.

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
pub fn copy_bits(source: &[u8], from: usize, count: usize, target: &mut [u8], to: usize) {
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
}
