//! Values of signals, as text and from text.

use serde::{Serialize, Serializer};
use tickbus_base::toml_text::shown;
use tickbus_image::signal::section::{value_limits, value_range};
use tickbus_image::signal::{DataType, Signal, Slot};

/// Beyond this, neither a double nor a script can distinguish all whole numbers.
const WHOLE: f64 = 9e15;

/// A value as JSON: a number; a string of digits for 64 bits; `null` for NaN and infinities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Number {
    Real(f64),
    /// The value of a REAL, with as many digits as that type has.
    Single(f32),
    Signed(i64),
    Unsigned(u64),
}

impl Number {
    pub(crate) fn of(signal: &Signal, slot: Slot) -> Self {
        if signal.is_integer_slot() {
            return if signal.data_type == DataType::Lint {
                Self::Signed(slot.signed())
            } else {
                Self::Unsigned(slot.unsigned())
            };
        }
        #[expect(clippy::cast_possible_truncation, reason = "compared with what it was")]
        let single = slot.real() as f32;
        let is_single = f64::from(single).to_bits() == slot.real().to_bits();
        if is_single && signal.data_type == DataType::Real {
            Self::Single(single)
        } else {
            Self::Real(slot.real())
        }
    }

    /// The value as a double, which may lose digits of 64-bit values.
    #[expect(clippy::cast_precision_loss, reason = "said so")]
    pub(crate) fn real(self) -> f64 {
        match self {
            Self::Real(number) => number,
            Self::Single(number) => number.into(),
            Self::Signed(number) => number as f64,
            Self::Unsigned(number) => number as f64,
        }
    }
}

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            Self::Real(number) if number.fract() == 0.0 && number.abs() < WHOLE => {
                #[expect(clippy::cast_possible_truncation, reason = "it is whole, and fits")]
                let whole = number as i64;
                serializer.serialize_i64(whole)
            }
            Self::Real(number) => serializer.serialize_f64(number),
            Self::Single(number) => serializer.serialize_f32(number),
            Self::Signed(number) => serializer.collect_str(&number),
            Self::Unsigned(number) => serializer.collect_str(&number),
        }
    }
}

/// The bits of a value, as IEC 61131-3 writes them: `TRUE`, `16#6C00`.
pub(crate) fn raw(data_type: DataType, bits: u64) -> String {
    if data_type == DataType::Bool {
        return if bits == 0 { "FALSE" } else { "TRUE" }.to_owned();
    }
    let digits = 2 * data_type.size_bytes();
    format!("16#{bits:0digits$X}")
}

/// True if the bits of a value are those of its number, so that a page can make the raw value itself.
pub(crate) fn raw_follows(signal: &Signal, slot: Slot, bits: u64) -> bool {
    if signal.scale.is_some() || signal.is_integer_slot() {
        return false;
    }
    let value = slot.real();
    // As JSON it may lose its sign.
    if value == 0.0 && value.is_sign_negative() {
        return false;
    }
    #[expect(clippy::cast_possible_truncation, reason = "compared with what it was")]
    match signal.data_type {
        DataType::Bool => f64::from(u8::from(bits != 0)).to_bits() == value.to_bits(),
        DataType::Real => {
            !value.is_nan()
                && f64::from(value as f32).to_bits() == value.to_bits()
                && u64::from((value as f32).to_bits()) == bits
        }
        DataType::Lreal => !value.is_nan() && value.to_bits() == bits,
        // Of at most 32 bits.
        data_type => {
            let mask = u64::MAX >> (64 - data_type.width().bits());
            value.fract() == 0.0
                && value.abs() < WHOLE
                && (value as i64).cast_unsigned() & mask == bits
                && data_type
                    .range()
                    .is_some_and(|range| range.contains(&i128::from(value as i64)))
        }
    }
}

/// Parses the value of a signal: in its unit, or a literal such as `16#6C00` for an integer without a scale.
///
/// # Errors
///
/// The text does not fit; the message says what would.
pub fn parse(text: &str, signal: &Signal) -> Result<Slot, String> {
    let refused = |right: &str| {
        let (name, text) = (shown(&signal.name), shown(text));
        Err(if text.is_empty() {
            format!("there is no value for \"{name}\"; {right}")
        } else {
            format!("{text} does not fit \"{name}\"; {right}")
        })
    };
    if signal.data_type == DataType::Bool {
        return match text.to_ascii_uppercase().as_str() {
            "TRUE" | "1" => Ok(Slot::from_real(1.0)),
            "FALSE" | "0" => Ok(Slot::from_real(0.0)),
            _ => refused("a BOOL takes TRUE or FALSE"),
        };
    }
    let range = match signal.data_type {
        DataType::Real | DataType::Lreal if signal.scale.is_none() => {
            "it takes a number".to_owned()
        }
        _ => value_range(signal),
    };
    if signal.scale.is_none()
        && let Some(limits) = signal.data_type.range()
    {
        return match whole(text).filter(|number| limits.contains(number)) {
            Some(number) if signal.is_integer_slot() => {
                // Two's complement: the low 64 bits of both kinds.
                let bytes = number.to_le_bytes();
                let low = bytes.first_chunk().copied().unwrap_or_default();
                Ok(Slot::from_unsigned(u64::from_le_bytes(low)))
            }
            #[expect(clippy::cast_precision_loss, reason = "at most 32 bits")]
            Some(number) => Ok(Slot::from_real(number as f64)),
            None => refused(&range),
        };
    }
    let (low, high) = value_limits(signal);
    let number = text.parse::<f64>().ok();
    match number.filter(|number| (low..=high).contains(number) && number.is_finite()) {
        Some(number) => Ok(Slot::from_real(number)),
        None => refused(&range),
    }
}

/// A whole number, decimal or as a literal with its base.
fn whole(text: &str) -> Option<i128> {
    let based = |prefix, base| {
        let digits = text.strip_prefix(prefix)?;
        let digits = Some(digits).filter(|digits| !digits.starts_with(['+', '-']))?;
        i128::from_str_radix(digits, base).ok()
    };
    let literal = based("16#", 16).or_else(|| based("8#", 8));
    literal
        .or_else(|| based("2#", 2))
        .or_else(|| text.parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_image::signal::{Area, Scale};

    fn signal(data_type: DataType) -> Signal {
        Signal::new("s", Area::Input, 0, data_type)
    }

    fn json(signal: &Signal, slot: Slot) -> String {
        serde_json::to_string(&Number::of(signal, slot)).expect("a number")
    }

    #[test]
    fn a_value_is_written_with_the_digits_that_it_has() {
        let real = |data_type, number| json(&signal(data_type), Slot::from_real(number));
        assert_eq!(real(DataType::Bool, 1.0), "1");
        assert_eq!(real(DataType::Int, -5.0), "-5");
        assert_eq!(real(DataType::Int, 5.25), "5.25");
        assert_eq!(real(DataType::Real, f64::from(0.1_f32)), "0.1");
        assert_eq!(real(DataType::Lreal, 0.1), "0.1");
        assert_eq!(real(DataType::Lreal, 1e300), "1e+300");
        assert_eq!(real(DataType::Real, f64::NAN), "null");
        assert_eq!(real(DataType::Lreal, f64::NEG_INFINITY), "null");
        let lint = json(&signal(DataType::Lint), Slot::from_signed(i64::MIN));
        assert_eq!(lint, "\"-9223372036854775808\"");
        let ulint = json(&signal(DataType::Ulint), Slot::from_unsigned(u64::MAX));
        assert_eq!(ulint, "\"18446744073709551615\"");
    }

    #[test]
    fn bits_are_written_as_literals_of_their_size() {
        assert_eq!(raw(DataType::Bool, 1), "TRUE");
        assert_eq!(raw(DataType::Byte, 5), "16#05");
        assert_eq!(raw(DataType::Int, 0x6C00), "16#6C00");
        assert_eq!(raw(DataType::Lreal, 1), "16#0000000000000001");
    }

    #[test]
    fn a_value_that_fits_is_read() {
        let real = |data_type, text| parse(text, &signal(data_type)).map(Slot::real);
        assert_eq!(real(DataType::Bool, "true"), Ok(1.0));
        assert_eq!(real(DataType::Bool, "0"), Ok(0.0));
        assert_eq!(real(DataType::Int, "-32768"), Ok(-32768.0));
        assert_eq!(real(DataType::Word, "16#6C00"), Ok(27_648.0));
        assert_eq!(real(DataType::Byte, "2#101"), Ok(5.0));
        assert_eq!(real(DataType::Real, "-1.5e3"), Ok(-1500.0));
        let lint = parse("-9223372036854775808", &signal(DataType::Lint));
        assert_eq!(lint.map(Slot::signed), Ok(i64::MIN));
        let ulint = parse("18446744073709551615", &signal(DataType::Ulint));
        assert_eq!(ulint.map(Slot::unsigned), Ok(u64::MAX));
        let scaled = Signal {
            scale: Scale::through([0.0, 27_648.0], [0.0, 250.0]),
            ..signal(DataType::Int)
        };
        assert_eq!(parse("12.5", &scaled).map(Slot::real), Ok(12.5));
        assert_eq!(
            parse("300", &scaled),
            Err(
                "300 does not fit \"s\"; INT with this scale goes from -296.2963 to 296.2873"
                    .to_owned()
            )
        );
    }

    #[test]
    fn a_value_that_does_not_fit_is_told_with_what_would() {
        for (data_type, texts) in [
            (DataType::Bool, &["2", "on", "", "-1", "1.0"][..]),
            (
                DataType::Int,
                &["32768", "1.5", "16#10000", "16#-1", "x", "1e3", "NaN"],
            ),
            (DataType::Usint, &["-1", "256"]),
            (DataType::Ulint, &["18446744073709551616", "-1"]),
            (DataType::Real, &["inf", "nan", "1e39", "TRUE", "1,5"]),
        ] {
            for text in texts {
                let refused = parse(text, &signal(data_type)).expect_err(text);
                assert!(refused.contains("\"s\"; "), "{refused}");
            }
        }
    }
}
