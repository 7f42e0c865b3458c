//! One variable of a CPU, in the notations of programming and visualisation tools.

use std::fmt;
use std::str::FromStr;

use super::item::Object;
use super::place::LAST;
use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::{DataType, Signal, Width};

/// The data block as which clients access the variable memory of a LOGO!.
const LOGO_V: Object = Object::Block(1);

/// A variable as it is written in `[fieldbus.at]`: `%DB10.DBX0.3`, `DB10,REAL4`, `%MW20`, `V10.2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variable {
    /// The object that contains it.
    pub object: Object,
    /// The first byte in the object.
    pub byte: usize,
    /// The bit within that byte; 0 for whole bytes.
    pub bit: u8,
    /// The width.
    pub width: Width,
    /// The type, if stated.
    pub data_type: Option<DataType>,
}

impl Variable {
    /// The remedy where an address is expected.
    pub(super) const RIGHT: &str = "write it as TIA Portal does, such as \"%DB10.DBX0.3\", \"%DB10.DBW2\", \"%MD20\" \
        or \"%I0.0\", with a type behind it if you like, \"%DB10.DBD4:REAL\"; \"DB10,REAL4\" and, for a LOGO!, \
        \"VW20\" will do, too";

    /// Checks that `signal` can have this place.
    ///
    /// # Errors
    ///
    /// The signal does not match; the message says what to write instead.
    pub(super) fn check(&self, signal: &Signal) -> Result<(), Mistake> {
        let own = signal.data_type;
        let bits = |count: usize| match count {
            1 => "1 bit".to_owned(),
            count => format!("{count} bits"),
        };
        let name = shown(&signal.name);
        if own.width() != self.width {
            return Err(Mistake::new(
                format!(
                    "{self} has {}, and the signal \"{name}\" is of type {own} with {}",
                    bits(self.width.bits()),
                    bits(own.width().bits())
                ),
                format!(
                    "write an address of {}, or correct \"type\" of the signal",
                    bits(own.width().bits())
                ),
            ));
        }
        let is_float = |data_type| matches!(data_type, DataType::Real | DataType::Lreal);
        let is_plain = |data_type: DataType| data_type == data_type.width().data_type();
        match self.data_type {
            Some(stated)
                if is_float(stated) != is_float(own) && !is_plain(stated) && !is_plain(own) =>
            {
                Err(Mistake::new(
                    format!("{self} is of type {stated}, and the signal \"{name}\" of type {own}"),
                    "write the same type at both, or leave it out here",
                ))
            }
            _ => Ok(()),
        }
    }

    /// The bits within the object: the first, and their number.
    pub(super) fn bits(&self) -> (usize, usize) {
        (self.byte * 8 + usize::from(self.bit), self.width.bits())
    }
}

/// Writes the variable as in TIA Portal; variables of 64 bits, for which TIA Portal has no letter, as in PLC4X.
impl fmt::Display for Variable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            object, byte, bit, ..
        } = self;
        let block = matches!(object, Object::Block(_));
        match object {
            Object::Block(number) => write!(f, "%DB{number}.DB")?,
            object => write!(f, "{object}")?,
        }
        match self.width {
            Width::Bit if block => write!(f, "X{byte}.{bit}"),
            Width::Bit => write!(f, "{byte}.{bit}"),
            Width::Long => {
                let data_type = self.data_type.unwrap_or(DataType::Lword);
                write!(f, "X{byte}.0:{data_type}")
            }
            width => write!(f, "{}{byte}", width.letter()),
        }
    }
}

/// Reads the notation of STEP 7 and TIA Portal (`%DB10.DBX0.3`, `%MW20`, `%I0.0`), with or without the
/// percent sign; followed by a type, as in PLC4X (`%DB10.DBD4:REAL`, `%DB10:4:REAL`); with an embedded type,
/// as in `KEPServer` and nodes7 (`DB10,REAL4`, `DB10,X0.3`, `MR20`); and the variable memory of a LOGO!
/// (`VW20`).
impl FromStr for Variable {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("\"{}\" is no address in a CPU", shown(text));
        let upper = text.trim().to_ascii_uppercase();
        let bare = upper.strip_prefix('%').unwrap_or(&upper);
        // The type, if it follows the address.
        let (bare, stated) = match bare.rsplit_once(':') {
            Some((bare, word)) => (bare, Some(kind(word).ok_or_else(wrong)?)),
            None => (bare, None),
        };
        let (object, inner) = split(bare).ok_or_else(|| match block(bare) {
            Some((digits, _)) if number(digits, usize::from(u16::MAX)).is_none_or(|n| n == 0) => {
                format!(
                    "\"{}\" names DB{digits}; data blocks go from 1 to 65535",
                    shown(text)
                )
            }
            _ => wrong(),
        })?;
        let digits = inner.find(|c: char| c.is_ascii_digit()).ok_or_else(wrong)?;
        let (code, place) = inner.split_at(digits);
        let (byte, bit) = match place.split_once('.') {
            None => (place, None),
            Some((byte, bit)) => (byte, Some(number(bit, 7).ok_or_else(wrong)?)),
        };
        let beyond = || {
            format!(
                "\"{}\" reaches beyond byte {LAST}, which is the last one",
                shown(text)
            )
        };
        let is_number = !byte.is_empty() && byte.bytes().all(|byte| byte.is_ascii_digit());
        let byte = number(byte, LAST).ok_or_else(|| if is_number { beyond() } else { wrong() })?;
        let within = match (code, bit, stated) {
            // Without a letter: a bit, or as the type says.
            ("", Some(_), None) => Kind::plain(Width::Bit),
            ("", _, Some(stated)) => stated,
            ("", None, None) => return Err(wrong()),
            (code, ..) => kind(code).ok_or_else(wrong)?,
        };
        // A wide variable may be addressed by its first bit, as TIA Portal does for 64 bits.
        let Kind { width, data_type } = match stated {
            Some(stated) if within.width == stated.width || within.width == Width::Bit => stated,
            None => within,
            Some(stated) => {
                let (is, says) = (within.width.bits(), stated.width.bits());
                return Err(format!(
                    "\"{}\" is an address of {is} bits with a type of {says}",
                    shown(text)
                ));
            }
        };
        let bit = match (width, bit) {
            (Width::Bit, Some(bit)) => bit,
            (_, None | Some(0)) if width != Width::Bit => 0,
            _ => return Err(wrong()),
        };
        if byte + width.bytes() > LAST + 1 {
            return Err(beyond());
        }
        Ok(Self {
            object,
            byte,
            bit: u8::try_from(bit).map_err(|_| wrong())?,
            width,
            data_type,
        })
    }
}

/// The information about a variable in a letter or a type.
#[derive(Clone, Copy)]
struct Kind {
    width: Width,
    data_type: Option<DataType>,
}

impl Kind {
    const fn plain(width: Width) -> Self {
        let data_type = None;
        Self { width, data_type }
    }
}

/// The meaning of a word: a size letter, or a type in one of its notations.
fn kind(word: &str) -> Option<Kind> {
    let letter = match word {
        "X" | "BIT" => Some(Width::Bit),
        "B" => Some(Width::Byte),
        "W" => Some(Width::Word),
        "D" => Some(Width::Double),
        "L" => Some(Width::Long),
        _ => None,
    };
    if let Some(width) = letter {
        return Some(Kind::plain(width));
    }
    let data_type = match word {
        "C" | "CHAR" => DataType::Byte,
        "I" => DataType::Int,
        "DI" | "TIME" => DataType::Dint,
        "R" => DataType::Real,
        "LR" => DataType::Lreal,
        word => word.parse().ok()?,
    };
    Some(Kind {
        width: data_type.width(),
        data_type: Some(data_type),
    })
}

/// The object at the start of an address, and the rest of it.
fn split(text: &str) -> Option<(Object, &str)> {
    let Some((digits, rest)) = block(text) else {
        let object = match text.chars().next()? {
            'I' => Object::Inputs,
            'Q' => Object::Outputs,
            'M' => Object::Flags,
            'V' => LOGO_V,
            _ => return None,
        };
        return Some((object, &text[1..]));
    };
    let rest = match rest.strip_prefix(".DB") {
        Some(rest) => rest,
        None => rest.strip_prefix([',', ':', '.'])?,
    };
    let block = number(digits, usize::from(u16::MAX)).filter(|block| *block > 0)?;
    Some((Object::Block(u16::try_from(block).ok()?), rest))
}

/// The digits after `DB`, and what follows them.
fn block(text: &str) -> Option<(&str, &str)> {
    let block = text.strip_prefix("DB")?;
    let end = block.find(|c: char| !c.is_ascii_digit());
    let (digits, rest) = block.split_at(end.unwrap_or(block.len()));
    (!digits.is_empty()).then_some((digits, rest))
}

/// A number without a sign, at most `last`.
fn number(digits: &str, last: usize) -> Option<usize> {
    let plain = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
    let number = plain.then(|| digits.parse().ok())?;
    number.filter(|number| *number <= last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spellings_of_tools_are_read() {
        for (text, written) in [
            ("%DB10.DBX0.3", "%DB10.DBX0.3"),
            ("%DB10.DBX0.3:BOOL", "%DB10.DBX0.3"),
            ("DB10.DBD4:REAL", "%DB10.DBD4"),
            ("DB10,REAL4", "%DB10.DBD4"),
            ("DB10,X0.3", "%DB10.DBX0.3"),
            ("DB10,INT2", "%DB10.DBW2"),
            ("DB10,B7", "%DB10.DBB7"),
            ("DB10,DINT8", "%DB10.DBD8"),
            ("DB10,LREAL8", "%DB10.DBX8.0:LREAL"),
            ("DB10.DBW2", "%DB10.DBW2"),
            ("db1.dbb7", "%DB1.DBB7"),
            ("%DB1:8.0:LREAL", "%DB1.DBX8.0:LREAL"),
            ("%DB1:8:REAL", "%DB1.DBD8"),
            ("%DB1.DBX8.0:LWORD", "%DB1.DBX8.0:LWORD"),
            ("%MW20", "%MW20"),
            ("MR20", "%MD20"),
            ("%M0.1", "%M0.1"),
            ("%MX0.1", "%M0.1"),
            ("%IW0", "%IW0"),
            ("%QB3", "%QB3"),
            ("%I0.0:BOOL", "%I0.0"),
            ("%ID4:DINT", "%ID4"),
            ("V10.2", "%DB1.DBX10.2"),
            ("VW20", "%DB1.DBW20"),
            (" VD4 ", "%DB1.DBD4"),
            ("DB65535.DBB65535", "%DB65535.DBB65535"),
        ] {
            let variable: Variable = text.parse().unwrap_or_else(|why| panic!("{why}"));
            assert_eq!(variable.to_string(), written, "{text}");
            let again: Variable = written.parse().expect("its own spelling");
            assert_eq!(
                (again.object, again.bits()),
                (variable.object, variable.bits())
            );
        }
    }

    #[test]
    fn what_is_no_address_is_told_as_such() {
        for text in [
            "",
            "%",
            "DB10",
            "DB10.",
            "DB0.DBW0",
            "DB65536.DBW0",
            "DB1.DBW",
            "DB1.DBX0",
            "DB1.DBX0.8",
            "DB1.DBW0.1",
            "DB1.DBX0.1:INT",
            "DB1.DBW65535",
            "DB1.DBB65536",
            "DB1.DBB+1",
            "DB1.DBW0:COLOUR",
            "DB1,COLOUR4",
            "%I0",
            "%M-1.0",
            "%T5",
            "MW",
            "M1.",
            "holding-register:21",
            "ß",
            "Mß1",
            "%DB1.DBD9999999999999999999",
        ] {
            assert!(text.parse::<Variable>().is_err(), "{text}");
        }
        let why = "DB1.DBW0:REAL".parse::<Variable>().expect_err("16 and 32");
        assert!(why.contains("16 bits with a type of 32"), "{why}");
        for (text, range) in [
            ("DB0.DBW3", "from 1 to 65535"),
            ("DB65536.DBW0", "from 1 to 65535"),
            ("DB10.DBW70000", "beyond byte 65535"),
            ("DB10.DBW65535", "beyond byte 65535"),
        ] {
            let why = text.parse::<Variable>().expect_err(text);
            assert!(why.contains(range), "{why}");
        }
    }
}
