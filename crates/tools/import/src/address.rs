//! Addresses as editors write them.

use tickbus_base::Mistake;
use tickbus_image::signal::{Address, Addressing, Area, Width};

/// The contents of an address cell.
#[derive(Debug)]
pub(super) enum ParsedAddress {
    /// An address of an input or output.
    Image(Address),
    /// An address in the PLC outside the process image, with a description.
    Elsewhere(&'static str),
    /// An input or output in the wrong notation.
    Wrong(Mistake),
    /// Not an address.
    Nothing,
}

/// Reads an address: `%I0.0`, `I      0.0`, `%IW4:P`, `EW 4`, `PIW 256`.
pub(super) fn place(text: &str, addressing: Addressing) -> ParsedAddress {
    let mut plain: String = text
        .chars()
        .filter(|c| !c.is_whitespace())
        .collect::<String>()
        .to_ascii_uppercase();
    if plain.starts_with('%') {
        plain.remove(0);
    }
    // The peripheral access to an address has the same place.
    if let Some(rest) = plain.strip_suffix(":P") {
        plain.truncate(rest.len());
    }
    let peripheral = plain
        .strip_prefix('P')
        .filter(|rest| rest.starts_with(['I', 'Q', 'E', 'A']));
    if let Some(rest) = peripheral {
        plain = rest.to_owned();
    }
    let digits = plain.find(|c: char| c.is_ascii_digit());
    let Some(digits) = digits else {
        return ParsedAddress::Nothing;
    };
    let (letters, numbers) = plain.split_at(digits);
    if !numbers.chars().all(|c| c.is_ascii_digit() || c == '.') && !letters.starts_with("DB") {
        return ParsedAddress::Nothing;
    }
    let elsewhere = match letters {
        "M" | "MX" | "MB" | "MW" | "MD" | "ML" => "a marker",
        "T" => "a timer",
        "C" | "Z" => "a counter",
        "FB" | "FC" | "OB" | "SFB" | "SFC" | "UDT" | "VAT" => "a block",
        "L" | "LB" | "LW" | "LD" => "local data of a block",
        _ if letters.starts_with("DB") || letters.starts_with("DI") => "in a data block",
        _ => "",
    };
    if !elsewhere.is_empty() {
        return ParsedAddress::Elsewhere(elsewhere);
    }
    // German mnemonics; an address without a size letter is that of a bit.
    let international = match letters.chars().next() {
        Some('E') => letters.replacen('E', "I", 1),
        Some('A') => letters.replacen('A', "Q", 1),
        Some('I' | 'Q') => letters.to_owned(),
        _ => return ParsedAddress::Nothing,
    };
    if !["", "X", "B", "W", "D", "L"].contains(&&international[1..]) {
        return ParsedAddress::Nothing;
    }
    match Address::parse(&format!("%{international}{numbers}"), addressing) {
        Ok(address) => ParsedAddress::Image(address),
        Err(error) => ParsedAddress::Wrong(error),
    }
}

/// The area of an input or output whose address names no place in the image, and its size if the address states it:
/// `%I*`, `%QW*`, or one in several levels such as Beremiz' `%IW0.0.1.0`.
pub(super) fn without_place(text: &str) -> Option<(Area, Option<Width>)> {
    let upper = text.to_ascii_uppercase();
    let rest = upper.strip_prefix('%')?;
    let area = match rest.chars().next()? {
        'I' => Area::Input,
        'Q' => Area::Output,
        _ => return None,
    };
    let rest = &rest[1..];
    let letter = rest.chars().next().filter(char::is_ascii_alphabetic);
    let width = letter.map(Width::of_letter);
    if width == Some(None) {
        return None;
    }
    let place = &rest[letter.map_or(0, char::len_utf8)..];
    let is_levels = place.contains('.')
        && place
            .split('.')
            .all(|level| !level.is_empty() && level.bytes().all(|byte| byte.is_ascii_digit()));
    (place == "*" || is_levels).then_some((area, width.flatten()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn editors_addresses_are_known() {
        for (text, printed) in [
            ("%I0.0", "%IX0.0"),
            ("I      0.7", "%IX0.7"),
            ("%QW4", "%QW4"),
            ("%ID10", "%ID10"),
            ("E 1.0", "%IX1.0"),
            ("AB 5", "%QB5"),
            ("PEW 256", "%IW256"),
            ("PQW256", "%QW256"),
            ("%IW64:P", "%IW64"),
            ("%ix3.1", "%IX3.1"),
        ] {
            match place(text, Addressing::Bytes) {
                ParsedAddress::Image(address) => assert_eq!(address.to_string(), printed, "{text}"),
                other => panic!("{text}: {other:?}"),
            }
        }
        for text in [
            "%M0.0",
            "MW 20",
            "T 5",
            "Z 3",
            "%DB1.DBX0.0",
            "DB 10",
            "FC 1",
            "%MD100",
        ] {
            assert!(
                matches!(place(text, Addressing::Bytes), ParsedAddress::Elsewhere(_)),
                "{text}"
            );
        }
        for text in ["%I0.9", "%IX", "%QX70000.0", "E1"] {
            assert!(
                matches!(
                    place(text, Addressing::Bytes),
                    ParsedAddress::Wrong(_) | ParsedAddress::Nothing
                ),
                "{text}"
            );
        }
        for text in ["", "Bool", "Start", "Motor 1", "5", "AUTO1", "IN5", "True"] {
            assert!(
                matches!(place(text, Addressing::Bytes), ParsedAddress::Nothing),
                "{text}"
            );
        }
    }
}
