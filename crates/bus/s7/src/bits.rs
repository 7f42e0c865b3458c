//! Copies bits between byte strings, in which bit n is bit n mod 8 of byte n / 8.

/// Copies `bits` bits of `from`, from bit `at` on, to bit `into` of `to` and those behind it.
pub(crate) fn carry(from: &[u8], at: usize, to: &mut [u8], into: usize, bits: usize) {
    if (at | into | bits).is_multiple_of(8) {
        let (at, into, count) = (at / 8, into / 8, bits / 8);
        to[into..into + count].copy_from_slice(&from[at..at + count]);
        return;
    }
    for n in 0..bits {
        let bit = from[(at + n) / 8] >> ((at + n) % 8) & 1;
        let into = into + n;
        let byte = &mut to[into / 8];
        *byte = *byte & !(1 << (into % 8)) | bit << (into % 8);
    }
}

#[cfg(test)]
mod tests {
    use super::carry;

    #[test]
    fn bits_of_any_place_are_copied_and_their_neighbours_stay() {
        let mut to = [0xFF; 3];
        carry(&[0b0000_0100, 0xAA], 2, &mut to, 7, 1);
        assert_eq!(to, [0xFF; 3]);
        carry(&[0, 0xAA], 1, &mut to, 6, 4);
        assert_eq!(to, [0x3F, 0xFC, 0xFF]);
        carry(&[1, 2], 8, &mut to, 16, 8);
        assert_eq!(to, [0x3F, 0xFC, 2]);
    }
}
