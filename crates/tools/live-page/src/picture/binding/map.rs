//! The maps from a signal's value to a property.

use serde_json::{Value, json};

use super::super::{css, short};
use super::number;

/// The result of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A length, an angle.
    Number,
    /// A share of the drawn size: a range alone means from 0 to 1.
    Share,
    Colour,
    /// True for one of these values.
    Condition,
    Text,
}

/// Reads a map: `{ factor, offset }`, or `{ cases: [[from, to, out], …] }` as picture.js expects them.
pub(super) fn read(text: &str, kind: Kind) -> Result<Value, String> {
    let parts = split(text, ',');
    if text.trim().is_empty() {
        return Err(format!(
            "there is nothing behind the colon; {}",
            advice(kind)
        ));
    }
    let has_arrow = parts.iter().any(|part| part.split_once("->").is_some());
    match kind {
        Kind::Condition if has_arrow => {
            return Err(format!(
                "what is shown or hidden becomes nothing else; {}",
                advice(kind)
            ));
        }
        Kind::Text if !has_arrow => {
            return Ok(json!({ "cases": [[null, null, unquoted(text.trim())]] }));
        }
        Kind::Number if !has_arrow => {
            return factor(text)
                .ok_or_else(|| format!("\"{}\" is no factor; {}", short(text), advice(kind)));
        }
        Kind::Share if !has_arrow && !text.contains("..") => {
            return factor(text)
                .ok_or_else(|| format!("\"{}\" is no range; {}", short(text), advice(kind)));
        }
        _ => {}
    }
    let mut cases = Vec::new();
    let last = parts.len() - 1;
    for (at, part) in parts.iter().enumerate() {
        let wrong = |what: &str| format!("\"{}\" is {what}; {}", short(part.trim()), advice(kind));
        let (from, out) = match part.split_once("->") {
            Some((from, out)) => (from.trim(), Some(out.trim())),
            None => (part.trim(), None),
        };
        let (from, to) = if from == "else" {
            if at != last {
                return Err("\"else\" has to come last".to_owned());
            }
            (None, None)
        } else {
            let (from, to) = span(from).ok_or_else(|| wrong("no value and no range"))?;
            (Some(from), Some(to))
        };
        let out = match (kind, out) {
            (Kind::Condition, None) => json!(1),
            (Kind::Share, None) => json!([0, 1]),
            (Kind::Number | Kind::Share, Some(out)) => {
                let (from, to) =
                    span(out).ok_or_else(|| wrong("no number and no range behind the arrow"))?;
                json!([from, to])
            }
            (Kind::Colour, Some(out)) => {
                colour(out).ok_or_else(|| wrong("no colour behind the arrow"))?
            }
            (Kind::Text, Some(out)) => json!(unquoted(out)),
            (_, None) | (Kind::Condition, _) => return Err(wrong("without an arrow")),
        };
        cases.push(json!([from, to, out]));
    }
    Ok(json!({ "cases": cases }))
}

/// How to write a map.
const fn advice(kind: Kind) -> &'static str {
    match kind {
        Kind::Number => "write a factor such as 0.5, or ranges such as 0..250 -> 0..-180",
        Kind::Share => "write the range from nothing to all, such as 0..500, or 0..500 -> 0..1",
        Kind::Colour => {
            "write colours such as off -> #d0d0d0, on -> #20a050, or 0..100 -> #0000ff..#ff0000"
        }
        Kind::Condition => "write values and ranges such as 1, 3..5",
        Kind::Text => "write a pattern such as {0.0} mm, or 0 -> stopped, 1 -> \"runs, slowly\"",
    }
}

/// `FACTOR`, `FACTOR + OFFSET` or `FACTOR - OFFSET`.
fn factor(text: &str) -> Option<Value> {
    let (factor, offset) = if let Some(factor) = number(text) {
        (factor, 0.0)
    } else if let Some((factor, offset)) = text.split_once(" + ") {
        (number(factor)?, number(offset)?)
    } else {
        let (factor, offset) = text.split_once(" - ")?;
        (number(factor)?, -number(offset)?)
    };
    Some(json!({ "factor": factor, "offset": offset }))
}

/// A value or a range. BOOLs may be words.
fn span(text: &str) -> Option<(f64, f64)> {
    if let Some((from, to)) = text.split_once("..") {
        return Some((number(from)?, number(to)?));
    }
    let value = match &*text.trim().to_ascii_lowercase() {
        "on" | "true" => 1.0,
        "off" | "false" => 0.0,
        other => number(other)?,
    };
    Some((value, value))
}

/// A colour, a gradient or pattern of the picture, or a range between two colours.
fn colour(text: &str) -> Option<Value> {
    if let Some((from, to)) = text.split_once("..") {
        return Some(json!([hex(from.trim())?, hex(to.trim())?]));
    }
    let is_word =
        !text.is_empty() && text.len() <= 32 && text.bytes().all(|byte| byte.is_ascii_alphabetic());
    let is_reference = text.starts_with("url(#")
        && text.ends_with(')')
        && text.len() <= 80
        && css::is_harmless(text);
    if is_word || is_reference {
        return Some(json!(text));
    }
    hex(text).map(Value::String)
}

/// A colour in six digits.
fn hex(text: &str) -> Option<String> {
    let digits = text.strip_prefix('#')?;
    if !digits.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    match digits.len() {
        6 => Some(text.to_ascii_lowercase()),
        3 => Some(digits.chars().fold("#".to_owned(), |mut all, digit| {
            all.extend([digit, digit]);
            all.to_ascii_lowercase()
        })),
        _ => None,
    }
}

/// The parts of a text between separators that are not within quotes.
fn split(text: &str, separator: char) -> Vec<&str> {
    let mut parts = Vec::new();
    let (mut begin, mut quote) = (0, None);
    for (at, c) in text.char_indices() {
        match quote {
            Some(open) if open == c => quote = None,
            None if matches!(c, '"' | '\'') && begins_word(&text[begin..at]) => quote = Some(c),
            None if c == separator => {
                parts.push(&text[begin..at]);
                begin = at + c.len_utf8();
            }
            _ => {}
        }
    }
    parts.push(&text[begin..]);
    parts
}

/// True if a quote here begins a text: an apostrophe within a word does not.
fn begins_word(before: &str) -> bool {
    let before = before.trim_end();
    before.is_empty() || before.ends_with("->")
}

/// A text without the quotes around it.
fn unquoted(text: &str) -> &str {
    let inner = |quote: char| {
        text.strip_prefix(quote)
            .and_then(|rest| rest.strip_suffix(quote))
    };
    inner('"').or_else(|| inner('\'')).unwrap_or(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn reads(text: &str, kind: Kind, json: &Value) {
        assert_eq!(read(text, kind).as_ref(), Ok(json), "{text}");
    }

    #[test]
    fn numbers_have_factors_or_ranges() {
        reads(
            "-0.5",
            Kind::Number,
            &json!({"factor": -0.5, "offset": 0.0}),
        );
        reads(
            "90 - 45",
            Kind::Number,
            &json!({"factor": 90.0, "offset": -45.0}),
        );
        reads(
            "0..250 -> 0..-180",
            Kind::Number,
            &json!({"cases": [[0.0, 250.0, [0.0, -180.0]]]}),
        );
        reads(
            "0..0.5 -> 0..10, on -> 12, else -> -1e1",
            Kind::Number,
            &json!({"cases": [[0.0, 0.5, [0.0, 10.0]], [1.0, 1.0, [12.0, 12.0]], [null, null, [-10.0, -10.0]]]}),
        );
        reads(
            "0..500",
            Kind::Share,
            &json!({"cases": [[0.0, 500.0, [0, 1]]]}),
        );
        reads("0.01", Kind::Share, &json!({"factor": 0.01, "offset": 0.0}));
        for text in [
            "",
            " ",
            "x",
            "1..",
            "..",
            "1 -> ",
            "1 -> x",
            "else -> 1, 2 -> 3",
            "inf",
            "1,2",
            "0..nan -> 1",
        ] {
            assert!(read(text, Kind::Number).is_err(), "{text}");
            assert!(read(text, Kind::Share).is_err(), "{text}");
        }
    }

    #[test]
    fn colours_are_of_the_picture() {
        reads(
            "off -> #DDD, 1 -> url(#lit), else -> none",
            Kind::Colour,
            &json!({"cases": [[0.0, 0.0, "#dddddd"], [1.0, 1.0, "url(#lit)"], [null, null, "none"]]}),
        );
        reads(
            "0..100 -> #00f..#ff0000",
            Kind::Colour,
            &json!({"cases": [[0.0, 100.0, ["#0000ff", "#ff0000"]]]}),
        );
        for text in [
            "red",
            "1 -> url(http://x)",
            "1 -> #12345",
            "1 -> red..blue",
            "1 -> url(#a\\)",
            "1 -> expression(1)",
        ] {
            assert!(read(text, Kind::Colour).is_err(), "{text}");
        }
    }

    #[test]
    fn texts_may_have_everything_in_quotes() {
        reads(
            "lift 1 at {0} mm, really",
            Kind::Text,
            &json!({"cases": [[null, null, "lift 1 at {0} mm, really"]]}),
        );
        reads(
            "0 -> stopped, 1 -> \"runs, slowly -> but\", 2..9 -> it's {}",
            Kind::Text,
            &json!({"cases": [[0.0, 0.0, "stopped"], [1.0, 1.0, "runs, slowly -> but"], [2.0, 9.0, "it's {}"]]}),
        );
        reads(
            "1, 3..5, off",
            Kind::Condition,
            &json!({"cases": [[1.0, 1.0, 1], [3.0, 5.0, 1], [0.0, 0.0, 1]]}),
        );
        assert!(read("1 -> 2", Kind::Condition).is_err());
        assert!(read("1 -> a, b", Kind::Text).is_err());
    }
}
