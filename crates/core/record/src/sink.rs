//! The common parts of the formats: the pieces of a file, and the form of numbers.

use std::io::Write as _;

use super::columns::Tick;

/// Converts ticks to the bytes of a file.
pub(super) trait Sink: Send {
    /// Writes the beginning of the file.
    fn header(&mut self, out: &mut Vec<u8>);

    /// One tick; the values come from [`ValueKind::kept`](super::ValueKind::kept).
    fn tick(&mut self, tick: &Tick, out: &mut Vec<u8>);

    /// Writes the end of a recording that was closed properly.
    fn end(&mut self, note: &str, out: &mut Vec<u8>);
}

/// Writes a number, in at most 30 characters, that reads back exactly.
pub(super) fn real(value: f64, out: &mut Vec<u8>) {
    let size = value.abs();
    let plain = !value.is_finite() || value == 0.0 || (1e-5..1e16).contains(&size);
    let _ = if plain {
        write!(out, "{value}")
    } else {
        write!(out, "{value:e}")
    };
}

/// An edge count as an integer.
pub(super) fn count(value: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "made from a u32; a cast saturates"
    )]
    let count = value as u32;
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back_and_are_short() {
        for value in [
            0.0,
            -0.0,
            0.1,
            1e-300,
            -1.797_693_134_862_315_7e308,
            f64::MIN_POSITIVE / 8.0,
            123_456_789_012_345.6,
            1e16,
            f64::INFINITY,
        ] {
            let mut text = Vec::new();
            real(value, &mut text);
            let text = String::from_utf8(text).expect("ASCII");
            assert_eq!(text.parse::<f64>().map(f64::to_bits), Ok(value.to_bits()));
            assert!(text.len() <= 30, "{text}");
        }
    }
}
