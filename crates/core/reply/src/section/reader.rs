//! Reads the values of a section.
#![expect(
    clippy::option_option,
    reason = "a value can be wrong, and a key can be absent"
)]

use std::cell::{Cell, RefCell};

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Table, Value, short_number, shown};
use tickbus_fieldbus::faults::unknown;
use tickbus_image::signal::section::{pair_of, value_limits};
use tickbus_image::signal::{DataType, Signal};

use super::Scope;
use super::rule::RuleKeys;
use super::signals::Signals;
use crate::Condition;
use crate::levels::Levels;
use crate::rule::{Course, Ruled};
use crate::signal::{Form, Input, Output};

/// The advice where the name of a signal is expected.
const NAME: &str = "write the name of a signal in quotes";

/// The greatest number of tables in a list of a reply.
pub(super) const LIST_LIMIT: usize = 64;

/// The greatest count: doubles have all whole numbers up to it.
const MOST: f64 = 9_007_199_254_740_991.0;

/// The keys of a section. Each getter reports its mistakes and returns `None` for a wrong value, and `Some(None)` for a
/// key that is not there.
pub(super) struct Reader<'a> {
    values: Vec<(&'static str, Value<'a>)>,
    /// The list in which the section is a table, if it is one.
    at: Option<Value<'a>>,
    scope: Scope<'a>,
    inputs: RefCell<Vec<usize>>,
    outputs: RefCell<Vec<(usize, Value<'a>)>>,
    shortest: Cell<Option<Nanos>>,
}

/// The signals that a reply reads, those that it makes with their places, and its shortest time.
type Used<'a> = (Vec<usize>, Vec<(usize, Value<'a>)>, Option<Nanos>);

impl<'a> Reader<'a> {
    pub(super) fn new(values: Vec<(&'static str, Value<'a>)>, scope: Scope<'a>) -> Self {
        Self {
            values,
            at: None,
            scope,
            inputs: RefCell::default(),
            outputs: RefCell::default(),
            shortest: Cell::default(),
        }
    }

    /// Ends reading.
    pub(super) fn finish(self) -> Used<'a> {
        let mut inputs = self.inputs.into_inner();
        inputs.sort_unstable();
        inputs.dedup();
        (inputs, self.outputs.into_inner(), self.shortest.get())
    }

    pub(super) fn all(&self) -> &[(&'static str, Value<'a>)] {
        &self.values
    }

    pub(super) fn get(&self, key: &str) -> Option<&Value<'a>> {
        let found = self.values.iter().find(|(name, _)| *name == key);
        found.map(|(_, value)| value)
    }

    pub(super) fn read<T>(
        &self,
        key: &str,
        read: impl FnOnce(&Value<'a>) -> Option<T>,
    ) -> Option<Option<T>> {
        match self.get(key) {
            None => Some(None),
            Some(value) => read(value).map(Some),
        }
    }

    pub(super) fn signal(&self, signal: usize) -> &'a Signal {
        &self.scope.table.signals[signal]
    }

    fn position(&self, value: &Value<'a>) -> Option<usize> {
        let name = value.text(NAME)?;
        let found = self.scope.table.position(name);
        if found.is_none() {
            value.refuse(unknown(name, self.scope.table));
        }
        found
    }

    /// A signal that the reply makes.
    pub(super) fn output(&self, key: &str) -> Option<Option<Output>> {
        self.read(key, |value| {
            let index = self.position(value)?;
            let signal = self.signal(index);
            if signal.area != self.scope.writes {
                value.wrong(
                    format!(
                        "\"{}\" ({}) is written by the PLC program",
                        shown(&signal.name),
                        signal.address()
                    ),
                    "name a signal that it reads",
                );
                return None;
            }
            self.outputs.borrow_mut().push((index, value.clone()));
            Output::new(index, Form::of(signal))
        })
    }

    /// A BOOL that the reply makes.
    pub(super) fn bit(&self, key: &str) -> Option<Option<Output>> {
        let Some(output) = self.output(key)? else {
            return Some(None);
        };
        let signal = self.signal(output.signal());
        if signal.data_type == DataType::Bool {
            return Some(Some(output));
        }
        self.wrong(
            key,
            format!(
                "\"{}\" ({}) is no BOOL",
                shown(&signal.name),
                signal.data_type
            ),
            "name a BOOL here",
        )
    }

    /// A number that the reply makes.
    pub(super) fn number_made(&self, key: &str) -> Option<Option<Output>> {
        let Some(output) = self.output(key)? else {
            return Some(None);
        };
        let signal = self.signal(output.signal());
        if signal.data_type != DataType::Bool {
            return Some(Some(output));
        }
        self.wrong(
            key,
            format!("\"{}\" is a BOOL, and no number", shown(&signal.name)),
            "name a signal of another type here",
        )
    }

    /// A signal whose number the reply reads; a BOOL only if `bits` are allowed.
    pub(super) fn input(&self, key: &str, bits: bool) -> Option<Option<Input>> {
        self.read(key, |value| {
            let index = self.position(value)?;
            let signal = self.signal(index);
            if signal.data_type == DataType::Bool && !bits {
                value.wrong(
                    format!("\"{}\" is a BOOL, and no number", shown(&signal.name)),
                    "name a signal of another type here",
                );
                return None;
            }
            self.inputs.borrow_mut().push(index);
            Some(Input {
                signal: index,
                form: Form::of(signal),
            })
        })
    }

    /// Conditions that must hold together.
    pub(super) fn levels(&self, key: &str) -> Option<Option<Levels>> {
        self.read(key, |value| {
            let signals = self.signals();
            let read = signals.conditions(value, |value| signals.condition(value))?;
            let read: Vec<_> = (read.into_iter())
                .map(|(condition, value)| self.level(condition, &value))
                .collect();
            Some(Levels::new(read.into_iter().collect::<Option<_>>()?))
        })
    }

    /// The signals that conditions and values name.
    fn signals(&self) -> Signals<'a> {
        Signals {
            table: self.scope.table,
            writes: self.scope.writes,
        }
    }

    /// The keys of a rule.
    pub(super) fn rule(&self) -> Option<Ruled> {
        let keys = RuleKeys {
            when: self.get("when"),
            after: self.get("after"),
            set: self.get("set"),
            otherwise: self.get("else"),
            ramp: self.get("ramp"),
        };
        let after = self.time("after");
        let signals = self.signals();
        let condition = |value: &Value<'a>| signals.condition(value);
        let (rule, made) = keys.read(signals, condition, |_| after.flatten())?;
        let inputs = rule.when.iter().map(|condition| condition.signal);
        let forms = rule.when.iter();
        let forms = forms.map(|condition| Form::of(self.signal(condition.signal)));
        self.inputs.borrow_mut().extend(inputs);
        let ruled = Ruled {
            forms: forms.collect(),
            before: vec![None; rule.when.len()],
            course: Course::default(),
            rule,
        };
        self.outputs.borrow_mut().extend(made);
        Some(ruled)
    }

    fn level(&self, condition: Condition, value: &Value<'a>) -> Option<(Condition, Form)> {
        if condition.is_edge() {
            value.wrong(
                "a reply waits for no edge, which is over at once",
                "write the condition without \"rises\", \"falls\" or \"changes\"; a counter counts how often it begins to hold",
            );
            return None;
        }
        self.inputs.borrow_mut().push(condition.signal);
        let form = Form::of(self.signal(condition.signal));
        Some((condition, form))
    }

    /// A time; not shorter than a tick.
    pub(super) fn time(&self, key: &str) -> Option<Option<Nanos>> {
        self.read(key, |value| {
            let span = match self.scope.tick {
                None => value.duration(),
                Some(tick) => value.duration_from(
                    tick,
                    &format!("a tick is {tick}: a reply is made once in each"),
                ),
            }?;
            let before = self.shortest.get().unwrap_or(span);
            self.shortest.set(Some(before.min(span)));
            Some(span)
        })
    }

    pub(super) fn flag(&self, key: &str) -> Option<bool> {
        self.read(key, Value::boolean)
            .map(Option::unwrap_or_default)
    }

    pub(super) fn number(&self, key: &str) -> Option<Option<f64>> {
        self.read(key, |value| value.number("write a number"))
    }

    /// A number that is not negative, 0 by default.
    pub(super) fn amount(&self, key: &str) -> Option<f64> {
        let amount = self.number(key)?.unwrap_or(0.0);
        if amount < 0.0 {
            let written = self.get(key).map(Value::written).unwrap_or_default();
            return self.wrong(key, format!("\"{key}\" is {written}"), "write 0 or more");
        }
        Some(amount)
    }

    /// A number above 0.
    pub(super) fn above_zero(&self, key: &str) -> Option<Option<f64>> {
        let number = self.number(key)?;
        if number.is_some_and(|number| number <= 0.0) {
            let written = self.get(key).map(Value::written).unwrap_or_default();
            return self.wrong(key, format!("\"{key}\" is {written}"), "write more than 0");
        }
        Some(number)
    }

    /// A list of numbers, at least one.
    pub(super) fn numbers(&self, key: &str) -> Option<Vec<f64>> {
        const RIGHT: &str = "write a list of numbers, such as [40, 80]";
        let value = self.get(key)?;
        let list = value.list(RIGHT)?;
        if list.is_empty() {
            value.wrong("an empty list has no number", RIGHT);
            return None;
        }
        let numbers: Vec<_> = list.iter().map(|value| value.number(RIGHT)).collect();
        numbers.into_iter().collect()
    }

    /// Reads each table of a list, which has these keys.
    pub(super) fn each<T>(
        &self,
        key: &str,
        keys: &[&'static str],
        read: impl Fn(&Self) -> Option<T>,
    ) -> Option<Option<Vec<T>>> {
        let Some(value) = self.get(key) else {
            return Some(None);
        };
        let tables = value.tables(key);
        if tables.is_empty() || tables.len() > LIST_LIMIT {
            value.wrong(
                format!("\"{key}\" has {} tables", tables.len()),
                format!("write 1 to {LIST_LIMIT} tables, such as {key} = [{{ … }}]"),
            );
            return None;
        }
        let one = |mut table: Table<'a>| {
            let values = keys
                .iter()
                .filter_map(|key| Some((*key, table.take(key)?)))
                .collect();
            let at = value.clone();
            table.finish();
            let inner = Self {
                at: Some(at),
                ..Self::new(values, self.scope)
            };
            let made = read(&inner);
            let (inputs, outputs, _) = inner.finish();
            self.inputs.borrow_mut().extend(inputs);
            self.outputs.borrow_mut().extend(outputs);
            made
        };
        let read: Vec<_> = tables.into_iter().map(one).collect();
        read.into_iter().collect::<Option<_>>().map(Some)
    }

    /// Reports that a table of a list has no `key`.
    pub(super) fn require(&self, key: &str) -> Option<()> {
        self.needs_one_of(&[key], &format!("add \"{key}\" to each table"))
    }

    /// Reports that a table of a list has none of these keys.
    pub(super) fn needs_one_of(&self, keys: &[&str], right: &str) -> Option<()> {
        if keys.iter().any(|key| self.get(key).is_some()) {
            return Some(());
        }
        let place = self.values.first().map(|(_, value)| value);
        if let Some(value) = place.or(self.at.as_ref()) {
            value.wrong(
                format!("this table has no \"{}\"", keys.join("\" and no \"")),
                right,
            );
        }
        None
    }

    /// The key `limits`, within what `signal` can have; `usual` without it.
    pub(super) fn limits(&self, signal: Option<usize>, usual: [f64; 2]) -> Option<[f64; 2]> {
        let stated = self.read("limits", |value| {
            let [(low, _), (high, _)] = pair_of(value, "write two numbers, such as [0, 100]")?;
            if low >= high {
                let (low, high) = (short_number(low), short_number(high));
                value.wrong(
                    format!("\"limits\" go from {low} to {high}"),
                    "write the lower one first, such as [0, 100]",
                );
                return None;
            }
            Some([low, high])
        })?;
        let limits = stated.unwrap_or(usual);
        let Some(signal) = signal.map(|signal| self.signal(signal)) else {
            return Some(limits);
        };
        let (least, greatest) = value_limits(signal);
        if limits[0] < least || limits[1] > greatest {
            let (low, high) = (short_number(least), short_number(greatest));
            let key = if stated.is_some() { "limits" } else { "kind" };
            let [from, to] = limits.map(short_number);
            return self.wrong(
                key,
                format!("\"{}\" cannot go from {from} to {to}", shown(&signal.name)),
                format!(
                    "write limits within {low} and {high}, what a {} can have",
                    signal.data_type
                ),
            );
        }
        Some(limits)
    }

    /// The limits of a count, without `limits`: what the signal can have.
    pub(super) fn count_limits(&self, signal: usize) -> Option<[f64; 2]> {
        let (least, greatest) = value_limits(self.signal(signal));
        let usual = [least.max(-MOST), greatest.min(MOST)];
        self.limits(Some(signal), usual)
    }

    /// The key `start`, within limits; their lower one, or 0 if that is within them, without it.
    pub(super) fn start(&self, [low, high]: [f64; 2]) -> Option<Option<f64>> {
        let Some(start) = self.number("start")? else {
            return Some(None);
        };
        if !(low..=high).contains(&start) {
            let (low, high) = (short_number(low), short_number(high));
            return self.wrong(
                "start",
                format!("\"start\" is {}", short_number(start)),
                format!("write a number from {low} to {high}"),
            );
        }
        Some(Some(start))
    }

    /// Reports that `later` stands beside `first`.
    pub(super) fn exclude(&self, first: &str, later: &str) -> Option<()> {
        match (self.get(first), self.get(later)) {
            (Some(_), Some(value)) => {
                value.wrong(
                    format!("\"{later}\" stands beside \"{first}\""),
                    "remove one of them",
                );
                None
            }
            _ => Some(()),
        }
    }

    /// Reports that `key` stands without `other`.
    pub(super) fn needs(&self, key: &str, other: &str) -> Option<()> {
        match (self.get(key), self.get(other)) {
            (Some(value), None) => {
                value.wrong(
                    format!("\"{key}\" stands without \"{other}\""),
                    format!("add \"{other}\", or remove it"),
                );
                None
            }
            _ => Some(()),
        }
    }

    /// Reports a mistake in a value.
    pub(super) fn wrong<T>(&self, key: &str, what: String, right: impl Into<String>) -> Option<T> {
        if let Some(value) = self.get(key) {
            value.wrong(what, right);
        }
        None
    }
}
