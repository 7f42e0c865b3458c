//! What a driver or a PLC program knows of itself: counts, measured numbers, times and facts, each under its key.
//!
//! As text an entry is a line `key=value`, in which a name within the key has a `\` before each `=` and each `\`.
//! This text goes to people, to files, and to Java; [`entries`] reads it.

use std::borrow::Cow;
use std::fmt;

use crate::os::one_line;
use crate::time::{Nanos, TimeHistogram};

/// What an entry is about, if it is not the driver as a whole.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// The station with this name.
    Station(String),
    /// The signal with this name.
    Signal(String),
}

impl Subject {
    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Self::Station(name) | Self::Signal(name) => name,
        }
    }
}

/// The key of an entry: words with dots between them, and the name of its subject among them.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key {
    head: Cow<'static, str>,
    subject: Option<Subject>,
    tail: &'static str,
}

impl Key {
    /// `head.<station>`, and `.tail` unless that is empty.
    pub fn of_station(head: &'static str, station: &str, tail: &'static str) -> Self {
        Self {
            subject: Some(Subject::Station(station.to_owned())),
            tail,
            ..Self::from(head)
        }
    }

    /// `head.<signal>`.
    pub fn of_signal(head: &'static str, signal: &str) -> Self {
        Self {
            subject: Some(Subject::Signal(signal.to_owned())),
            ..Self::from(head)
        }
    }

    /// What it is about.
    pub fn subject(&self) -> Option<&Subject> {
        self.subject.as_ref()
    }
}

impl From<&'static str> for Key {
    fn from(head: &'static str) -> Self {
        Self {
            head: head.into(),
            subject: None,
            tail: "",
        }
    }
}

impl From<String> for Key {
    fn from(head: String) -> Self {
        Self {
            head: head.into(),
            ..Self::from("")
        }
    }
}

/// Writes it as it stands before the `=` of its line.
impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.head)?;
        if let Some(subject) = &self.subject {
            f.write_str(".")?;
            for c in subject.name().chars() {
                if matches!(c, '=' | '\\') {
                    f.write_str("\\")?;
                }
                write!(f, "{c}")?;
            }
        }
        if !self.tail.is_empty() {
            write!(f, ".{}", self.tail)?;
        }
        Ok(())
    }
}

/// The value of an entry.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// How many.
    Count(u64),
    /// A number in the unit that the key names, and how many digits behind the point are shown.
    Number(f64, usize),
    /// A time, shown with its unit.
    Time(Nanos),
    /// Words, in one line.
    Text(String),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => count.fmt(f),
            Self::Number(number, digits) => write!(f, "{number:.digits$}"),
            Self::Time(time) => time.fmt(f),
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// Statistics at one moment, in an order fit for printing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics(Vec<(Key, Value)>);

impl Statistics {
    /// All entries.
    pub fn iter(&self) -> impl Iterator<Item = &(Key, Value)> {
        self.0.iter()
    }

    /// Adds a count.
    pub fn count(&mut self, key: impl Into<Key>, count: u64) {
        self.0.push((key.into(), Value::Count(count)));
    }

    /// Adds a number, shown with this many `digits` behind the point.
    pub fn number(&mut self, key: impl Into<Key>, number: f64, digits: usize) {
        self.0.push((key.into(), Value::Number(number, digits)));
    }

    /// Adds a time.
    pub fn time(&mut self, key: impl Into<Key>, time: Nanos) {
        self.0.push((key.into(), Value::Time(time)));
    }

    /// Adds words.
    pub fn text(&mut self, key: impl Into<Key>, text: &str) {
        self.0.push((key.into(), Value::Text(one_line(text))));
    }

    /// Adds `key.count` and, unless it is zero, `key.p50_us`, `p90`, `p99`, `max`, `mean`, `min` and `stdev`, in
    /// microseconds.
    pub fn distribution(&mut self, key: &str, of: &TimeHistogram) {
        self.distribution_in(key, of, Nanos::from_micros(1), "_us");
    }

    /// As [`distribution`](Self::distribution), in multiples of `unit`, which `suffix` names.
    pub fn distribution_in(&mut self, key: &str, of: &TimeHistogram, unit: Nanos, suffix: &str) {
        self.count(format!("{key}.count"), of.count());
        if of.count() == 0 {
            return;
        }
        let units = |span: Nanos| span.as_micros() / unit.as_micros();
        for (name, number) in [
            ("p50", units(of.quantile(0.5))),
            ("p90", units(of.quantile(0.9))),
            ("p99", units(of.quantile(0.99))),
            ("max", units(of.longest())),
            ("mean", of.mean() / 1e3 / unit.as_micros()),
            ("min", units(of.shortest())),
            ("stdev", of.deviation() / 1e3 / unit.as_micros()),
        ] {
            self.number(format!("{key}.{name}{suffix}"), number, 1);
        }
    }
}

/// One `key=value` per line.
impl fmt::Display for Statistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0
            .iter()
            .try_for_each(|(key, value)| writeln!(f, "{key}={value}"))
    }
}

/// The statistics in a text, as keys and values; other lines are skipped, so that the complete output of a command
/// may be given.
pub fn entries(text: &str) -> impl Iterator<Item = (String, &str)> {
    text.lines().filter_map(|line| entry(line.trim()))
}

fn entry(line: &str) -> Option<(String, &str)> {
    // A key begins with a word, behind which a dot or the value follows. A sentence of the log or a command does not.
    let word = line.find(|c: char| !c.is_ascii_alphanumeric() && c != '_')?;
    if word == 0 || !line[word..].starts_with(['.', '=']) {
        return None;
    }
    let mut key = String::new();
    let mut rest = line.char_indices();
    while let Some((at, c)) = rest.next() {
        match c {
            '=' => return Some((key, &line[at + 1..])),
            '\\' => key.push(rest.next()?.1),
            c => key.push(c),
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_is_one_line_that_can_be_read_back_whatever_is_in_a_name() {
        let mut statistics = Statistics::default();
        statistics.count("ticks", 5);
        statistics.number("state.for_s", 1.0, 3);
        statistics.time("max_age", Nanos::from_millis(250));
        statistics.text("reason", "left: 1\n right = 2");
        statistics.count(Key::of_signal("plc.rises", "a = b: c\\"), 7);
        statistics.text(Key::of_station("station", "x=y", "stale"), "true");
        let text = statistics.to_string();
        assert_eq!(
            text,
            "ticks=5\nstate.for_s=1.000\nmax_age=250ms\nreason=left: 1 right = 2\n\
             plc.rises.a \\= b: c\\\\=7\nstation.x\\=y.stale=true\n"
        );
        let read: Vec<_> = entries(&text).collect();
        let read: Vec<_> = read
            .iter()
            .map(|(key, value)| (key.as_str(), *value))
            .collect();
        assert_eq!(
            read,
            [
                ("ticks", "5"),
                ("state.for_s", "1.000"),
                ("max_age", "250ms"),
                ("reason", "left: 1 right = 2"),
                ("plc.rises.a = b: c\\", "7"),
                ("station.x=y.stale", "true"),
            ]
        );
    }

    #[test]
    fn what_is_no_entry_is_skipped() {
        let text =
            "plc: opening: waiting for a=b\nplc: ok scans=7\n[2026 WARN] a=b\n=3\n\nword\na\\";
        assert_eq!(entries(text).count(), 0);
    }

    #[test]
    fn a_distribution_has_its_unit_in_its_keys() {
        let mut spans = TimeHistogram::new();
        let text = |spans: &TimeHistogram| {
            let mut statistics = Statistics::default();
            statistics.distribution("age", spans);
            statistics.to_string()
        };
        assert_eq!(text(&spans), "age.count=0\n");
        for micros in [9_999, 10_001, 10_000, 10_004] {
            spans.record(Nanos::from_micros(micros));
        }
        let text = text(&spans);
        assert!(
            text.contains("age.min_us=9999.0\nage.stdev_us=1.9\n"),
            "{text}"
        );
    }
}
