//! The interface of a block: its variables, and the signals that they can be.

use std::collections::HashMap;
use std::ops::Range;

use super::code::Code;
use super::duration::milliseconds;
use super::outline::{Unit, UnitKind};
use tickbus_base::Mistake;
use tickbus_base::toml_text::Collector;

/// The use of a variable by the caller of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// `VAR_INPUT`.
    Input,
    /// `VAR_OUTPUT`.
    Output,
    /// `VAR_IN_OUT`.
    InOut,
    /// The result of a function, which has the function's name.
    Result,
}

/// A variable of a block's interface.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// The name as declared.
    pub name: String,
    /// The use by the caller.
    pub direction: Direction,
    /// The type as declared.
    pub data_type: String,
    /// Line and column of the declaration, both from 1.
    pub place: (usize, usize),
    /// The elementary type behind the declared one; `None` if no signal can have it.
    pub(crate) elementary: Option<&'static Elementary>,
    /// The initial value if it is a literal, else 0; milliseconds of a TIME.
    pub(crate) initial: f64,
}

/// A type that a signal can have.
#[derive(Debug, PartialEq)]
pub(crate) struct Elementary {
    pub(crate) name: &'static str,
    /// The type of the signal.
    pub(crate) signal: &'static str,
    /// The letter of its address, and its bytes.
    pub(crate) size: (char, usize),
}

const fn elementary(name: &'static str, size: (char, usize)) -> Elementary {
    let signal = name;
    Elementary { name, signal, size }
}

const ELEMENTARY: &[Elementary] = &[
    elementary("BOOL", ('X', 1)),
    elementary("BYTE", ('B', 1)),
    elementary("SINT", ('B', 1)),
    elementary("USINT", ('B', 1)),
    elementary("WORD", ('W', 2)),
    elementary("INT", ('W', 2)),
    elementary("UINT", ('W', 2)),
    DWORD,
    elementary("DINT", ('D', 4)),
    elementary("UDINT", ('D', 4)),
    elementary("REAL", ('D', 4)),
    elementary("LWORD", ('L', 8)),
    elementary("LINT", ('L', 8)),
    elementary("ULINT", ('L', 8)),
    elementary("LREAL", ('L', 8)),
    TIME,
];

pub(crate) const DWORD: Elementary = elementary("DWORD", ('D', 4));

/// A TIME is a signal in milliseconds.
const TIME: Elementary = Elementary {
    name: "TIME",
    signal: "DINT",
    size: ('D', 4),
};

impl Elementary {
    /// The signal's value, as a value of this type.
    pub(crate) fn of_signal(&self, value: &str) -> String {
        if self.name == self.signal {
            return value.to_owned();
        }
        // iec2c's conversion cuts off fractions of a nanosecond.
        format!("LREAL_TO_TIME((DINT_TO_LREAL({value}) + 0.0000005) / 1000.0)")
    }

    /// A value of this type, as that of the signal.
    pub(crate) fn to_signal(&self, value: &str) -> String {
        if self.name == self.signal {
            return value.to_owned();
        }
        format!("LREAL_TO_DINT(TIME_TO_LREAL({value}) * 1000.0)")
    }

    pub(crate) fn unit(&self) -> Option<&'static str> {
        (self.name != self.signal).then_some("ms")
    }
}

/// The mistake of a variable of which no signal can be made.
pub fn unfit(variable: &Variable) -> Mistake {
    let Variable {
        name, data_type, ..
    } = variable;
    Mistake::new(
        format!("\"{name}\" is of the type {data_type}, of which no signal can be made"),
        format!(
            "leave it out with without = [\"{name}\"], or test a small block around this one that has its parts as inputs and outputs"
        ),
    )
}

/// One declaration: `a, b : INT := 5;`.
pub(crate) struct Declaration {
    pub(crate) names: Vec<usize>,
    pub(crate) kind: Range<usize>,
    pub(crate) initial: Range<usize>,
}

/// Words before the names of a section.
const QUALIFIERS: &[&str] = &["RETAIN", "NON_RETAIN", "PERSISTENT", "CONSTANT"];

/// The declarations of a section or a `TYPE`.
pub(crate) fn declarations(code: &Code<'_>, inner: Range<usize>) -> Vec<Declaration> {
    let mut found = Vec::new();
    let mut at = inner.start;
    // Moves to the next of these symbols outside of brackets and structures.
    let next = |mut at: usize, ends: &[&str]| {
        let mut depth = 0_usize;
        while at < inner.end && (depth > 0 || !ends.contains(&code.word(at))) {
            match code.capitals(at).as_str() {
                "(" | "[" => at = code.closing(at, inner.end),
                "STRUCT" | "UNION" => depth += 1,
                "END_STRUCT" | "END_UNION" => depth = depth.saturating_sub(1),
                _ => {}
            }
            at += 1;
        }
        at
    };
    while at < inner.end {
        let colon = next(at, &[":", ";"]);
        let mut names = Vec::new();
        while at < colon {
            if code.is(at, "AT") {
                at += 1;
            } else if code.is_word(at) && !code.is_any(at, QUALIFIERS) {
                names.push(at);
            }
            at += 1;
        }
        let kind = colon + 1..next(colon + 1, &[":=", ";"]);
        let end = next(kind.end, &[";"]);
        let initial = (kind.end + 1).min(end)..end;
        if code.word(colon) == ":" {
            at = end + 1;
            found.push(Declaration {
                names,
                kind,
                initial,
            });
        } else {
            at = colon + 1;
        }
    }
    found
}

pub(crate) type Types<'c, 't> = HashMap<String, (&'c Code<'t>, Range<usize>)>;

pub(crate) fn variables(code: &Code<'_>, unit: &Unit, types: &Types<'_, '_>) -> Vec<Variable> {
    let collector = Collector::new("", code.text);
    let mut found = Vec::new();
    let mut add = |name: usize, direction, kind: &Range<usize>, initial: &Range<usize>| {
        // An input with R_EDGE is a BOOL for the caller.
        let edge = kind
            .clone()
            .find(|at| code.is_any(*at, &["R_EDGE", "F_EDGE"]));
        let kind = kind.start..edge.unwrap_or(kind.end);
        found.push(Variable {
            name: code.word(name).to_owned(),
            direction,
            data_type: written(code, &kind),
            place: collector.place(code.start(name)),
            elementary: resolved(code, &kind, types),
            initial: literal(&words(code, initial)).unwrap_or_default(),
        });
    };
    for section in &unit.sections {
        let direction = match code.capitals(section.inner.start - 1).as_str() {
            "VAR_INPUT" => Direction::Input,
            "VAR_OUTPUT" => Direction::Output,
            "VAR_IN_OUT" => Direction::InOut,
            _ => continue,
        };
        for declared in declarations(code, section.inner.clone()) {
            for name in &declared.names {
                add(*name, direction, &declared.kind, &declared.initial);
            }
        }
    }
    if unit.kind == UnitKind::Function {
        add(unit.name, Direction::Result, &unit.returns, &(0..0));
    }
    found
}

/// Tokens as they are written, in one line.
fn written(code: &Code<'_>, range: &Range<usize>) -> String {
    let Some(last) = range.end.checked_sub(1) else {
        return String::new();
    };
    let text = &code.text[code.start(range.start)..code.end(last)];
    let parts: Vec<&str> = text.split_whitespace().collect();
    parts.join(" ")
}

fn words(code: &Code<'_>, range: &Range<usize>) -> String {
    let words: Vec<&str> = range.clone().map(|at| code.word(at)).collect();
    words.join(" ")
}

/// The elementary type behind these words, through the names of types.
fn resolved(
    code: &Code<'_>,
    kind: &Range<usize>,
    types: &Types<'_, '_>,
) -> Option<&'static Elementary> {
    let mut part = (code, kind.clone());
    // A chain of names that is longer than this is a circle.
    for _ in 0..20 {
        let (code, kind) = part;
        let is_plain = kind.len() == 1 || code.word(kind.start + 1) == "(";
        if !is_plain || !code.is_word(kind.start) {
            return None;
        }
        let known = ELEMENTARY.iter().find(|one| code.is(kind.start, one.name));
        if known.is_some() {
            return known;
        }
        let (code, kind) = types.get(&code.capitals(kind.start))?;
        part = (code, kind.clone());
    }
    None
}

/// The value of a literal: a number, TRUE or FALSE, or the milliseconds of a TIME.
fn literal(words: &str) -> Option<f64> {
    let text = words.replace([' ', '_'], "").to_ascii_uppercase();
    match text.as_str() {
        "TRUE" | "BOOL#TRUE" => return Some(1.0),
        "FALSE" | "BOOL#FALSE" => return Some(0.0),
        _ => {}
    }
    if let Ok(time) = milliseconds(words) {
        return Some(f64::from(time));
    }
    let number = match text.split_once('#') {
        Some((kind, rest)) if kind.starts_with(|c: char| c.is_ascii_alphabetic()) => rest,
        _ => &text,
    };
    let radix = |prefix: &str, radix| {
        let digits = number.strip_prefix(prefix)?;
        let number = u32::from_str_radix(digits, radix).ok()?;
        Some(f64::from(number))
    };
    radix("16#", 16)
        .or_else(|| radix("8#", 8))
        .or_else(|| radix("2#", 2))
        .or_else(|| number.parse().ok())
}

pub(crate) fn is_among(names: &[String], name: &str) -> bool {
    names.iter().any(|one| one.eq_ignore_ascii_case(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_have_their_value() {
        for (text, value) in [
            ("TRUE", Some(1.0)),
            ("- 5", Some(-5.0)),
            ("1_000", Some(1000.0)),
            ("16#FF", Some(255.0)),
            ("INT#-5", Some(-5.0)),
            ("BYTE#2#101", Some(5.0)),
            ("1.5E3", Some(1500.0)),
            ("T#1s500ms", Some(1500.0)),
            ("T#0s", None),
            ("Other", None),
        ] {
            assert_eq!(literal(text), value, "{text}");
        }
    }
}
