//! Conditions on signals and values of signals, as texts and tables write them.

use tickbus_base::toml_text::{Value, shown};
use tickbus_fieldbus::faults::unknown;
use tickbus_image::signal::section::slot_of;
use tickbus_image::signal::{Area, SignalTable, Slot};

use crate::{Condition, Demand};

/// The advice where conditions are expected.
const CONDITIONS: &str =
    "write a condition such as \"Ready lamp\", a list of them, or { \"Phase\" = 3 }";

/// The signals that values and conditions name.
#[derive(Clone, Copy, Debug)]
pub struct Signals<'t> {
    /// The signals.
    pub table: &'t SignalTable,
    /// The area that the machine writes.
    pub writes: Area,
}

impl Signals<'_> {
    /// A signal that the machine writes, by its name.
    pub fn settable(&self, value: &Value<'_>, name: &str) -> Option<usize> {
        let Some(index) = self.table.position(name) else {
            value.refuse(unknown(name, self.table));
            return None;
        };
        let signal = &self.table.signals[index];
        if signal.area != self.writes {
            value.wrong(
                format!(
                    "\"{}\" ({}) is written by the PLC program",
                    shown(name),
                    signal.address()
                ),
                "set signals that it reads; the others can be conditions",
            );
            return None;
        }
        Some(index)
    }

    /// `{ "Start button" = true }`: signals and their values. Each comes with its place.
    pub fn placed_assignments<'a>(
        &self,
        value: Option<&Value<'a>>,
    ) -> Option<Vec<(usize, Slot, Value<'a>)>> {
        let Some(value) = value else {
            return Some(Vec::new());
        };
        let table = value.table(
            "signals",
            "write signals and values, such as { \"Start button\" = true }",
        )?;
        let assignment = |(name, value): (&str, Value<'a>)| {
            let index = self.settable(&value, name)?;
            let slot = slot_of(&value, &self.table.signals[index], "the value")?;
            Some((index, slot, value))
        };
        let read: Vec<_> = table.all().map(assignment).collect();
        read.into_iter().collect()
    }

    /// As [`placed_assignments`](Self::placed_assignments), without the places.
    pub fn assignments(&self, value: Option<&Value<'_>>) -> Option<Vec<(usize, Slot)>> {
        let placed = self.placed_assignments(value)?.into_iter();
        Some(placed.map(|(signal, slot, _)| (signal, slot)).collect())
    }

    /// A condition, a list of them, or a table of signals and values; each with its place. `condition` reads one that
    /// is a text.
    pub fn conditions<'a>(
        &self,
        value: &Value<'a>,
        condition: impl Fn(&Value<'a>) -> Option<Condition>,
    ) -> Option<Vec<(Condition, Value<'a>)>> {
        let read: Vec<Option<_>> = if value.is_table() {
            let table = value.table("signals", CONDITIONS)?;
            table
                .all()
                .map(|(name, value)| self.equality(name, value))
                .collect()
        } else {
            let texts = texts(value)?.into_iter();
            texts
                .map(|value| Some((condition(&value)?, value)))
                .collect()
        };
        read.into_iter().collect()
    }

    /// A condition that is a text.
    pub fn condition(&self, value: &Value<'_>) -> Option<Condition> {
        let text = value.text("write a condition in quotes, such as \"Phase == 3\"")?;
        let condition = Condition::parse(text, self.table);
        condition.map_err(|mistake| value.refuse(mistake)).ok()
    }

    /// Reads `"Phase" = 3` among conditions.
    fn equality<'a>(&self, name: &str, value: Value<'a>) -> Option<(Condition, Value<'a>)> {
        let Some(signal) = self.table.position(name) else {
            value.refuse(unknown(name, self.table));
            return None;
        };
        let slot = slot_of(&value, &self.table.signals[signal], "the value")?;
        let demand = Demand::equal(slot, &self.table.signals[signal]);
        Some((Condition { signal, demand }, value))
    }
}

/// A text, or those of a list.
pub fn texts<'v>(value: &Value<'v>) -> Option<Vec<Value<'v>>> {
    if value.as_text().is_some() {
        return Some(vec![value.clone()]);
    }
    let list = value.list(CONDITIONS)?;
    if list.is_empty() {
        value.wrong("an empty list demands nothing", CONDITIONS);
        return None;
    }
    Some(list)
}
