//! Values in an array of 16-bit registers, as expressions and statements of Structured Text.
//!
//! Register n holds bytes 2n (high byte) and 2n + 1 of a record. Only bit strings, shifts and type
//! conversions of IEC 61131-3 are used, so that both CODESYS and `iec2c` accept the code.

use crate::record::PlacedSignal;
use tickbus_image::signal::{DataType, Width};

/// How a program writes register n.
pub(super) type Register<'r> = &'r dyn Fn(usize) -> String;

/// The function from DWORD to REAL that comes with the sources, and its inverse.
pub(super) const REAL_OF: &str = "tickbus_real";
pub(super) const BITS_OF: &str = "tickbus_bits";

/// The type of a signal's variable. A 64-bit float cannot be made from bits without pointers: the variable holds the
/// bits.
pub(super) fn kind(place: &PlacedSignal<'_>) -> DataType {
    match place.data_type() {
        DataType::Lreal => DataType::Lword,
        other => other,
    }
}

/// An expression for the value of a signal.
pub(super) fn value(place: &PlacedSignal<'_>, register: Register<'_>) -> String {
    let data_type = kind(place);
    let size = place.size();
    let at =
        |significance: usize| place.byte + place.signal.order.byte_position(size, significance);
    let word = |number: usize| word(register, at(2 * number + 1), at(2 * number));
    match data_type.width() {
        Width::Bit => {
            let mask = mask(place);
            format!("({} AND {mask}) <> WORD#16#0000", register(place.byte / 2))
        }
        Width::Byte => {
            let byte = byte(register, place.byte);
            match data_type {
                DataType::Byte => format!("WORD_TO_BYTE({byte})"),
                DataType::Sint => format!("USINT_TO_SINT(WORD_TO_USINT({byte}))"),
                _ => format!("WORD_TO_USINT({byte})"),
            }
        }
        Width::Word => converted("WORD", data_type, &word(0)),
        Width::Double => {
            let bits = format!(
                "SHL(WORD_TO_DWORD({}), 16) OR WORD_TO_DWORD({})",
                word(1),
                word(0)
            );
            if data_type == DataType::Real {
                format!("{REAL_OF}({bits})")
            } else {
                converted("DWORD", data_type, &bits)
            }
        }
        Width::Long => {
            let pieces: Vec<String> = (0..4)
                .rev()
                .map(|number| match number {
                    0 => format!("WORD_TO_LWORD({})", word(0)),
                    _ => format!("SHL(WORD_TO_LWORD({}), {})", word(number), 16 * number),
                })
                .collect();
            converted("LWORD", data_type, &pieces.join(" OR "))
        }
    }
}

/// The statements that put a signal's value into registers, which must be zero before.
pub(super) fn put(place: &PlacedSignal<'_>, name: &str, register: Register<'_>) -> Vec<String> {
    let data_type = kind(place);
    let size = place.size();
    let at =
        |significance: usize| place.byte + place.signal.order.byte_position(size, significance);
    let or = |byte: usize, what: &str| {
        let target = register(byte / 2);
        format!("{target} := {target} OR {what};")
    };
    let (bits, temporary) = match data_type.width() {
        Width::Bit => {
            let target = register(place.byte / 2);
            return vec![format!(
                "IF {name} THEN {target} := {target} OR {}; END_IF;",
                mask(place)
            )];
        }
        Width::Byte => {
            let bits = match data_type {
                DataType::Byte => format!("BYTE_TO_WORD({name})"),
                DataType::Sint => format!("USINT_TO_WORD(SINT_TO_USINT({name}))"),
                _ => format!("USINT_TO_WORD({name})"),
            };
            let bits = if place.byte.is_multiple_of(2) {
                format!("SHL({bits}, 8)")
            } else {
                bits
            };
            return vec![or(place.byte, &bits)];
        }
        Width::Word => (back("WORD", data_type, name), None),
        Width::Double => (
            back("DWORD", data_type, name),
            Some(("DWORD", "bits_32", 8)),
        ),
        Width::Long => (
            back("LWORD", data_type, name),
            Some(("LWORD", "bits_64", 16)),
        ),
    };
    let mut lines = Vec::new();
    let source = match temporary {
        Some((_, variable, _)) => {
            lines.push(format!("{variable} := {bits};"));
            variable.to_owned()
        }
        None => bits,
    };
    // `wide` bits from bit `shift` on, as a WORD.
    let piece = |shift: usize, wide: usize| {
        let shifted = if shift == 0 {
            source.clone()
        } else {
            format!("SHR({source}, {shift})")
        };
        let mask = "F".repeat(wide / 4);
        match temporary {
            None if wide == 16 => shifted,
            None => format!("({shifted} AND WORD#16#{mask:0>4})"),
            Some((kind, _, digits)) => {
                format!("{kind}_TO_WORD({shifted} AND {kind}#16#{mask:0>digits$})")
            }
        }
    };
    for number in (0..size / 2).rev() {
        let (high, low) = (at(2 * number + 1), at(2 * number));
        if high / 2 == low / 2 {
            let whole = piece(16 * number, 16);
            let whole = if high < low {
                whole
            } else {
                format!("ROL({whole}, 8)")
            };
            lines.push(format!("{} := {whole};", register(high / 2)));
            continue;
        }
        for (byte, shift) in [(high, 16 * number + 8), (low, 16 * number)] {
            let bits = piece(shift, 8);
            let bits = if byte.is_multiple_of(2) {
                format!("SHL({bits}, 8)")
            } else {
                bits
            };
            lines.push(or(byte, &bits));
        }
    }
    lines
}

/// The bit of a BOOL in its register.
fn mask(place: &PlacedSignal<'_>) -> String {
    let bit = usize::from(place.bit()) + if place.byte.is_multiple_of(2) { 8 } else { 0 };
    format!("WORD#16#{:04X}", 1_u32 << bit)
}

/// A byte of the record, as a WORD.
fn byte(register: Register<'_>, byte: usize) -> String {
    let register = register(byte / 2);
    if byte.is_multiple_of(2) {
        format!("SHR({register}, 8)")
    } else {
        format!("({register} AND WORD#16#00FF)")
    }
}

/// Two bytes of the record, as a WORD.
fn word(register: Register<'_>, high: usize, low: usize) -> String {
    if high / 2 == low / 2 {
        let register = register(high / 2);
        if high < low {
            register
        } else {
            format!("ROL({register}, 8)")
        }
    } else {
        format!(
            "(SHL({}, 8) OR {})",
            byte(register, high),
            byte(register, low)
        )
    }
}

/// Converts a bit string to another type of its width.
fn converted(bits: &str, data_type: DataType, expression: &str) -> String {
    if data_type.name() == bits {
        expression.to_owned()
    } else {
        format!("{bits}_TO_{data_type}({expression})")
    }
}

/// Converts a value to the bit string of its width.
fn back(bits: &str, data_type: DataType, name: &str) -> String {
    if data_type.name() == bits {
        name.to_owned()
    } else if data_type == DataType::Real {
        format!("{BITS_OF}({name})")
    } else {
        format!("{data_type}_TO_{bits}({name})")
    }
}
