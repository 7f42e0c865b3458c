//! Values, as the decimal text that they arrive in.

use std::fmt;

/// The longest number, in characters.
pub const LONGEST_NUMBER: usize = 23;

/// A decimal number such as `-4.5`, without superfluous zeros: equal numbers have equal text.
///
/// The dispatcher compares values and passes them on; it never computes. So a value stays the text that it is, and is
/// neither rounded nor converted.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Number {
    /// The text, zeros behind it, and in the last byte its length.
    bytes: [u8; LONGEST_NUMBER + 1],
}

impl Number {
    /// No number: nothing was said yet.
    pub(crate) const UNKNOWN: Self = Self {
        bytes: [0; LONGEST_NUMBER + 1],
    };

    /// Zero: no voltage.
    pub const ZERO: Self = {
        let mut bytes = [0; LONGEST_NUMBER + 1];
        bytes[0] = b'0';
        bytes[LONGEST_NUMBER] = 1;
        Self { bytes }
    };

    /// Reads `["-"] 1*DIGIT ["." 1*DIGIT]`; `None` for everything else, and for more than 23 characters that count.
    pub fn parse(text: &[u8]) -> Option<Self> {
        let (is_negative, digits) = match text {
            [b'-', rest @ ..] => (true, rest),
            _ => (false, text),
        };
        let point = digits.iter().position(|byte| *byte == b'.');
        let (whole, fraction) = match point {
            Some(at) => (&digits[..at], Some(&digits[at + 1..])),
            None => (digits, None),
        };
        let is_number = |part: &[u8]| !part.is_empty() && part.iter().all(u8::is_ascii_digit);
        if !is_number(whole) || fraction.is_some_and(|part| !is_number(part)) {
            return None;
        }
        let leading = whole.iter().take_while(|byte| **byte == b'0').count();
        let whole = &whole[leading.min(whole.len() - 1)..];
        let fraction = fraction.unwrap_or_default();
        let trailing = fraction.iter().rev().take_while(|byte| **byte == b'0');
        let fraction = &fraction[..fraction.len() - trailing.count()];
        let mut number = Self::UNKNOWN;
        if is_negative && !(whole == b"0" && fraction.is_empty()) {
            number.push(b"-")?;
        }
        number.push(whole)?;
        if !fraction.is_empty() {
            number.push(b".")?;
            number.push(fraction)?;
        }
        Some(number)
    }

    /// Reads the number at the beginning of `bytes` if it has no superfluous zeros, which is the usual case, and something
    /// stands behind it. Also returns its length.
    #[inline]
    pub(crate) fn quick(bytes: &[u8]) -> Option<(Self, usize)> {
        let start = usize::from(*bytes.first()? == b'-');
        let mut length = start;
        while bytes.get(length)?.is_ascii_digit() {
            length += 1;
        }
        let whole = length - start;
        let has_leading_zero = whole > 1 && bytes[start] == b'0';
        if whole == 0 || has_leading_zero {
            return None;
        }
        if bytes[length] == b'.' {
            let point = length;
            length += 1;
            while bytes.get(length)?.is_ascii_digit() {
                length += 1;
            }
            if length == point + 1 || bytes[length - 1] == b'0' {
                return None;
            }
        } else if start == 1 && bytes[start] == b'0' {
            return None;
        }
        if length > LONGEST_NUMBER {
            return None;
        }
        let mut number = Self::UNKNOWN;
        if let Some(long) = bytes.first_chunk::<{ LONGEST_NUMBER + 1 }>() {
            // A copy of fixed length, of which a part is kept, takes fewer instructions than one of any length.
            for (at, byte) in number.bytes.iter_mut().enumerate() {
                *byte = if at < length { long[at] } else { 0 };
            }
        } else {
            number.bytes[..length].copy_from_slice(&bytes[..length]);
        }
        #[expect(clippy::cast_possible_truncation, reason = "at most 23")]
        let last = length as u8;
        number.bytes[LONGEST_NUMBER] = last;
        Some((number, length))
    }

    fn push(&mut self, text: &[u8]) -> Option<()> {
        let length = self.len();
        let all = length + text.len();
        self.bytes[..LONGEST_NUMBER]
            .get_mut(length..all)?
            .copy_from_slice(text);
        self.bytes[LONGEST_NUMBER] = u8::try_from(all).ok()?;
        Some(())
    }

    pub(crate) fn is_known(self) -> bool {
        self.len() > 0
    }

    pub(crate) fn len(self) -> usize {
        usize::from(self.bytes[LONGEST_NUMBER])
    }

    /// The text, with other bytes behind it.
    pub(crate) const fn padded(&self) -> &[u8; LONGEST_NUMBER + 1] {
        &self.bytes
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        // It consists of digits, a sign and a point.
        std::str::from_utf8(&self.bytes[..self.len()]).unwrap_or_default()
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl fmt::Debug for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_numbers_have_equal_text() {
        for (text, expected) in [
            ("20", "20"),
            ("0", "0"),
            ("000", "0"),
            ("-0", "0"),
            ("-0.00", "0"),
            ("007.50", "7.5"),
            ("-12.0", "-12"),
            ("0.5", "0.5"),
            ("-0.5", "-0.5"),
            (
                "00000000000000000000000000001.000000000000000000000000000",
                "1",
            ),
            ("12345678901234567890123", "12345678901234567890123"),
        ] {
            let number = Number::parse(text.as_bytes()).expect(text);
            assert_eq!(number.as_str(), expected);
        }
    }

    #[test]
    fn what_is_no_number_is_none() {
        for text in [
            "",
            "-",
            ".",
            "1.",
            ".5",
            "+1",
            "1e3",
            "--1",
            "1.2.3",
            "0x10",
            "1 2",
            "nan",
            "1-",
            "123456789012345678901234",
            "-12345678901234567890123",
        ] {
            assert_eq!(Number::parse(text.as_bytes()), None, "{text}");
        }
    }

    proptest::proptest! {
        #[test]
        fn the_quick_way_reads_what_the_thorough_one_reads(text in "-?[0-9]{1,13}([.][0-9]{1,12})?", rest in "[ \r\na-]{1}[ -~]{0,30}") {
            let all = format!("{text}{rest}");
            let thorough = Number::parse(text.as_bytes());
            if let Some((number, length)) = Number::quick(all.as_bytes()) {
                proptest::prop_assert_eq!(length, text.len());
                proptest::prop_assert_eq!(Some(number), thorough);
            } else if let Some(number) = thorough {
                // Only what needs a clean-up is left to the thorough way.
                proptest::prop_assert_ne!(number.as_str(), text);
            }
        }
    }
}
