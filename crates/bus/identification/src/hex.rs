//! Numbers as hexadecimal digits in capitals, as the protocol has them.

/// Two digits.
pub(crate) fn digits(value: u8) -> [u8; 2] {
    const DIGITS: &[u8; 16] = b"0123456789ABCDEF";
    [value >> 4, value & 0xF].map(|digit| DIGITS[usize::from(digit)])
}

/// Appends the last `count` of four digits.
pub(crate) fn append(value: u16, count: usize, out: &mut Vec<u8>) {
    let [high, low] = value.to_be_bytes().map(digits);
    let all = [high[0], high[1], low[0], low[1]];
    out.extend_from_slice(&all[4 - count..]);
}

/// The number that up to four digits represent; `None` if one is no digit.
pub(crate) fn parse(digits: &[u8]) -> Option<u16> {
    digits.iter().try_fold(0, |value: u16, digit| {
        let digit = match digit {
            b'0'..=b'9' => digit - b'0',
            b'A'..=b'F' => digit - b'A' + 10,
            _ => return None,
        };
        Some(value << 4 | u16::from(digit))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_appended_parses_back() {
        for (value, count, shown) in [(0x1FFF, 4, "1FFF"), (7, 3, "007"), (0x0A, 2, "0A")] {
            let mut out = Vec::new();
            append(value, count, &mut out);
            assert_eq!(out, shown.as_bytes());
            assert_eq!(parse(&out), Some(value));
        }
        assert_eq!([parse(b"0g"), parse(b"0a"), parse(b" 1")], [None; 3]);
    }
}
