//! Numbers with the unit of their signal.

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Value, shown};
use tickbus_image::signal::Signal;

/// Splits a number from the text that follows: `12.5 mm` is 12.5 and `mm`.
pub(super) fn split(text: &str) -> Option<(f64, &str)> {
    const LONGEST: usize = 64;
    let text = text.trim();
    // The longest prefix that is a number: in `2e3 mm` the `e` belongs to it, in `2 mm` the unit follows the 2.
    let ends = text.char_indices().map(|(at, c)| at + c.len_utf8());
    let ends: Vec<usize> = ends.take(LONGEST).collect();
    let begins = |end: &usize| {
        let (number, rest) = text.split_at(*end);
        // Excludes texts that Rust parses but that are no numbers here: `inf`, `nan`.
        let digits = number.ends_with(|c: char| c.is_ascii_digit() || c == '.');
        let number = number.parse::<f64>().ok();
        number
            .filter(|number| digits && number.is_finite())
            .map(|number| (number, rest.trim()))
    };
    ends.iter().rev().find_map(begins)
}

/// Checks that `unit` is the signal's unit; the error has the remedy.
pub(super) fn check_unit(unit: &str, signal: &Signal) -> Result<(), Mistake> {
    match signal.unit.as_deref() {
        _ if unit.is_empty() => Ok(()),
        Some(own) if own == unit => Ok(()),
        Some(own) => Err(Mistake::new(
            format!(
                "\"{}\" is in {}, not in {}",
                shown(&signal.name),
                shown(own),
                shown(unit)
            ),
            format!("write the number in {}", shown(own)),
        )),
        None => Err(Mistake::new(
            format!("\"{}\" has no unit", shown(&signal.name)),
            "write the number alone",
        )),
    }
}

/// Reads a number in the unit of `signal`: `5`, or `"5 mm"`.
pub(super) fn of_value(value: &Value<'_>, signal: &Signal) -> Option<f64> {
    let right = match signal.unit.as_deref() {
        Some(unit) => format!("write a number, such as 2.5 or \"2.5 {}\"", shown(unit)),
        None => "write a number, such as 2.5".to_owned(),
    };
    let Some(text) = value.as_text() else {
        return value.number(&right);
    };
    let Some((number, unit)) = split(text) else {
        value.wrong(format!("\"{}\" is no number", shown(text)), right);
        return None;
    };
    match check_unit(unit, signal) {
        Ok(()) => Some(number),
        Err(mistake) => {
            value.refuse(mistake);
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_ends_where_its_unit_begins() {
        for (text, expected) in [
            ("5 mm", Some((5.0, "mm"))),
            ("5mm", Some((5.0, "mm"))),
            (" -2.5e3 °C ", Some((-2500.0, "°C"))),
            ("7", Some((7.0, ""))),
            ("1e", Some((1.0, "e"))),
            ("mm", None),
            ("inf", None),
            ("NaN mm", None),
            ("", None),
        ] {
            assert_eq!(split(text), expected, "{text}");
        }
    }
}
