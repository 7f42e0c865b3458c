//! A condition on one signal.

use std::fmt;

use super::measure::{check_unit, split};
use tickbus_base::Mistake;
use tickbus_base::toml_text::{did_you_mean, nearest, short_number, shown};
use tickbus_image::signal::section::value_limits;
use tickbus_image::signal::{DataType, Signal, SignalTable, Slot};

/// A condition on one signal: `LA1 position >= 120 mm`, `LA1 run == 1`, or a BOOL alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// The condition as written.
    text: String,
    signal: usize,
    relation: Relation,
    number: Number,
    /// Numbers that differ by at most this much count as equal: a scaled value hardly ever equals a number exactly.
    tolerance: f64,
}

/// The number that a slot is compared with, of the slot's type.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Number {
    Real(f64),
    Signed(i128),
    Unsigned(i128),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Relation {
    Equal,
    Unequal,
    Less,
    AtMost,
    Greater,
    AtLeast,
}

impl Relation {
    const SIGNS: [(&'static str, Self); 6] = [
        ("==", Self::Equal),
        ("!=", Self::Unequal),
        ("<", Self::Less),
        ("<=", Self::AtMost),
        (">", Self::Greater),
        (">=", Self::AtLeast),
    ];
}

const SHAPE: &str = "write a signal, a sign and a number, such as \"LA1 position > 120\"";

impl Condition {
    /// Reads a condition on a signal of `table`.
    ///
    /// # Errors
    ///
    /// The condition is wrong; the message says why, and has the remedy.
    pub fn parse(text: &str, table: &SignalTable) -> Result<Self, Mistake> {
        let text = text.trim();
        let position = |name: &str| table.position(name);
        // A name may contain a comparison operator.
        if let Some(signal) = position(text) {
            return Self::of_bool(text, signal, &table.signals[signal]);
        }
        let is_sign = |c: char| matches!(c, '<' | '>' | '=' | '!');
        let Some(end) = text.rfind(is_sign).map(|at| at + 1) else {
            return Err(unknown(text, table));
        };
        let (head, right) = text.split_at(end);
        let name = head.trim_end_matches(is_sign);
        let (sign, name) = (&head[name.len()..], name.trim());
        let relation = Relation::SIGNS.iter().find(|(known, _)| *known == sign);
        let Some((_, relation)) = relation else {
            let signs = Relation::SIGNS.map(|(sign, _)| sign).join(" ");
            return Err(Mistake::new(
                format!("\"{}\" is no sign of comparison", shown(sign)),
                format!("signs are {signs}"),
            ));
        };
        let Some(index) = position(name) else {
            return Err(unknown(name, table));
        };
        let signal = &table.signals[index];
        let (number, real) = number_of(right, signal)?;
        let condition = Self {
            text: text.to_owned(),
            signal: index,
            relation: *relation,
            number,
            tolerance: signal.scale.map_or(0.0, |scale| scale.gain.abs() / 2.0),
        };
        condition.check_reach(real, signal)?;
        Ok(condition)
    }

    fn of_bool(text: &str, index: usize, signal: &Signal) -> Result<Self, Mistake> {
        if signal.data_type != DataType::Bool {
            return Err(Mistake::new(
                format!(
                    "\"{}\" is no BOOL, and cannot be true by itself",
                    shown(text)
                ),
                format!("compare it, such as \"{} > 0\"", shown(text)),
            ));
        }
        Ok(Self {
            text: text.to_owned(),
            signal: index,
            relation: Relation::Unequal,
            number: Number::Real(0.0),
            tolerance: 0.0,
        })
    }

    /// Rejects a condition that can never become true, or never false.
    fn check_reach(&self, number: f64, signal: &Signal) -> Result<(), Mistake> {
        let (low, high) = value_limits(signal);
        let (number, tolerance) = (number, self.tolerance);
        let inside = number >= low - tolerance && number <= high + tolerance;
        let possible = match self.relation {
            Relation::Equal | Relation::Unequal => inside,
            Relation::Less | Relation::AtLeast => number > low && number <= high,
            Relation::Greater | Relation::AtMost => number >= low && number < high,
        };
        if possible {
            return Ok(());
        }
        let unit = signal.unit.as_deref().unwrap_or_default();
        let (low, high) = (short_number(low), short_number(high));
        Err(Mistake::new(
            format!("\"{}\" never changes", shown(&self.text)),
            format!(
                "\"{}\" ({}) goes from {low} to {high} {unit}",
                shown(&signal.name),
                signal.data_type
            )
            .trim_end()
            .to_owned(),
        ))
    }

    /// The index of the condition's signal.
    pub const fn signal(&self) -> usize {
        self.signal
    }

    /// Returns true if the condition holds.
    pub fn holds(&self, slots: &[Slot]) -> bool {
        let slot = slots[self.signal];
        let (less, equal) = match self.number {
            Number::Real(number) => {
                let value = slot.real();
                // NaN is neither equal nor unequal.
                let equal = (value - number).abs() <= self.tolerance;
                (value < number && !equal, equal)
            }
            Number::Signed(number) => {
                let value = i128::from(slot.signed());
                (value < number, value == number)
            }
            Number::Unsigned(number) => {
                let value = i128::from(slot.unsigned());
                (value < number, value == number)
            }
        };
        let known = !matches!(self.number, Number::Real(_)) || !slot.real().is_nan();
        known
            && match self.relation {
                Relation::Equal => equal,
                Relation::Unequal => !equal,
                Relation::Less => less,
                Relation::AtMost => less || equal,
                Relation::Greater => !less && !equal,
                Relation::AtLeast => !less,
            }
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// The number of a condition as its signal's slot would hold it, and as a double.
#[expect(
    clippy::cast_precision_loss,
    reason = "to be compared with the ends of ranges"
)]
fn number_of(text: &str, signal: &Signal) -> Result<(Number, f64), Mistake> {
    let text = text.trim();
    if signal.data_type == DataType::Bool
        && let Some(level) = match text {
            _ if text.eq_ignore_ascii_case("true") => Some(1.0),
            _ if text.eq_ignore_ascii_case("false") => Some(0.0),
            _ => None,
        }
    {
        return Ok((Number::Real(level), level));
    }
    if signal.is_integer_slot()
        && let Ok(whole) = text.parse::<i128>()
    {
        let number = if signal.data_type == DataType::Lint {
            Number::Signed(whole)
        } else {
            Number::Unsigned(whole)
        };
        return Ok((number, whole as f64));
    }
    let Some((number, unit)) = split(text) else {
        let what = if text.is_empty() {
            "the condition has no number".to_owned()
        } else {
            format!("\"{}\" is no number", shown(text))
        };
        return Err(Mistake::new(what, SHAPE.to_owned()));
    };
    check_unit(unit, signal)?;
    if signal.is_integer_slot() {
        return Err(Mistake::new(
            format!("\"{}\" takes whole numbers", shown(&signal.name)),
            "write it without a fraction and a unit",
        ));
    }
    Ok((Number::Real(number), number))
}

/// The mistake for a name that no signal of `table` has, with the remedy.
pub fn unknown(name: &str, table: &SignalTable) -> Mistake {
    const MOST: usize = 20;
    let names: Vec<&str> = table.signals.iter().map(|s| s.name.as_str()).collect();
    let what = if name.is_empty() {
        "no signal is named".to_owned()
    } else {
        format!("there is no signal \"{}\"", shown(name))
    };
    let right = if names.is_empty() {
        "write [[signal]] sections".to_owned()
    } else if names.len() > MOST && nearest(name, names.iter().copied()).is_none() {
        format!("name one of the {} [[signal]] sections", names.len())
    } else {
        did_you_mean(name, "signals", &names)
    };
    Mistake::new(what, right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::tests::table;

    fn holds(text: &str, slots: [f64; 4]) -> bool {
        let condition = Condition::parse(text, &table()).unwrap_or_else(|why| panic!("{why:?}"));
        let mut slots = slots.map(Slot::from_real);
        slots[3] = Slot::from_signed(-7);
        condition.holds(&slots)
    }

    #[test]
    fn every_sign_compares() {
        for (sign, below, equal, above) in [
            ("==", false, true, false),
            ("!=", true, false, true),
            ("<", true, false, false),
            ("<=", true, true, false),
            (">", false, false, true),
            (">=", false, true, true),
        ] {
            for (value, expected) in [(99.0, below), (100.0, equal), (101.0, above)] {
                let text = format!("level{sign}100 mm");
                assert_eq!(holds(&text, [0.0, value, 0.0, 0.0]), expected, "{text}");
                assert!(!holds(&text, [0.0, f64::NAN, 0.0, 0.0]), "{text}");
            }
        }
        // A scaled value matches a number within half a step.
        let step = 250.0 / 27_648.0;
        assert!(holds("level == 100", [0.0, 100.0 + step * 0.4, 0.0, 0.0]));
        assert!(!holds("level == 100", [0.0, 100.0 + step * 0.6, 0.0, 0.0]));
    }

    #[test]
    fn bits_and_whole_numbers_compare() {
        for (text, expected) in [
            ("run", true),
            ("run == 1", true),
            ("run == true", true),
            ("run == TRUE", true),
            ("run == False", false),
            ("run == false", false),
            ("run != 0", true),
            ("a = b > c", false),
            ("a = b > c == 0", true),
            ("whole == -7", true),
            ("whole < -6", true),
            ("whole > 1000000", false),
        ] {
            assert_eq!(holds(text, [1.0, 0.0, 0.0, 0.0]), expected, "{text}");
        }
    }

    #[test]
    fn what_is_no_condition_is_refused() {
        for (text, what) in [
            ("", "no signal is named; signals are run"),
            (
                "rnu == 1",
                "there is no signal \"rnu\"; did you mean \"run\"?",
            ),
            ("level", "\"level\" is no BOOL"),
            ("level = 5", "\"=\" is no sign of comparison; signs are =="),
            ("level => 5", "\"=>\" is no sign of comparison"),
            ("level >", "the condition has no number"),
            ("level > high", "\"high\" is no number"),
            ("level > 5 cm", "\"level\" is in mm, not in cm"),
            ("run == 1 V", "\"run\" has no unit"),
            ("run == 2", "\"run == 2\" never changes"),
            (
                "level > 300",
                "\"level > 300\" never changes; \"level\" (INT) goes from -296.",
            ),
            ("level < -297", "never changes"),
            ("whole == 0.5", "\"whole\" takes whole numbers"),
        ] {
            let told = Condition::parse(text, &table())
                .expect_err(text)
                .to_string();
            assert!(
                told.starts_with(what) || told.contains(what),
                "{text}: {told}"
            );
        }
    }
}
