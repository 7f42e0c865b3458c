//! Tables and values of configuration text, read key by key.

use std::ops::RangeInclusive;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::mistakes::is_unprintable;
use super::{Collector, did_you_mean, nearest, shown};
use crate::Mistake;
use crate::time::Nanos;

/// The name of the root table in messages.
const ROOT: &str = "the file";

/// One table, read key by key; [`finish`](Self::finish) then reports missing and unknown keys.
#[derive(Debug)]
pub struct Table<'a> {
    collector: &'a Collector<'a>,
    title: String,
    at: usize,
    entries: &'a DeTable<'a>,
    known: Vec<&'static str>,
    missing: Vec<(Vec<&'static str>, String)>,
    whole: bool,
}

impl<'a> Table<'a> {
    /// The root table of a text.
    pub(super) fn root(collector: &'a Collector<'a>, entries: &'a DeTable<'a>) -> Self {
        let whole = !collector.is_broken();
        Self::new(collector, ROOT.to_owned(), 0, entries, whole)
    }

    fn new(
        collector: &'a Collector<'a>,
        title: String,
        at: usize,
        entries: &'a DeTable<'a>,
        whole: bool,
    ) -> Self {
        Self {
            collector,
            title,
            at,
            entries,
            known: Vec::new(),
            missing: Vec::new(),
            whole,
        }
    }

    /// Lets `read` read a table that the text does not have, so that its required keys are reported as
    /// missing at `at`.
    pub fn absent<R>(
        collector: &Collector<'_>,
        title: &str,
        at: usize,
        read: impl FnOnce(Table<'_>) -> R,
    ) -> R {
        let nothing = DeTable::new();
        read(Table::new(collector, title.to_owned(), at, &nothing, true))
    }

    /// The value of `key`, if present.
    pub fn take(&mut self, key: &'static str) -> Option<Value<'a>> {
        if !self.known.contains(&key) {
            self.known.push(key);
        }
        let node = self.entries.get(key)?;
        Some(Value {
            collector: self.collector,
            key: format!("\"{key}\""),
            node,
        })
    }

    /// The value of `key`; when it is missing, `right` says what to write.
    pub fn require(&mut self, key: &'static str, right: impl Into<String>) -> Option<Value<'a>> {
        let value = self.take(key);
        if value.is_none() {
            self.missing.push((vec![key], right.into()));
        }
        value
    }

    /// Reports that one of `keys` is required after all; `right` says what to write.
    pub fn require_one_of(&mut self, keys: &[&'static str], right: impl Into<String>) {
        if !keys.iter().any(|key| self.entries.contains_key(*key)) {
            self.missing.push((keys.to_vec(), right.into()));
        }
    }

    /// All keys with their values, known or not.
    pub fn all(&self) -> impl Iterator<Item = (&'a str, Value<'a>)> + use<'a> {
        let collector = self.collector;
        self.entries.iter().map(move |(key, node)| {
            let key = key.get_ref().as_ref();
            (
                key,
                Value {
                    collector,
                    key: format!("\"{}\"", shown(key)),
                    node,
                },
            )
        })
    }

    /// True if none of the table's lines was left out for a syntax error. Otherwise a missing key may be in such a
    /// line, and rules that involve several keys cannot be checked.
    pub fn is_whole(&self) -> bool {
        self.whole
    }

    /// Byte offset of the table's start.
    pub fn at(&self) -> usize {
        self.at
    }

    /// The collector for mistakes in the table's text.
    pub fn collector(&self) -> &'a Collector<'a> {
        self.collector
    }

    /// Reports a mistake in the table as a whole.
    pub fn wrong(&self, what: impl Into<String>, right: impl Into<String>) {
        self.collector.report(self.at, what, right);
    }

    /// Reports unknown keys, and required keys that are missing.
    pub fn finish(mut self) {
        for (key, _) in self.entries {
            let name = key.get_ref().as_ref();
            if self.known.contains(&name) {
                continue;
            }
            let right = match nearest(name, self.unused()) {
                Some(near) => {
                    // A misspelt key is one mistake, not an unknown key and a missing one.
                    self.missing.retain(|(keys, _)| !keys.contains(&near));
                    format!("did you mean \"{near}\"?")
                }
                None => did_you_mean(name, "keys here", &self.known),
            };
            let what = format!("unknown key \"{}\" in {}", shown(name), self.title);
            self.collector.report(key.span().start, what, right);
        }
        self.finish_open();
    }

    /// Reports required keys that are missing; unknown keys are allowed.
    pub fn finish_open(self) {
        if self.whole {
            for (keys, right) in &self.missing {
                let keys: Vec<String> = keys.iter().map(|key| self.shown_key(key)).collect();
                let what = format!("{} has no {}", self.title, keys.join(" and no "));
                self.wrong(what, right.clone());
            }
        }
    }

    /// A key as messages show it: keys of the root table are tables, shown as their headers.
    fn shown_key(&self, key: &str) -> String {
        if self.title == ROOT {
            format!("[{key}]")
        } else {
            format!("\"{key}\"")
        }
    }

    /// Known keys that are absent: the likely meaning of a misspelt key.
    fn unused(&self) -> Vec<&'static str> {
        self.known
            .iter()
            .copied()
            .filter(|key| !self.entries.contains_key(*key))
            .collect()
    }
}

/// One value of a table or list. Its getters report a value of the wrong type and return `None`.
#[derive(Clone, Debug)]
pub struct Value<'a> {
    collector: &'a Collector<'a>,
    key: String,
    node: &'a Spanned<DeValue<'a>>,
}

impl<'a> Value<'a> {
    /// Byte offset of the value's start.
    pub fn at(&self) -> usize {
        self.node.span().start
    }

    /// The line, from 1, on which the value starts.
    pub fn line(&self) -> usize {
        self.collector.line(self.at())
    }

    /// Line and column, both from 1, at which the value starts.
    pub fn place(&self) -> (usize, usize) {
        self.collector.place(self.at())
    }

    /// Reports a mistake in this value.
    pub fn wrong(&self, what: impl Into<String>, right: impl Into<String>) {
        self.refuse(Mistake::new(what, right));
    }

    /// Like [`wrong`](Self::wrong), for an existing mistake.
    pub fn refuse(&self, mistake: Mistake) {
        self.collector.collect(self.at(), mistake);
    }

    /// The value is a boolean.
    pub fn is_boolean(&self) -> bool {
        matches!(self.node.get_ref(), DeValue::Boolean(_))
    }

    /// The value is a table.
    pub fn is_table(&self) -> bool {
        matches!(self.node.get_ref(), DeValue::Table(_))
    }

    /// The value is a list.
    pub fn is_list(&self) -> bool {
        matches!(self.node.get_ref(), DeValue::Array(_))
    }

    /// The value is an integer.
    pub fn is_integer(&self) -> bool {
        matches!(self.node.get_ref(), DeValue::Integer(_))
    }

    /// A number as written; empty for everything else.
    pub fn written(&self) -> String {
        match self.node.get_ref() {
            DeValue::Integer(digits) => shown(&digits.to_string()),
            DeValue::Float(digits) => shown(digits.as_str()),
            _ => String::new(),
        }
    }

    /// The text of a string; other types are no mistake here.
    pub fn as_text(&self) -> Option<&'a str> {
        self.node.get_ref().as_str()
    }

    /// A text.
    pub fn text(&self, right: &str) -> Option<&'a str> {
        match self.node.get_ref() {
            DeValue::String(text) => Some(text),
            _ => self.of_wrong_kind(right),
        }
    }

    /// The lines of a text, such as one in `"""..."""`, each with its byte offset in the file. `None` for another value,
    /// and for a text with escapes.
    pub fn text_lines(&self) -> Option<Vec<(usize, &'a str)>> {
        self.as_text()?;
        let span = self.node.span();
        let raw = self.collector.text().get(span.clone())?;
        let long = raw.starts_with("\"\"\"") || raw.starts_with("'''");
        let quotes = if long { 3 } else { 1 };
        let inner = raw.get(quotes..raw.len().checked_sub(quotes)?)?;
        if raw.starts_with('"') && inner.contains('\\') {
            return None;
        }
        let mut at = span.start + quotes;
        let lines = inner.split_inclusive('\n').map(|line| {
            let start = at;
            at += line.len();
            (start, line.trim_end_matches(['\n', '\r']))
        });
        Some(lines.collect())
    }

    /// A text for people: not empty, at most `longest` characters, no control characters, no leading or
    /// trailing blanks.
    pub fn label(&self, longest: usize, right: &str) -> Option<&'a str> {
        let text = self.text(right)?;
        let key = &self.key;
        if text.trim().is_empty() {
            self.wrong(format!("{key} is empty"), right);
        } else if text.chars().any(is_unprintable) {
            self.wrong(
                format!("{key} has a control character in it: \"{}\"", shown(text)),
                "write it with printable characters only",
            );
        } else if text.trim() != text {
            self.wrong(
                format!("{key} has blanks around it: \"{}\"", shown(text)),
                format!("write \"{}\"", shown(text.trim())),
            );
        } else if text.chars().nth(longest).is_some() {
            self.wrong(
                format!(
                    "{key} is longer than {longest} characters: \"{}\"",
                    shown(text)
                ),
                "shorten it",
            );
        } else {
            return Some(text);
        }
        None
    }

    /// A boolean.
    pub fn boolean(&self) -> Option<bool> {
        match self.node.get_ref() {
            DeValue::Boolean(value) => Some(*value),
            _ => self.of_wrong_kind("write true or false"),
        }
    }

    /// A whole number within `range`.
    pub fn whole(&self, range: RangeInclusive<i128>) -> Option<i128> {
        let right = format!(
            "write a whole number from {} to {}",
            range.start(),
            range.end()
        );
        let DeValue::Integer(digits) = self.node.get_ref() else {
            return self.of_wrong_kind(&right);
        };
        let number = i128::from_str_radix(digits.as_str(), digits.radix()).ok();
        let fitting = number.filter(|number| range.contains(number));
        if fitting.is_none() {
            self.wrong(
                format!("{} is {}", self.key, shown(&digits.to_string())),
                right,
            );
        }
        fitting
    }

    /// A finite number, with or without a fraction.
    pub fn number(&self, right: &str) -> Option<f64> {
        let number = match self.node.get_ref() {
            #[expect(clippy::cast_precision_loss, reason = "asked for as a double")]
            DeValue::Integer(digits) => i128::from_str_radix(digits.as_str(), digits.radix())
                .ok()
                .map(|number| number as f64),
            DeValue::Float(digits) => digits.as_str().parse().ok(),
            _ => return self.of_wrong_kind(right),
        };
        let finite = number.filter(|number| number.is_finite());
        if finite.is_none() {
            self.wrong(
                format!("{} is {}, beyond every number", self.key, self.written()),
                right,
            );
        }
        finite
    }

    /// A duration greater than zero.
    pub fn duration(&self) -> Option<Nanos> {
        let text = self.text("write a duration in quotes, such as \"10ms\"")?;
        match text.parse::<Nanos>() {
            Ok(Nanos::ZERO) => {
                self.wrong(
                    format!("{} is no time at all", self.key),
                    "write a longer duration",
                );
                None
            }
            Ok(span) => Some(span),
            Err(Mistake { what, right }) => {
                self.wrong(format!("\"{}\" is {what}", shown(text)), right);
                None
            }
        }
    }

    /// A duration of at least `least`; `why` explains why a shorter one makes no sense.
    pub fn duration_from(&self, least: Nanos, why: &str) -> Option<Nanos> {
        let span = self.duration()?;
        if span < least {
            self.wrong(
                format!("{} is {span}, and {why}", self.key),
                format!("write at least \"{least}\""),
            );
            return None;
        }
        Some(span)
    }

    /// Like [`duration_from`](Self::duration_from), and not longer than `most`.
    pub fn duration_between(&self, least: Nanos, why: &str, most: Nanos) -> Option<Nanos> {
        let span = self.duration_from(least, why)?;
        if span > most {
            self.wrong(
                format!("{} is {span}, which is too long", self.key),
                format!("write at most \"{most}\""),
            );
            return None;
        }
        Some(span)
    }

    /// One of the names in `choices`; `kinds` is their collective name, such as "roles".
    pub fn choice<T: Copy>(&self, kinds: &str, choices: &[(&str, T)]) -> Option<T> {
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        let text = self.text(&format!("{kinds} are {}", quoted(&names)))?;
        let chosen = choices
            .iter()
            .find(|(name, _)| *name == text)
            .map(|(_, chosen)| *chosen);
        if chosen.is_none() {
            self.wrong(
                format!("\"{}\" is not one of the {kinds}", shown(text)),
                did_you_mean(text, kinds, &names),
            );
        }
        chosen
    }

    /// The elements of a list.
    pub fn list(&self, right: &str) -> Option<Vec<Self>> {
        match self.node.get_ref() {
            DeValue::Array(list) => Some(self.elements(list)),
            _ => self.of_wrong_kind(right),
        }
    }

    /// A table; messages call it `title`.
    pub fn table(&self, title: &str, right: &str) -> Option<Table<'a>> {
        match self.node.get_ref() {
            DeValue::Table(entries) => Some(self.as_table(title, entries)),
            _ => self.of_wrong_kind(right),
        }
    }

    /// All tables of a list of tables that the text writes as `title`, such as `[[signal]]`.
    pub fn tables(&self, title: &str) -> Vec<Table<'a>> {
        let right = format!("write {title} tables");
        match self.node.get_ref() {
            DeValue::Array(list) => self
                .elements(list)
                .iter()
                .filter_map(|element| element.table(title, &right))
                .collect(),
            DeValue::Table(entries) => {
                self.wrong(
                    format!("{} is a single table", self.key),
                    format!("write {title}, with two brackets"),
                );
                vec![self.as_table(title, entries)]
            }
            _ => {
                let _: Option<()> = self.of_wrong_kind(&right);
                Vec::new()
            }
        }
    }

    fn elements(&self, list: &'a toml::de::DeArray<'a>) -> Vec<Self> {
        let element = |(index, node)| {
            let key = format!("element {} of {}", index + 1, self.key);
            Self {
                collector: self.collector,
                key,
                node,
            }
        };
        list.iter().enumerate().map(element).collect()
    }

    fn as_table(&self, title: &str, entries: &'a DeTable<'a>) -> Table<'a> {
        let whole = self.collector.is_whole_from(self.at());
        Table::new(self.collector, title.to_owned(), self.at(), entries, whole)
    }

    fn of_wrong_kind<T>(&self, right: &str) -> Option<T> {
        let kind = match self.node.get_ref() {
            DeValue::String(_) => "a text",
            DeValue::Integer(_) => "a whole number",
            DeValue::Float(_) => "a number with a fraction",
            DeValue::Boolean(_) => "a boolean",
            DeValue::Datetime(_) => "a date or time",
            DeValue::Array(list) if list.iter().any(|e| e.get_ref().is_table()) => {
                "a list of tables"
            }
            DeValue::Array(_) => "a list",
            DeValue::Table(_) => "a table",
        };
        self.wrong(format!("{} is {kind}", self.key), right);
        None
    }
}

fn quoted(names: &[&str]) -> String {
    names
        .iter()
        .map(|name| format!("\"{name}\""))
        .collect::<Vec<_>>()
        .join(", ")
}
