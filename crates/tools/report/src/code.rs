//! The changes of a signal, encoded as text that a script unpacks quickly.
//!
//! A block is, in this order:
//!
//! - the times: a varint (7 bits per byte, low bits first, the top bit set on all bytes but the last) for
//!   each change: the time since the previous change, the first since the start of the run, in units of the
//!   page;
//! - the values, in the most compact of four codings: [`Coding`].
//!
//! The block is compressed by zlib and encoded as base64. Values are preserved bit by bit.

use std::collections::HashSet;

use super::Change;
use tickbus_base::time::Nanos;

/// How the values of a block are encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coding {
    /// One byte: the first value, 0 or 1. Each further change toggles it.
    Toggle,
    /// A varint with the number of distinct values; these values, ascending, as f64; then for each change the
    /// index of its value, as the zigzag varint of the difference from the previous index, starting from 0.
    Table,
    /// Each change as f32, combined with the previous one by exclusive or; all low bytes first, the high bytes last.
    Single,
    /// As `Single`, with f64.
    Double,
}

impl Coding {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Toggle => "toggle",
            Self::Table => "table",
            Self::Single => "single",
            Self::Double => "double",
        }
    }

    fn of(changes: &[Change]) -> Self {
        if toggles(changes) {
            return Self::Toggle;
        }
        let is_single = changes.iter().all(|c| narrow(c.value).is_some());
        let plain = if is_single { 4 } else { 8 };
        // An index takes a byte or two, so the table pays off as long as there are few distinct values.
        let most = changes.len() * (plain - 2) / 8 + 4;
        let mut different = HashSet::new();
        for change in changes {
            different.insert(change.value.to_bits());
            if different.len() > most {
                return if is_single {
                    Self::Single
                } else {
                    Self::Double
                };
            }
        }
        Self::Table
    }
}

fn toggles(changes: &[Change]) -> bool {
    let Some(first) = changes.first() else {
        return true;
    };
    let mut expected = first.value.to_bits();
    let (low, high) = (0_f64.to_bits(), 1_f64.to_bits());
    (expected == low || expected == high)
        && changes.iter().all(|change| {
            let is_expected = change.value.to_bits() == expected;
            expected = low + high - expected;
            is_expected
        })
}

/// The value as f32, if that represents it exactly.
#[expect(clippy::cast_possible_truncation, reason = "compared with what it was")]
fn narrow(value: f64) -> Option<f32> {
    let narrow = value as f32;
    (f64::from(narrow).to_bits() == value.to_bits()).then_some(narrow)
}

/// The largest unit of which the start of the run and the times of all changes are whole multiples apart.
pub(super) fn common_unit(begin: Nanos, times: impl Iterator<Item = Nanos>) -> i64 {
    let mut unit = 0;
    for time in times {
        if unit == 1 {
            break;
        }
        unit = divisor(unit, (time - begin).0);
    }
    unit.max(1)
}

const fn divisor(mut a: i64, mut b: i64) -> i64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// The block of the changes, and the coding of its values.
pub(super) fn block(changes: &[Change], begin: Nanos, unit: i64) -> (Coding, String) {
    let mut bytes = Vec::with_capacity(changes.len() * 2);
    let mut last = begin;
    for change in changes {
        let units = (change.at - last).0 / unit;
        varint(u64::try_from(units).unwrap_or(0), &mut bytes);
        last = change.at;
    }
    let coding = Coding::of(changes);
    match coding {
        Coding::Toggle => {
            let is_on = changes.first().is_some_and(|change| change.value > 0.5);
            bytes.push(u8::from(is_on));
        }
        Coding::Table => table(changes, &mut bytes),
        Coding::Single => {
            let bits = changes
                .iter()
                .map(|c| narrow(c.value).unwrap_or(0.0).to_bits());
            planes(&bits.map(u64::from), 4, &mut bytes);
        }
        Coding::Double => planes(&changes.iter().map(|c| c.value.to_bits()), 8, &mut bytes),
    }
    let packed = miniz_oxide::deflate::compress_to_vec_zlib(&bytes, 6);
    (coding, base64(&packed))
}

fn table(changes: &[Change], bytes: &mut Vec<u8>) {
    let mut values: Vec<f64> = changes.iter().map(|change| change.value).collect();
    values.sort_unstable_by(f64::total_cmp);
    values.dedup_by_key(|value| value.to_bits());
    varint(values.len() as u64, bytes);
    for value in &values {
        bytes.extend_from_slice(&value.to_le_bytes());
    }
    let mut last = 0_i64;
    for change in changes {
        let place = values.binary_search_by(|value| value.total_cmp(&change.value));
        let place = i64::try_from(place.expect("each value is in the table"))
            .expect("a table is no longer");
        let step = place - last;
        varint(((step << 1) ^ (step >> 63)).cast_unsigned(), bytes);
        last = place;
    }
}

fn planes(values: &(impl Iterator<Item = u64> + Clone), width: usize, bytes: &mut Vec<u8>) {
    for plane in 0..width {
        let mut last = 0;
        bytes.extend(values.clone().map(|value| {
            let byte = (value ^ last).to_le_bytes()[plane];
            last = value;
            byte
        }));
    }
}

fn varint(mut number: u64, bytes: &mut Vec<u8>) {
    while number >= 0x80 {
        bytes.push((number & 0x7f) as u8 | 0x80);
        number >>= 7;
    }
    bytes.push((number & 0x7f) as u8);
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let byte = |at: usize| u32::from(group.get(at).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            let is_there = digit <= group.len();
            let value = (bits >> (18 - 6 * digit) & 63) as usize;
            text.push(if is_there {
                char::from(DIGITS[value])
            } else {
                '='
            });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changes(values: &[f64]) -> Vec<Change> {
        let at = |place: usize| Nanos(i64::try_from(place).expect("few") * 10 + 5);
        values
            .iter()
            .enumerate()
            .map(|(place, &value)| Change {
                at: at(place),
                value,
            })
            .collect()
    }

    #[test]
    fn bytes_become_base64() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(base64(&[0xfb, 0xff]), "+/8=");
    }

    #[test]
    fn the_smallest_coding_is_taken() {
        let many: Vec<f64> = (0..1000).map(|n| f64::from(n) * 0.5).collect();
        let fine: Vec<f64> = (0..1000).map(|n| f64::from(n) * 0.1).collect();
        let few: Vec<f64> = (0..1000).map(|n| f64::from(n % 7) * 0.1).collect();
        for (values, coding) in [
            (&[][..], Coding::Toggle),
            (&[1.0, 0.0, 1.0], Coding::Toggle),
            (&[1.0, 1.0], Coding::Table),
            (&[0.0, f64::NAN, 0.0], Coding::Table),
            (&[-0.0, 1.0], Coding::Table),
            (&many, Coding::Single),
            (&fine, Coding::Double),
            (&few, Coding::Table),
        ] {
            assert_eq!(
                Coding::of(&changes(values)),
                coding,
                "{:?}",
                values.get(..3)
            );
        }
    }

    #[test]
    fn a_block_is_written_as_the_docs_say() {
        let bytes = |values: &[f64]| {
            let mut bytes = Vec::new();
            table(&changes(values), &mut bytes);
            bytes
        };
        let mut expected = vec![2];
        expected.extend_from_slice(&(-1.5_f64).to_le_bytes());
        expected.extend_from_slice(&2.0_f64.to_le_bytes());
        // 2.0 has index 1: a step of +1, then -1, +1.
        expected.extend_from_slice(&[2, 1, 2]);
        assert_eq!(bytes(&[2.0, -1.5, 2.0]), expected);
        let mut bytes = Vec::new();
        planes(&[0x0102, 0x0103].into_iter(), 4, &mut bytes);
        assert_eq!(bytes, [0x02, 0x01, 0x01, 0x00, 0, 0, 0, 0]);
        let mut bytes = Vec::new();
        varint(300, &mut bytes);
        assert_eq!(bytes, [0xac, 0x02]);
    }

    #[test]
    fn the_unit_divides_all_times() {
        let unit =
            |begin, times: &[i64]| common_unit(Nanos(begin), times.iter().map(|&t| Nanos(t)));
        assert_eq!(unit(0, &[]), 1);
        assert_eq!(unit(7, &[7]), 1);
        assert_eq!(unit(5, &[15, 45, 105]), 10);
        assert_eq!(unit(0, &[1_000_000, 2_500_000]), 500_000);
        assert_eq!(unit(-3, &[4]), 7);
    }
}
