//! Conditions on signals: of replies, and of test files.

use std::fmt;

use tickbus_base::Mistake;
use tickbus_base::toml_text::{short_number, shown};
use tickbus_fieldbus::faults::{self, unknown};
use tickbus_image::signal::{DataType, Signal, SignalTable, Slot};

use super::signal::real;

/// A condition on one signal: any condition that a fault can have, or one that faults do not have.
///
/// | text | holds when |
/// |---|---|
/// | `NAME`, `not NAME` | the signal is on, is off |
/// | `NAME == 3`, `!=`, `<`, `<=`, `>`, `>=` | the comparison is true |
/// | `NAME == 120 ± 0.5` (or `+- 0.5`) | the value is within the tolerance |
/// | `NAME rises`, `NAME falls` | it has switched on, off, since the wait began |
/// | `NAME changes` | its value has changed since the wait began |
#[derive(Clone, Debug, PartialEq)]
pub struct Condition {
    /// Index of the signal in the table.
    pub signal: usize,
    /// The condition itself.
    pub demand: Demand,
}

/// A condition, without its signal.
#[derive(Clone, Debug, PartialEq)]
pub enum Demand {
    /// The value is not 0.
    On,
    /// The value is 0.
    Off,
    /// The comparison in the text is true.
    Compares(faults::Condition, String),
    /// The value differs from the first number by at most the second.
    Near(f64, f64),
    /// The value is a 64-bit integer with these bits; the number is the nearest double.
    Is(Slot, f64),
    /// The value has changed from 0 to another one since the wait began.
    Rises,
    /// The value has changed to 0 since the wait began.
    Falls,
    /// The value has changed since the wait began.
    Changes,
}

impl Condition {
    /// Reads a condition on a signal of `table`.
    ///
    /// # Errors
    ///
    /// The signal or the number to compare with is invalid; the message has the remedy.
    pub fn parse(text: &str, table: &SignalTable) -> Result<Self, Mistake> {
        let text = text.trim();
        if let Some(signal) = table.position(text) {
            return bit(signal, Demand::On, table);
        }
        let ending = |ending, demand| Some((text.strip_suffix(ending)?.trim(), demand));
        let special = text
            .strip_prefix("not ")
            .map(|name| (name.trim(), Demand::Off))
            .or_else(|| ending(" rises", Demand::Rises))
            .or_else(|| ending(" falls", Demand::Falls))
            .or_else(|| ending(" changes", Demand::Changes));
        match special.map(|(name, demand)| (table.position(name), name, demand)) {
            Some((Some(signal), _, Demand::Off)) => return bit(signal, Demand::Off, table),
            Some((Some(signal), _, demand)) => return Ok(Self { signal, demand }),
            Some((None, name, _)) if !name.contains(['<', '>', '=']) => {
                return Err(unknown(name, table));
            }
            _ => {}
        }
        // A name may contain the signs.
        let number = text.rfind(['<', '>', '=']).map_or(text.len(), |at| at + 1);
        let around = ["±", "+-"].iter().find_map(|sign| {
            let at = number + text[number..].find(sign)?;
            Some((&text[..at], &text[at + sign.len()..]))
        });
        if let Some((comparison, tolerance)) = around {
            return near(comparison, tolerance, table);
        }
        Self::compares(text, table)
    }

    fn compares(text: &str, table: &SignalTable) -> Result<Self, Mistake> {
        let condition = faults::Condition::parse(text, table)?;
        let signal = condition.signal();
        if table.signals[signal].data_type == DataType::Bool {
            let mut on = vec![Slot::default(); table.signals.len()];
            on[signal] = Slot::from_real(1.0);
            let demand = if condition.holds(&on) {
                Demand::On
            } else {
                Demand::Off
            };
            return Ok(Self { signal, demand });
        }
        let words = text.strip_prefix(table.signals[signal].name.as_str());
        let words = words.unwrap_or(text).trim();
        let words = words.strip_prefix("==").unwrap_or(words).trim().to_owned();
        let demand = Demand::Compares(condition, words);
        Ok(Self { signal, demand })
    }

    /// Returns true if the condition holds for a signal with this value, which is one of the slots. A condition on an
    /// edge never holds for a value.
    pub fn holds_for(&self, value: f64, slots: &[Slot]) -> bool {
        match &self.demand {
            Demand::On => value != 0.0,
            Demand::Off => value == 0.0,
            Demand::Near(number, tolerance) => (value - number).abs() <= *tolerance,
            Demand::Is(slot, _) => slots[self.signal] == *slot,
            Demand::Compares(condition, _) => condition.holds(slots),
            Demand::Rises | Demand::Falls | Demand::Changes => false,
        }
    }

    /// Returns true if the condition is about an edge, and a signal has it that goes from one slot to the next; each
    /// slot with its value.
    pub fn holds_between(&self, before: (Slot, f64), now: (Slot, f64)) -> bool {
        match self.demand {
            Demand::Rises => before.1 == 0.0 && now.1 != 0.0,
            Demand::Falls => before.1 != 0.0 && now.1 == 0.0,
            Demand::Changes => before.0 != now.0,
            _ => false,
        }
    }

    /// Returns true if the condition is about an edge, not a level.
    pub const fn is_edge(&self) -> bool {
        matches!(self.demand, Demand::Rises | Demand::Falls | Demand::Changes)
    }
}

impl Demand {
    /// The condition that the signal has the value of this slot, within the resolution of its type.
    pub fn equal(slot: Slot, signal: &Signal) -> Self {
        let number = real(slot, signal);
        match signal.data_type {
            DataType::Bool if number == 0.0 => Self::Off,
            DataType::Bool => Self::On,
            _ if signal.is_integer_slot() => Self::Is(slot, number),
            _ => Self::Near(
                number,
                signal.scale.map_or(0.0, |scale| scale.gain.abs() / 2.0),
            ),
        }
    }
}

/// Writes the expectation without the signal's name: `on`, `> 3`.
impl fmt::Display for Demand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::On => f.write_str("on"),
            Self::Off => f.write_str("off"),
            Self::Compares(_, words) => f.write_str(words),
            Self::Near(number, tolerance) if *tolerance == 0.0 => {
                f.write_str(&short_number(*number))
            }
            Self::Near(number, tolerance) => {
                write!(
                    f,
                    "{} ± {}",
                    short_number(*number),
                    short_number(*tolerance)
                )
            }
            Self::Is(_, number) => f.write_str(&short_number(*number)),
            Self::Rises => f.write_str("a rising edge"),
            Self::Falls => f.write_str("a falling edge"),
            Self::Changes => f.write_str("a change"),
        }
    }
}

/// A condition that only applies to a BOOL.
fn bit(signal: usize, demand: Demand, table: &SignalTable) -> Result<Condition, Mistake> {
    // The faults' conditions have the error for other types.
    faults::Condition::parse(&table.signals[signal].name, table)?;
    Ok(Condition { signal, demand })
}

/// `NAME == 120 ± 0.5`, cut at its sign.
fn near(comparison: &str, tolerance: &str, table: &SignalTable) -> Result<Condition, Mistake> {
    let condition = Condition::compares(comparison.trim(), table)?;
    let Some((_, number)) = comparison.rsplit_once("==") else {
        return Err(Mistake::new(
            "a tolerance stands at a sign other than ==",
            "write == for it, or leave the tolerance out",
        ));
    };
    let name = &table.signals[condition.signal].name;
    let parsed = |text: &str| {
        let number = text.trim().parse::<f64>().ok();
        let wrong = || {
            Mistake::new(
                format!("\"{}\" is no number", shown(text.trim())),
                format!("write such as \"{} == 120 ± 0.5\"", shown(name)),
            )
        };
        number.filter(|number| number.is_finite()).ok_or_else(wrong)
    };
    let (middle, tolerance) = (parsed(number)?, parsed(tolerance)?);
    if tolerance < 0.0 {
        return Err(Mistake::new(
            format!("a tolerance of {tolerance} lets nothing through"),
            "write 0 or more",
        ));
    }
    Ok(Condition {
        signal: condition.signal,
        demand: Demand::Near(middle, tolerance),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_image::signal::Area;

    fn table() -> SignalTable {
        let on = |name: &str, bit| Signal {
            bit,
            ..Signal::new(name, Area::Input, 0, DataType::Bool)
        };
        let height = Signal {
            unit: Some("mm".to_owned()),
            ..Signal::new("Height", Area::Output, 2, DataType::Int)
        };
        let pos = Signal::new("Pos +- 5", Area::Output, 4, DataType::Int);
        let signals = vec![on("Not OK", 0), on("Level >= 3", 1), height, pos];
        SignalTable::of_one_station(1, 6, signals)
    }

    #[test]
    fn conditions_read_as_they_are_written() {
        let table = table();
        for (text, signal, demand) in [
            ("Not OK", 0, "on"),
            (" not Not OK", 0, "off"),
            ("Not OK == 1", 0, "on"),
            ("Not OK == false", 0, "off"),
            ("Not OK != 1", 0, "off"),
            ("Not OK rises", 0, "a rising edge"),
            ("Not OK falls", 0, "a falling edge"),
            ("Height changes", 2, "a change"),
            ("Level >= 3", 1, "on"),
            ("Level >= 3 == 0", 1, "off"),
            ("not Level >= 3", 1, "off"),
            ("Height > 3", 2, "> 3"),
            ("Height<=-2.5 mm", 2, "<=-2.5 mm"),
            ("Height == 7", 2, "7"),
            ("Height == 120 ± 0.5", 2, "120 ± 0.5"),
            ("Height == 120 +- 0.5", 2, "120 ± 0.5"),
            ("Pos +- 5 > 3", 3, "> 3"),
            ("Pos +- 5 == 3 ± 0.5", 3, "3 ± 0.5"),
        ] {
            let read = Condition::parse(text, &table).expect(text);
            assert_eq!(
                (read.signal, read.demand.to_string()),
                (signal, demand.to_owned()),
                "{text}"
            );
        }
    }

    #[test]
    fn what_cannot_be_is_refused_with_what_can() {
        let table = table();
        for (text, told) in [
            (
                "Heigth > 3",
                "there is no signal \"Heigth\"; did you mean \"Height\"?",
            ),
            (
                "not Heigth",
                "there is no signal \"Heigth\"; did you mean \"Height\"?",
            ),
            (
                "Heigth rises",
                "there is no signal \"Heigth\"; did you mean \"Height\"?",
            ),
            (
                "Heigth changes",
                "there is no signal \"Heigth\"; did you mean \"Height\"?",
            ),
            (
                "",
                "no signal is named; signals are Not OK, Level >= 3, Height, Pos +- 5",
            ),
            (
                "not Height",
                "\"Height\" is no BOOL, and cannot be true by itself; compare it, such as \"Height > 0\"",
            ),
            (
                "Not OK > 1",
                "\"Not OK > 1\" never changes; \"Not OK\" (BOOL) goes from 0 to 1",
            ),
            (
                "Height == 40000",
                "\"Height == 40000\" never changes; \"Height\" (INT) goes from -32768 to 32767 mm",
            ),
            (
                "Height == 1 ± -2",
                "a tolerance of -2 lets nothing through; write 0 or more",
            ),
            (
                "Height == 1 ± x",
                "\"x\" is no number; write such as \"Height == 120 ± 0.5\"",
            ),
            (
                "Height > 1 ± 2",
                "a tolerance stands at a sign other than ==; write == for it, or leave the tolerance out",
            ),
        ] {
            let mistake = Condition::parse(text, &table).expect_err(text);
            assert_eq!(mistake.to_string(), told);
        }
    }
}
