//! The start of an image in a CPU, as written in a driver.cfg.

use std::fmt;
use std::str::FromStr;

use super::item::Object;
use tickbus_base::toml_text::shown;

/// The last byte that can be addressed.
pub(super) const LAST: usize = 65_535;

/// The first byte of something in a CPU: `%QB0`, `%DB10.DBB4`, `DB10`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Start {
    /// The object.
    pub object: Object,
    /// The byte's number in it.
    pub byte: usize,
}

impl fmt::Display for Start {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.object {
            Object::Block(number) => write!(f, "%DB{number}.DBB{}", self.byte),
            object => write!(f, "{object}B{}", self.byte),
        }
    }
}

/// Reads `%QB0`, `%IB10`, `%MB100`, `%DB10.DBB4`, `%DB10.DBX4.0` and `DB10`; the percent sign is optional.
impl FromStr for Start {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("\"{}\" is no place in a CPU", shown(text));
        let number = |digits: &str| {
            let plain = digits.bytes().all(|byte| byte.is_ascii_digit());
            let number = digits.parse::<usize>().ok();
            number.filter(|number| plain && *number <= LAST)
        };
        let bare = text.strip_prefix('%').unwrap_or(text);
        let bare = bare.to_ascii_uppercase();
        if let Some(block) = bare.strip_prefix("DB") {
            let (block, inner) = match block.split_once('.') {
                None => (block, "DBB0"),
                Some(parts) => parts,
            };
            let block = number(block).and_then(|block| u16::try_from(block).ok());
            let byte = match inner.strip_prefix("DBB") {
                Some(byte) => byte,
                None => inner
                    .strip_prefix("DBX")
                    .and_then(|bit| bit.strip_suffix(".0"))
                    .ok_or_else(wrong)?,
            };
            return match (block, number(byte)) {
                (Some(block @ 1..), Some(byte)) => Ok(Self {
                    object: Object::Block(block),
                    byte,
                }),
                _ => Err(wrong()),
            };
        }
        let objects = [
            ("IB", Object::Inputs),
            ("QB", Object::Outputs),
            ("MB", Object::Flags),
        ];
        objects
            .into_iter()
            .find_map(|(name, object)| Some((object, number(bare.strip_prefix(name)?)?)))
            .map(|(object, byte)| Self { object, byte })
            .ok_or_else(wrong)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_read_and_write_themselves() {
        for (text, written) in [
            ("%QB0", "%QB0"),
            ("IB10", "%IB10"),
            ("%mb100", "%MB100"),
            ("DB10", "%DB10.DBB0"),
            ("%DB10.DBB4", "%DB10.DBB4"),
            ("db65535.dbx65535.0", "%DB65535.DBB65535"),
        ] {
            let start: Start = text.parse().expect(text);
            assert_eq!(start.to_string(), written);
        }
        for text in [
            "",
            "%",
            "Q0",
            "%QW0",
            "%QX0.0",
            "DB0",
            "DB",
            "DB1.0",
            "DB1.DBX0.1",
            "DB1.DBW0",
            "DB65536",
            "%QB-1",
            "%QB+1",
            "%QB65536",
            "AB0",
            "ß",
        ] {
            assert!(text.parse::<Start>().is_err(), "{text}");
        }
    }
}
