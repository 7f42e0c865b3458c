//! Integer nanoseconds.

use std::fmt;
use std::ops::{Add, AddAssign, Sub};
use std::str::FromStr;

use crate::Mistake;

/// A point in time or a span, in signed 64-bit nanoseconds (±292 years).
///
/// A point counts from the epoch of its [`Clock`](super::Clock). Arithmetic saturates: a deadline of "never" stays
/// "never".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Nanos(pub i64);

impl Nanos {
    /// An empty span, and the epoch of every clock.
    pub const ZERO: Self = Self(0);
    /// Later than anything.
    pub const MAX: Self = Self(i64::MAX);

    /// A span of whole microseconds.
    pub const fn from_micros(micros: i64) -> Self {
        Self(micros.saturating_mul(1_000))
    }

    /// A span of whole milliseconds.
    pub const fn from_millis(millis: i64) -> Self {
        Self(millis.saturating_mul(1_000_000))
    }

    /// A span of whole seconds.
    pub const fn from_secs(secs: i64) -> Self {
        Self(secs.saturating_mul(1_000_000_000))
    }

    /// The span multiplied by `count`.
    #[must_use]
    pub const fn times(self, count: i64) -> Self {
        Self(self.0.saturating_mul(count))
    }

    /// The span in microseconds.
    #[expect(
        clippy::cast_precision_loss,
        reason = "for people; exact up to 104 days"
    )]
    pub const fn as_micros(self) -> f64 {
        self.0 as f64 / 1e3
    }

    /// The span rounded to about three digits for messages: whole milliseconds from 10 ms on, whole
    /// microseconds from 10 us on.
    #[must_use]
    pub const fn rounded(self) -> Self {
        let unit = match self.0.unsigned_abs() {
            0..10_000 => 1,
            10_000..10_000_000 => 1_000,
            _ => 1_000_000,
        };
        Self(self.0 / unit * unit)
    }

    /// The span as a [`std::time::Duration`]; a negative span is zero.
    pub fn to_duration(self) -> std::time::Duration {
        std::time::Duration::from_nanos(u64::try_from(self.0).unwrap_or(0))
    }
}

impl Add for Nanos {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl AddAssign for Nanos {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Nanos {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

/// The units that durations are written in, largest first.
const UNITS: [(&str, i64); 6] = [
    ("h", 3_600_000_000_000),
    ("min", 60_000_000_000),
    ("s", 1_000_000_000),
    ("ms", 1_000_000),
    ("us", 1_000),
    ("ns", 1),
];

/// Writes the span with the largest unit that keeps it whole: `10ms`, `1500us`, `2s`.
impl fmt::Display for Nanos {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 == 0 {
            return f.write_str("0s");
        }
        let (unit, size) = UNITS
            .iter()
            .find(|(_, size)| self.0 % size == 0)
            .expect("every count is a multiple of one nanosecond");
        write!(f, "{}{unit}", self.0 / size)
    }
}

fn not_a_duration() -> Mistake {
    let right = "write a number and a unit, such as \"10ms\" (units: ns, us, ms, s, min, h)";
    Mistake::new("not a duration", right)
}

/// Reads `10ms`, `1.5 s`, `250us`: a non-negative decimal number and a unit.
impl FromStr for Nanos {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let text = text.trim();
        let digits = text
            .find(|c: char| !c.is_ascii_digit() && c != '.')
            .ok_or_else(not_a_duration)?;
        let (number, unit) = text.split_at(digits);
        let (_, size) = UNITS
            .iter()
            .find(|(name, _)| *name == unit.trim())
            .ok_or_else(not_a_duration)?;
        let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
        if whole.is_empty() || (number.contains('.') && fraction.is_empty()) {
            return Err(not_a_duration());
        }
        let whole: i64 = whole.parse().map_err(|_| not_a_duration())?;
        let mut total = whole.checked_mul(*size).ok_or_else(not_a_duration)?;
        let mut digit_size = *size;
        for digit in fraction.bytes() {
            if !digit.is_ascii_digit() {
                return Err(not_a_duration());
            }
            digit_size /= 10;
            total = total
                .checked_add(i64::from(digit - b'0') * digit_size)
                .ok_or_else(not_a_duration)?;
        }
        Ok(Self(total))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_read_and_print() {
        for (text, nanos) in [
            ("10ms", 10_000_000),
            ("1.5 s", 1_500_000_000),
            ("250us", 250_000),
            ("2min", 120_000_000_000),
            ("0s", 0),
            ("7ns", 7),
        ] {
            assert_eq!(text.parse(), Ok(Nanos(nanos)), "{text}");
        }
        assert_eq!(Nanos::from_millis(10).to_string(), "10ms");
        assert_eq!(Nanos(1_500_000).to_string(), "1500us");
        assert_eq!(Nanos::ZERO.to_string(), "0s");
    }

    #[test]
    fn what_is_no_duration_is_refused() {
        for text in [
            "",
            "10",
            "ms",
            "-1s",
            "1.s",
            ".5s",
            "1.2.3s",
            "10 parsecs",
            "9999999999h",
        ] {
            assert_eq!(text.parse::<Nanos>(), Err(not_a_duration()), "{text}");
        }
    }

    #[test]
    fn never_stays_never() {
        assert_eq!(Nanos::MAX + Nanos(1), Nanos::MAX);
    }
}
