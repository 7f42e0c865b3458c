//! Values, as the decimal text that they arrive in.

use std::fmt;

/// The longest number, in characters.
pub const LONGEST_NUMBER: usize = 23;

/// A decimal number such as `-4.5`, without superfluous zeros: equal numbers have equal text.
///
/// The dispatcher compares values and forwards them; it never computes. So a value stays text, and is neither rounded
/// nor converted.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Number {
    /// The text, zeros behind it, and in the last byte its length.
    bytes: [u8; LONGEST_NUMBER + 1],
}

/// By length: masks of the bytes that count, three words each.
static MASKS: [[u64; 3]; LONGEST_NUMBER + 1] = {
    let mut masks = [[0; 3]; LONGEST_NUMBER + 1];
    let mut length = 0;
    while length <= LONGEST_NUMBER {
        let mut at = 0;
        while at < length {
            masks[length][at / 8] |= 0xFF << (8 * (at % 8));
            at += 1;
        }
        length += 1;
    }
    masks
};

impl Number {
    /// No number: no value was sent yet.
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

    /// The sign for an input that has lost its source: `?`.
    pub const LOST: Self = {
        let mut bytes = [0; LONGEST_NUMBER + 1];
        bytes[0] = b'?';
        bytes[LONGEST_NUMBER] = 1;
        Self { bytes }
    };

    /// Reads digits with an optional sign, point and exponent, such as `-4.5`, `+3`, `.5` and `1e3`; `None` for
    /// everything else, and for more than 23 significant characters. With an exponent the number is rounded to a
    /// double.
    pub fn parse(text: &[u8]) -> Option<Self> {
        let (is_negative, digits) = match text {
            [b'-', rest @ ..] => (true, rest),
            [b'+', rest @ ..] => (false, rest),
            _ => (false, text),
        };
        if let [b'0'..=b'9' | b'.', rest @ ..] = digits
            && rest.iter().any(|byte| matches!(byte, b'e' | b'E'))
            && rest.iter().all(|byte| b"0123456789.eE+-".contains(byte))
        {
            let value: f64 = std::str::from_utf8(text).ok()?.parse().ok()?;
            return Self::of(value);
        }
        let point = digits.iter().position(|byte| *byte == b'.');
        let (whole, fraction) = match point {
            Some(at) => (&digits[..at], Some(&digits[at + 1..])),
            None => (digits, None),
        };
        let fraction = fraction.unwrap_or_default();
        let is_number = |part: &[u8]| part.iter().all(u8::is_ascii_digit);
        if !is_number(whole) || !is_number(fraction) || whole.len() + fraction.len() == 0 {
            return None;
        }
        let leading = whole.iter().take_while(|byte| **byte == b'0').count();
        let whole = match &whole[leading..] {
            [] => b"0",
            significant => significant,
        };
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

    /// The number that a floating-point value shows, with fewer digits after the point if there are too many. `None`
    /// for infinities and NaN, and for more than 23 characters before the point.
    ///
    /// Takes `f32` and `f64`, which are displayed differently.
    pub fn of(value: impl fmt::Display) -> Option<Self> {
        /// As much of a text as may count.
        struct Text {
            bytes: [u8; LONGEST_NUMBER],
            length: usize,
            whole: usize,
            has_point: bool,
        }

        impl fmt::Write for Text {
            fn write_str(&mut self, text: &str) -> fmt::Result {
                for byte in text.bytes() {
                    self.has_point |= byte == b'.';
                    self.whole += usize::from(!self.has_point);
                    let place = self.bytes.get_mut(self.length);
                    *place.ok_or(fmt::Error)? = byte;
                    self.length += 1;
                }
                Ok(())
            }
        }

        let mut text = Text {
            bytes: [0; LONGEST_NUMBER],
            length: 0,
            whole: 0,
            has_point: false,
        };
        if fmt::write(&mut text, format_args!("{value}")).is_err() {
            // Rounding may make the whole part longer.
            let digits = LONGEST_NUMBER.checked_sub(text.whole + 2)?;
            text.length = 0;
            fmt::write(&mut text, format_args!("{value:.digits$}")).ok()?;
        }
        Self::parse(&text.bytes[..text.length])
    }

    /// The nearest floating-point value.
    pub fn to_f64(&self) -> f64 {
        self.as_str().parse().unwrap_or_default()
    }

    /// Reads the number at the beginning of `bytes` if it has no superfluous zeros, which is the usual case, and
    /// something follows it. Also returns its length.
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
        let number = if let Some(long) = bytes.first_chunk() {
            Self::of_first(long, length)
        } else {
            let mut long = [0; LONGEST_NUMBER + 1];
            long[..length].copy_from_slice(&bytes[..length]);
            Self::of_first(&long, length)
        };
        Some((number, length))
    }

    /// The first `length` of these bytes, at most 23. Masking three words takes fewer instructions than a copy of
    /// variable length.
    fn of_first(bytes: &[u8; LONGEST_NUMBER + 1], length: usize) -> Self {
        let (words, _) = bytes.as_chunks::<8>();
        let mut number = Self::UNKNOWN;
        let (places, _) = number.bytes.as_chunks_mut::<8>();
        for ((place, word), mask) in places.iter_mut().zip(words).zip(&MASKS[length]) {
            *place = (u64::from_le_bytes(*word) & mask).to_le_bytes();
        }
        #[expect(clippy::cast_possible_truncation, reason = "at most 23")]
        let last = length as u8;
        number.bytes[LONGEST_NUMBER] = last;
        number
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

    /// The text, followed by other bytes.
    pub(crate) const fn padded(&self) -> &[u8; LONGEST_NUMBER + 1] {
        &self.bytes
    }

    /// The value as text.
    pub fn as_str(&self) -> &str {
        // The text consists of digits, a sign and a point.
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
            ("+3", "3"),
            (".5", "0.5"),
            ("-.50", "-0.5"),
            ("5.", "5"),
            ("1e3", "1000"),
            ("-2.5E-1", "-0.25"),
            ("+.5e+1", "5"),
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
    fn floating_point_values_become_numbers_and_back() {
        for (number, expected) in [
            (Number::of(0.1_f32), Some("0.1")),
            (Number::of(0.1_f64), Some("0.1")),
            (Number::of(-0.0_f64), Some("0")),
            (Number::of(-12.5_f32), Some("-12.5")),
            (Number::of(16_777_216_f32), Some("16777216")),
            (Number::of(1e21_f64), Some("1000000000000000000000")),
            (Number::of(9.5e22_f64), Some("95000000000000000000000")),
            (Number::of(1e23_f64), None),
            (Number::of(1e-300_f64), Some("0")),
            (
                Number::of(-1.0 / 3.0 * 1e-5_f64),
                Some("-0.0000033333333333333"),
            ),
            (Number::of(f64::NAN), None),
            (Number::of(f64::INFINITY), None),
            (Number::of(f64::NEG_INFINITY), None),
            (Number::of(u32::MAX), Some("4294967295")),
            (Number::of(i32::MIN), Some("-2147483648")),
        ] {
            assert_eq!(number.as_ref().map(Number::as_str), expected);
        }
        assert_eq!(Number::parse(b"-20.5").map(|it| it.to_f64()), Some(-20.5));
    }

    #[test]
    fn what_is_no_number_is_none() {
        for text in [
            "",
            "-",
            ".",
            "-.",
            "+-1",
            "e3",
            "1e",
            "1e400",
            "1e3.5",
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
        fn what_fits_is_not_rounded(value in -1e6_f32..1e6) {
            let number = Number::of(value).expect("it fits");
            if number.len() < LONGEST_NUMBER - 1 {
                proptest::prop_assert_eq!(number.as_str().parse::<f32>(), Ok(value));
            }
        }

        #[test]
        fn the_quick_way_reads_what_the_thorough_one_reads(text in "-?[0-9]{1,13}([.][0-9]{1,12})?", rest in "[ \r\na-]{1}[ -~]{0,30}") {
            let all = format!("{text}{rest}");
            let thorough = Number::parse(text.as_bytes());
            if let Some((number, length)) = Number::quick(all.as_bytes()) {
                proptest::prop_assert_eq!(length, text.len());
                proptest::prop_assert_eq!(Some(number), thorough);
            } else if let Some(number) = thorough {
                // Only numbers that need a clean-up are left to the slow way.
                proptest::prop_assert_ne!(number.as_str(), text);
            }
        }
    }
}
