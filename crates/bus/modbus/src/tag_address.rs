//! Places of single signals, as written in `[fieldbus.at]` and in the tag lists of other programs.

use std::fmt;
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::DataType;

use super::{ElementAddress, Table};

/// An element of a table, or a bit of a register.
///
/// In addition to the notations of an [`ElementAddress`], these are read: a bit of a register as in KEPServer
/// (`400021.5`; bit 0 is the lowest), the memory words and bits of IEC 61131-3 as in Schneider and CODESYS
/// (`%MW20` is the holding register at offset 20, `%MW20.5` its bit 5, `%M5` the coil at offset 5), each
/// optionally followed by a type as in PLC4X (`holding-register:21:REAL`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TagAddress {
    /// The element, or the first of several.
    pub place: ElementAddress,
    /// The bit of the register, from 0 for the lowest to 15.
    pub bit: Option<u8>,
    /// The type that the address states.
    pub data_type: Option<DataType>,
}

const SHAPE: &str = "write \"holding-register:21\", \"4x00021\" or \"400021\", which count from 1, or \
                     \"holding-register offset:20\" or \"%MW20\", which count from 0; a bit of a register is \
                     \"400021.5\"";

impl FromStr for TagAddress {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        let wrong = |what: String, right: &str| Mistake::new(what, right);
        if text.contains('{') {
            return Err(wrong(
                format!("\"{}\" has options in braces", shown(text)),
                "remove them; the unit is that of the signal's station, and the byte order is \"order\" in its \
                 [[signal]] section",
            ));
        }
        if text.contains('[') {
            return Err(wrong(
                format!("\"{}\" is an array", shown(text)),
                "write a signal for each element; they are read in one request all the same",
            ));
        }
        // The part after the last colon is a type if it starts with a letter, otherwise a number.
        let (rest, data_type) = match text.rsplit_once(':') {
            Some((rest, name)) if name.starts_with(|c: char| c.is_ascii_alphabetic()) => {
                let data_type = name.parse::<DataType>().map_err(|error| {
                    wrong(
                        format!("\"{}\" ends with \"{}\"", shown(text), shown(name)),
                        &format!("that is {error}"),
                    )
                })?;
                (rest, Some(data_type))
            }
            _ => (text, None),
        };
        let (rest, bit) = match rest.rsplit_once('.') {
            None => (rest, None),
            // "DB10.DBW0" is not a register with a bit.
            Some((_, digits)) if digits.starts_with(|c: char| c.is_ascii_alphabetic()) => {
                return Err(wrong(
                    format!("\"{}\" is no place in a table", shown(text)),
                    "an address of an S7 needs kind = \"s7-client\"; for a Modbus device write \"holding-register:21\", \
                     \"4x00021\" or \"400021\"",
                ));
            }
            Some((rest, digits)) => {
                let is_number = matches!(digits.len(), 1 | 2)
                    && digits.bytes().all(|digit| digit.is_ascii_digit());
                let bit = digits
                    .parse()
                    .ok()
                    .filter(|bit| is_number && *bit < 16)
                    .ok_or_else(|| {
                        wrong(
                            format!("\"{}\" names the bit \"{}\"", shown(text), shown(digits)),
                            "bits of a register go from 0, the lowest, to 15",
                        )
                    })?;
                (rest, Some(bit))
            }
        };
        let place = match rest.strip_prefix('%') {
            Some(marker) => read_marker(marker).unwrap_or_else(|| {
                Err(wrong(
                    format!("\"{}\" is no marker with a place in the tables", shown(text)),
                    "\"%MW20\" is the holding register with the offset 20, \"%MW20.5\" its bit 5, and \"%M5\" the \
                     coil with the offset 5; a %MD or %ML is written as the first %MW that it lies in",
                ))
            }),
            None => rest.parse().map_err(|error: Mistake| {
                if error.what.contains("no place") {
                    wrong(error.what, SHAPE)
                } else {
                    error
                }
            }),
        }?;
        if bit.is_some() && place.table.is_bits() {
            return Err(wrong(
                format!(
                    "\"{}\" names a bit of a {}",
                    shown(text),
                    place.table.element()
                ),
                "that is one bit itself; remove the dot and what follows it",
            ));
        }
        Ok(Self {
            place,
            bit,
            data_type,
        })
    }
}

/// The place of `%MW20` or `%M5`, without the percent sign; `None` for any other text.
fn read_marker(marker: &str) -> Option<Result<ElementAddress, Mistake>> {
    let rest = marker.strip_prefix('M')?;
    let (table, digits) = match rest.strip_prefix('W') {
        Some(digits) => (Table::HoldingRegisters, digits),
        None => (Table::Coils, rest),
    };
    let is_number = !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit());
    is_number.then(|| ElementAddress::parse(&format!("offset:{digits}"), table))
}

/// Writes the element in both notations, and the bit.
impl fmt::Display for TagAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.place.fmt(f)?;
        match self.bit {
            Some(bit) => write!(f, ", bit {bit}"),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spellings_of_plc4x_kepserver_and_iec_are_the_same_places() {
        let holding = |offset, bit, data_type| {
            let place = ElementAddress {
                table: Table::HoldingRegisters,
                offset,
            };
            Ok(TagAddress {
                place,
                bit,
                data_type,
            })
        };
        for text in [
            "holding-register:21",
            "holding-register offset:20",
            "4x00021",
            "400021",
            "40021",
            "%MW20",
        ] {
            assert_eq!(text.parse(), holding(20, None, None), "{text}");
            let typed = format!("{text}:REAL");
            assert_eq!(
                typed.parse(),
                holding(20, None, Some(DataType::Real)),
                "{typed}"
            );
            let bit = format!("{text}.5");
            assert_eq!(bit.parse(), holding(20, Some(5), None), "{bit}");
            let both = format!("{text}.15:bool");
            assert_eq!(
                both.parse(),
                holding(20, Some(15), Some(DataType::Bool)),
                "{both}"
            );
        }
        for (text, table, offset) in [
            ("coil:5", Table::Coils, 4),
            ("coil:5:BOOL", Table::Coils, 4),
            ("000001", Table::Coils, 0),
            ("%M5", Table::Coils, 5),
            ("discrete-input:3", Table::DiscreteInputs, 2),
            ("100001", Table::DiscreteInputs, 0),
            ("input-register:7", Table::InputRegisters, 6),
            ("300001:INT", Table::InputRegisters, 0),
        ] {
            let spot: TagAddress = text.parse().expect(text);
            assert_eq!(spot.place, ElementAddress { table, offset }, "{text}");
        }
        let spot: TagAddress = "400021.5".parse().expect("a bit");
        assert_eq!(
            spot.to_string(),
            "holding-register offset:20 (4x00021), bit 5"
        );
    }

    #[test]
    fn what_is_no_address_is_told_with_what_would_be_one() {
        for (text, part) in [
            ("", "no place"),
            ("21", "400021.5"),
            ("holding-register:21{unit-id: 10}", "options in braces"),
            ("holding-register:21:UINT[10]", "is an array"),
            ("holding-register:21:FLOAT", "not an elementary data type"),
            ("holding-register:0", "numbers go from 1 to 65536"),
            ("400021.16", "go from 0, the lowest, to 15"),
            ("400021.", "go from 0, the lowest, to 15"),
            ("400021.+5", "go from 0, the lowest, to 15"),
            ("coil:5.3", "one bit itself"),
            ("DB10.DBW0", "\"s7-client\""),
            ("%MW65536", "offsets go from 0 to 65535"),
            ("%MD20", "the first %MW"),
            ("%MWx", "%MW20.5"),
            ("%QW20", "no marker"),
            ("%é", "no marker"),
            ("offset:20", "names no table"),
        ] {
            let told = text.parse::<TagAddress>().expect_err(text).to_string();
            assert!(told.contains(part), "\"{part}\" in {told}");
        }
    }
}
