//! Addresses of elements in the notations of users.

use std::fmt;
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;

use super::table::{ADDRESSES, Table};

/// An element of a table.
///
/// Written as a wire offset, which counts from 0 (`offset:20`, or with its table `holding-register offset:20`), or as a
/// number, which counts from 1: `holding-register:21`, `4x00021`, `400021` and `40021` are the same element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ElementAddress {
    /// The table.
    pub table: Table,
    /// The offset on the wire, from 0.
    pub offset: usize,
}

/// The remedy where a place should be written.
pub(super) const SHAPE: &str = "write \"offset:20\", which counts from 0, or \"holding-register:21\", \
                                \"4x00021\" or \"400021\", which count from 1";

impl ElementAddress {
    /// Reads a place; without a table in the text, it is in `table`.
    ///
    /// # Errors
    ///
    /// The text is not a place.
    pub fn parse(text: &str, table: Table) -> Result<Self, Mistake> {
        let wrong = |what: String| Mistake::new(what, SHAPE);
        let none = || wrong(format!("\"{}\" is no place in a table", shown(text)));
        // The table, the base of counting, and the digits.
        let (table, from, digits) = if let Some((head, digits)) = text.rsplit_once("offset:") {
            let table = match head.strip_suffix(' ') {
                Some(name) => named(name).ok_or_else(none)?,
                None if head.is_empty() => table,
                None => return Err(none()),
            };
            (table, 0, digits)
        } else if let Some((name, digits)) = text.split_once(':') {
            (named(name).ok_or_else(none)?, 1, digits)
        } else {
            let mut letters = text.chars();
            let table = letters.next().and_then(numbered).ok_or_else(none)?;
            let digits = letters.as_str();
            match digits.strip_prefix('x') {
                Some(digits) => (table, 1, digits),
                // Without a table letter, a number must be complete.
                None if matches!(digits.len(), 4 | 5) => (table, 1, digits),
                None => return Err(none()),
            }
        };
        if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
            return Err(none());
        }
        let number = digits.parse().unwrap_or(usize::MAX);
        if !(from..from + ADDRESSES).contains(&number) {
            let last = from + ADDRESSES - 1;
            let kind = if from == 0 { "offsets" } else { "numbers" };
            return Err(wrong(format!(
                "\"{}\" is beyond the table, whose {kind} go from {from} to {last}",
                shown(text)
            )));
        }
        let offset = number - from;
        Ok(Self { table, offset })
    }
}

fn named(name: &str) -> Option<Table> {
    Table::ALL.into_iter().find(|table| table.element() == name)
}

fn numbered(digit: char) -> Option<Table> {
    Table::ALL.into_iter().find(|table| table.digit() == digit)
}

/// Reads a place that names its table.
impl FromStr for ElementAddress {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        if text.starts_with("offset:") {
            return Err(Mistake::new(
                format!("\"{}\" names no table", shown(text)),
                "write it before the offset, as in \"holding-register offset:20\"",
            ));
        }
        Self::parse(text, Table::HoldingRegisters)
    }
}

/// Writes both notations.
impl fmt::Display for ElementAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { table, offset } = *self;
        let (element, digit, number) = (table.element(), table.digit(), offset + 1);
        write!(f, "{element} offset:{offset} ({digit}x{number:05})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_to_count_are_read() {
        let holding = |offset| ElementAddress {
            table: Table::HoldingRegisters,
            offset,
        };
        for text in [
            "offset:20",
            "holding-register offset:20",
            "holding-register:21",
            "4x00021",
            "4x21",
            "400021",
            "40021",
        ] {
            assert_eq!(
                ElementAddress::parse(text, Table::HoldingRegisters),
                Ok(holding(20))
            );
        }
        for (text, table, offset) in [
            ("000001", Table::Coils, 0),
            ("coil:65536", Table::Coils, 65_535),
            ("1x00017", Table::DiscreteInputs, 16),
            ("discrete-input offset:0", Table::DiscreteInputs, 0),
            ("365536", Table::InputRegisters, 65_535),
            ("input-register:1", Table::InputRegisters, 0),
        ] {
            assert_eq!(text.parse(), Ok(ElementAddress { table, offset }), "{text}");
        }
        assert_eq!(
            ElementAddress::parse("offset:65535", Table::InputRegisters).map(|place| place.table),
            Ok(Table::InputRegisters)
        );
        assert_eq!(
            holding(20).to_string(),
            "holding-register offset:20 (4x00021)"
        );
    }

    #[test]
    fn what_is_no_place_is_told_why() {
        for (text, part) in [
            ("", "no place"),
            ("20", "no place"),
            ("offset:", "no place"),
            ("offset:-1", "no place"),
            ("offset:65536", "offsets go from 0 to 65535"),
            ("holding-register:0", "numbers go from 1 to 65536"),
            ("400000", "numbers go from 1 to 65536"),
            ("4x65537", "numbers go from 1 to 65536"),
            ("4x999999999999999999999999", "numbers go from 1"),
            ("holding-registers:1", "no place"),
            ("holding-register:21:UINT", "no place"),
            ("200001", "no place"),
            ("4000021", "no place"),
            ("4021", "no place"),
            ("coiloffset:1", "no place"),
            ("offset:+1", "no place"),
        ] {
            let told = ElementAddress::parse(text, Table::HoldingRegisters).expect_err(text);
            assert!(told.what.contains(part), "\"{part}\" in {told}");
        }
        let told = "offset:20".parse::<ElementAddress>().expect_err("no table");
        assert!(told.to_string().contains("names no table"), "{told}");
    }
}
