//! Progress: the changes of those values by which one run is compared with another.

use std::fmt::Write as _;

use crate::edges::Bookmark;
use crate::watch::{Watch, real, text_of};
use tickbus_image::signal::{Area, DataType, Signal, SignalTable, Slot};
use tickbus_reply::Condition;

/// A value whose changes are progress.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Mark {
    /// The value of the signal with this index.
    Value(usize),
    /// A condition, as 1 while it holds and else 0; the text is the condition as written.
    Holds(Condition, String),
}

impl Mark {
    /// All signals of the PLC that take values one by one: a scaled or real value moves differently in each run.
    /// `of_machine` is the area that the machine writes.
    pub(crate) fn usual(table: &SignalTable, of_machine: Area) -> Vec<Self> {
        let signals = table.signals.iter().enumerate();
        let counts = |signal: &Signal| {
            let is_real = matches!(signal.data_type, DataType::Real | DataType::Lreal);
            signal.area != of_machine && !is_real && signal.scale.is_none()
        };
        let counted = signals.filter(|(_, signal)| counts(signal));
        counted.map(|(index, _)| Self::Value(index)).collect()
    }

    fn value(&self, watches: &[Watch], slots: &[Slot]) -> Slot {
        match self {
            Self::Value(signal) => slots[*signal],
            Self::Holds(condition, _) => {
                let watch = &watches[condition.signal];
                let holds = Bookmark::default().finds(condition, watch, slots);
                Slot::from_real(f64::from(u8::from(holds)))
            }
        }
    }

    /// `"Step" is 3`, or `is not` with the negation.
    fn say(&self, verb: &str, slot: Slot, signals: &[Signal]) -> String {
        match self {
            Self::Value(signal) => {
                let signal = &signals[*signal];
                format!(
                    "\"{}\" {verb} {}",
                    signal.name,
                    text_of(real(slot, signal), signal)
                )
            }
            Self::Holds(_, text) => {
                let truth = if slot.real() == 0.0 { "false" } else { "true" };
                format!("\"{text}\" {verb} {truth}")
            }
        }
    }
}

/// One change of the marks: their values from this tick on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Change {
    pub(crate) tick: u64,
    pub(crate) values: Vec<Slot>,
}

/// The values of marks, from tick to tick.
#[derive(Clone, Debug, Default)]
pub(crate) struct Progress {
    pub(crate) values: Vec<Slot>,
    /// The values of the tick before.
    pub(crate) before: Vec<Slot>,
}

impl Progress {
    /// Takes over the values of this tick. Returns true if one has changed.
    pub(crate) fn look(&mut self, marks: &[Mark], watches: &[Watch], slots: &[Slot]) -> bool {
        if self.values.is_empty() {
            let values = marks.iter().map(|mark| mark.value(watches, slots));
            self.values.extend(values);
            return true;
        }
        self.before.clone_from(&self.values);
        let mut changed = false;
        for (mark, kept) in marks.iter().zip(&mut self.values) {
            let value = mark.value(watches, slots);
            changed |= *kept != value;
            *kept = value;
        }
        changed
    }

    /// The first mark whose value is not that of `other`, in words: `"Step" is 3`, and what it is in the other.
    pub(crate) fn difference(
        &self,
        verb: &str,
        other: &[Slot],
        (marks, signals): (&[Mark], &[Signal]),
    ) -> Option<(String, String)> {
        let pairs = marks.iter().zip(self.values.iter().zip(other));
        let mut differing = pairs.filter(|(_, (here, there))| here != there);
        let (mark, (here, there)) = differing.next()?;
        let mut words = mark.say(verb, *here, signals);
        let there = mark.say("", *there, signals);
        let there = there
            .rsplit_once("\" ")
            .map_or("", |(_, value)| value.trim());
        let more = differing.count();
        if more > 0 {
            let _ = write!(words, " (and {more} more)");
        }
        Some((words, there.to_owned()))
    }
}
