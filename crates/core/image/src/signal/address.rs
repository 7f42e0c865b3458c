//! IEC 61131-3 addresses of the process image.

use std::fmt;
use std::str::FromStr;

use tickbus_base::Mistake;

/// The largest size of one area of one station, in bytes.
pub const AREA_LIMIT: usize = 65_536;

/// The two halves of a process image, named from the PLC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Area {
    /// `%I`: inputs of the PLC. The simulation writes them.
    Input,
    /// `%Q`: outputs of the PLC. The simulation reads them.
    Output,
}

/// Writes the area as addresses do: `%I` or `%Q`.
impl fmt::Display for Area {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Input => "%I",
            Self::Output => "%Q",
        })
    }
}

/// How many bits an address covers, by its size letter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Width {
    /// `X`: one bit.
    Bit,
    /// `B`: 8 bits.
    Byte,
    /// `W`: 16 bits.
    Word,
    /// `D`: 32 bits.
    Double,
    /// `L`: 64 bits.
    Long,
}

impl Width {
    /// The size letter: `X`, `B`, `W`, `D` or `L`.
    pub const fn letter(self) -> char {
        match self {
            Self::Bit => 'X',
            Self::Byte => 'B',
            Self::Word => 'W',
            Self::Double => 'D',
            Self::Long => 'L',
        }
    }

    /// How many bits the address covers.
    pub const fn bits(self) -> usize {
        match self {
            Self::Bit => 1,
            Self::Byte => 8,
            Self::Word => 16,
            Self::Double => 32,
            Self::Long => 64,
        }
    }

    /// The number of bytes that contain those bits: one for a bit.
    pub const fn bytes(self) -> usize {
        self.bits().div_ceil(8)
    }

    /// The size of a letter in an address; `None` if there is no size with this letter.
    pub fn of_letter(letter: char) -> Option<Self> {
        [Self::Bit, Self::Byte, Self::Word, Self::Double, Self::Long]
            .into_iter()
            .find(|width| width.letter() == letter)
    }
}

/// The unit of the number in an address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Addressing {
    /// Bytes, as Siemens does: `%IW2` is bytes 2 and 3.
    #[default]
    Bytes,
    /// Elements of the address's own size, as CODESYS does: `%IW1` is bytes 2 and 3. The first number of a
    /// bit address counts bytes even so.
    Elements,
}

/// An address in the process image of one station.
///
/// The text form counts bytes: `%QX1.0` is bit 0 of byte 1, `%IW4` bytes 4 and 5.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Address {
    /// `%I` or `%Q`.
    pub area: Area,
    /// The number of bits.
    pub width: Width,
    /// Offset of the first byte.
    pub byte: usize,
    /// Bit within that byte, 0 to 7; 0 unless the width is [`Width::Bit`].
    pub bit: u8,
}

impl Address {
    /// Reads an address such as `%QX1.0`, `%IW4`, `%id8` or `%I0.3`.
    ///
    /// # Errors
    ///
    /// When the text is not an address of a PLC's inputs or outputs, or is beyond [`AREA_LIMIT`].
    pub fn parse(text: &str, addressing: Addressing) -> Result<Self, Mistake> {
        let shown = shorten(text);
        let upper = text.trim().to_ascii_uppercase();
        let Some(rest) = upper.strip_prefix('%') else {
            let right = match Self::parse(&format!("%{upper}"), addressing) {
                Ok(_) => format!("write \"%{upper}\""),
                Err(_) => EXAMPLES.to_owned(),
            };
            return Err(Mistake::new(
                format!("the address \"{shown}\" does not start with %"),
                right,
            ));
        };
        let area = match rest.chars().next() {
            Some('I') => Area::Input,
            Some('Q') => Area::Output,
            other => return Err(foreign_area(&shown, rest, other)),
        };
        let rest = &rest[1..];
        let letter = rest.chars().next().filter(|c| !c.is_ascii_digit());
        let width = match letter {
            None => Width::Bit,
            Some(letter) => Width::of_letter(letter).ok_or_else(|| {
                Mistake::new(
                    format!("'{letter}' in the address \"{shown}\" is no size"),
                    "sizes are X (bit), B (8 bits), W (16), D (32), L (64)",
                )
            })?,
        };
        let numbers = &rest[letter.map_or(0, char::len_utf8)..];
        let (offset, bit) = match numbers.split_once('.') {
            Some((offset, bit)) => (offset, Some(bit)),
            None => (numbers, None),
        };
        let malformed = || Mistake::new(format!("\"{shown}\" is not an address"), EXAMPLES);
        let offset = number(offset).ok_or_else(malformed)?;
        let bit = bit
            .map(|bit| number(bit).ok_or_else(malformed))
            .transpose()?;
        let element = match addressing {
            Addressing::Bytes => 1,
            Addressing::Elements => width.bytes(),
        };
        let byte = offset
            .checked_mul(element)
            .filter(|byte| byte + width.bytes() <= AREA_LIMIT);
        let Some(byte) = byte else {
            return Err(Mistake::new(
                format!("the address \"{shown}\" lies beyond the {AREA_LIMIT} bytes of an area"),
                format!(
                    "the last {area}{} is {area}{}{}",
                    width.letter(),
                    width.letter(),
                    (AREA_LIMIT - width.bytes()) / element,
                ),
            ));
        };
        let bit = bit_of(area, width, byte, bit, &shown)?;
        Ok(Self {
            area,
            width,
            byte,
            bit,
        })
    }

    /// The range of the address's bits, counted from the start of the area.
    pub fn bits(self) -> std::ops::Range<usize> {
        let start = self.byte * 8 + usize::from(self.bit);
        start..start + self.width.bits()
    }
}

const EXAMPLES: &str = "addresses look like %QX1.0 (bit), %IB4 (byte), %QW2 (word), %ID8, %IL16";

/// The bit number of an address: only `X` has one, from 0 to 7.
fn bit_of(
    area: Area,
    width: Width,
    byte: usize,
    bit: Option<usize>,
    shown: &str,
) -> Result<u8, Mistake> {
    match (width, bit) {
        (Width::Bit, None) => Err(Mistake::new(
            format!("the bit address \"{shown}\" names no bit"),
            format!(
                "write {area}X{byte}.0 to {area}X{byte}.7, or {area}B{byte} for the whole byte"
            ),
        )),
        (Width::Bit, Some(bit)) => u8::try_from(bit)
            .ok()
            .filter(|bit| *bit < 8)
            .ok_or_else(|| {
                let right = if bit < 16 && byte + 2 <= AREA_LIMIT {
                    let (offset, inner) = super::ByteOrder::Abcd.bit_position(2, bit);
                    format!(
                        "bits go from 0 to 7; bit {bit} of {area}W{byte} is {area}X{}.{inner}",
                        byte + offset
                    )
                } else {
                    "bits go from 0 to 7".to_owned()
                };
                Mistake::new(
                    format!("bit {bit} in the address \"{shown}\" does not exist"),
                    right,
                )
            }),
        (_, Some(bit)) => Err(Mistake::new(
            format!(
                "the address \"{shown}\" has a bit, but its size is {} bits",
                width.bits()
            ),
            if bit < 8 {
                format!("write {area}X{byte}.{bit} for one bit")
            } else {
                format!("write {area}{}{byte} without the bit", width.letter())
            },
        )),
        (_, None) => Ok(0),
    }
}

/// The error for an area that no fieldbus carries, or that does not exist.
fn foreign_area(shown: &str, rest: &str, letter: Option<char>) -> Mistake {
    match letter {
        Some('M') => Mistake::new(
            format!("\"{shown}\" is a marker: memory of the PLC that no fieldbus carries"),
            "use an address in %I or %Q, and let the PLC program copy the marker there",
        ),
        Some('D') if rest.starts_with("DB") => Mistake::new(
            format!("\"{shown}\" lies in a data block, which no process image carries"),
            "use an address in %I or %Q, and let the PLC program copy the value there",
        ),
        Some(letter @ ('E' | 'A')) => {
            let area = if letter == 'E' { 'I' } else { 'Q' };
            Mistake::new(
                format!("\"{shown}\" is a German mnemonic"),
                format!("write \"%{area}{}\"", &rest[1..]),
            )
        }
        _ => Mistake::new(format!("\"{shown}\" is neither in %I nor in %Q"), EXAMPLES),
    }
}

/// Beyond every limit; sixteen times it, and a few bytes more, still fit.
const BEYOND: usize = usize::MAX / 32;

/// A decimal number without sign; one that does not fit becomes a number beyond every limit.
fn number(text: &str) -> Option<usize> {
    let digits = !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    digits.then(|| {
        text.parse()
            .map_or(BEYOND, |number: usize| number.min(BEYOND))
    })
}

/// The text as messages quote it.
fn shorten(text: &str) -> String {
    tickbus_base::toml_text::shown(text)
}

impl FromStr for Address {
    type Err = Mistake;

    /// Reads an address whose number counts bytes.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::parse(text, Addressing::Bytes)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self.width {
            Width::Bit => format!("{}X{}.{}", self.area, self.byte, self.bit),
            width => format!("{}{}{}", self.area, width.letter(), self.byte),
        };
        f.pad(&text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<String, String> {
        text.parse::<Address>()
            .map(|address| address.to_string())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn addresses_read_and_print() {
        for (text, printed) in [
            ("%QX1.0", "%QX1.0"),
            ("%q1.7", "%QX1.7"),
            ("%I0.3", "%IX0.3"),
            ("%ix65535.7", "%IX65535.7"),
            ("%IB0", "%IB0"),
            ("%iw4", "%IW4"),
            ("%QD3", "%QD3"),
            (" %IL65528 ", "%IL65528"),
            ("%QX01.00", "%QX1.0"),
        ] {
            assert_eq!(parse(text).as_deref(), Ok(printed), "{text}");
        }
    }

    #[test]
    fn elements_are_counted_by_their_size() {
        for (text, byte) in [
            ("%IW1", 2),
            ("%ID3", 12),
            ("%QL2", 16),
            ("%QB5", 5),
            ("%IX10.3", 10),
            ("%IW32767", 65_534),
        ] {
            let address = Address::parse(text, Addressing::Elements).expect(text);
            assert_eq!(address.byte, byte, "{text}");
        }
        assert!(Address::parse("%IW32768", Addressing::Elements).is_err());
    }

    #[test]
    fn every_place_reads_back_as_it_prints() {
        for area in [Area::Input, Area::Output] {
            for width in [
                Width::Bit,
                Width::Byte,
                Width::Word,
                Width::Double,
                Width::Long,
            ] {
                for byte in [0, 1, 7, AREA_LIMIT - width.bytes()] {
                    for bit in 0..if width == Width::Bit { 8 } else { 1 } {
                        let address = Address {
                            area,
                            width,
                            byte,
                            bit,
                        };
                        assert_eq!(address.to_string().parse(), Ok(address));
                    }
                }
            }
        }
    }

    #[test]
    fn a_bit_of_the_word_is_a_bit_of_the_other_byte() {
        assert_eq!(
            parse("%QX0.15").unwrap_err(),
            "bit 15 in the address \"%QX0.15\" does not exist; bits go from 0 to 7; bit 15 of %QW0 is \
             %QX0.7"
        );
    }

    #[test]
    fn numbers_at_the_end_of_what_a_computer_counts_lie_beyond_the_area() {
        for number in [u64::MAX, u64::MAX - 7, u64::MAX / 8, u64::MAX / 8 + 1] {
            for text in [format!("%QX{number}.0"), format!("%IL0{number}")] {
                for addressing in [Addressing::Bytes, Addressing::Elements] {
                    let told = Address::parse(&text, addressing).unwrap_err().to_string();
                    assert!(told.contains("lies beyond the 65536 bytes"), "{told}");
                }
            }
        }
    }

    #[test]
    fn what_is_no_address_is_refused() {
        let long = format!("%IW{}", "9".repeat(1000));
        for text in [
            "", "%", "%I", "%X0.0", "%QX0.", "%QX.0", "%QW1 2", "%IW+1", "%İ0.1", "%Iß", &long,
        ] {
            assert!(parse(text).is_err(), "{text}");
        }
    }
}
