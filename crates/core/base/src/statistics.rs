//! The statistics of a driver or a PLC program: counts, measured numbers, times and facts, each with a key.
//!
//! In text form an entry is a line `key=value`; a name within the key has a `\` before each `=` and each `\`. People,
//! files and Java read this text; [`entries`] parses it.

use std::borrow::Cow;
use std::fmt;

use crate::time::{Nanos, TimeHistogram};

/// The key of an entry: words with dots between them, and the name of a station or signal among them.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Key(Cow<'static, str>);

impl Key {
    /// `head.<name>`, of a station or signal, and `.tail` unless that is empty.
    pub fn of(head: &'static str, name: &str, tail: &'static str) -> Self {
        let mut key = format!("{head}.");
        for c in name.chars() {
            if matches!(c, '=' | '\\') {
                key.push('\\');
            }
            key.push(c);
        }
        if !tail.is_empty() {
            key.push('.');
            key.push_str(tail);
        }
        Self(key.into())
    }

    /// The same key with one more word at its end.
    #[must_use]
    pub fn and(self, word: &str) -> Self {
        Self(format!("{}.{word}", self.0).into())
    }
}

impl From<&'static str> for Key {
    fn from(key: &'static str) -> Self {
        Self(key.into())
    }
}

impl From<String> for Key {
    fn from(key: String) -> Self {
        Self(key.into())
    }
}

/// Writes the key as it appears before the `=` of its line.
impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// The value of an entry.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number of things.
    Count(u64),
    /// A number in the unit that the key names, and its number of decimal places.
    Number(f64, usize),
    /// A time, shown with its unit.
    Time(Nanos),
    /// Text in one line.
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

/// A distribution of times, for programs that add up distributions themselves.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution {
    /// The key before the dots of its entries.
    pub key: String,
    /// How many times are at most as long as each of [`BOUNDS`](Self::BOUNDS), to the histogram's resolution of 1 %.
    pub up_to: [u64; Self::BOUNDS.len()],
    /// How many times there are.
    pub count: u64,
    /// Their sum in seconds.
    pub sum: f64,
}

impl Distribution {
    /// Three bounds for each power of ten: from a tick of a small image to a PLC that has gone for long.
    pub const BOUNDS: [Nanos; 22] = {
        let mut bounds = [Nanos(10_000_000_000); 22];
        let (mut at, mut power) = (0, 1_000);
        while at < 21 {
            bounds[at] = Nanos(power);
            bounds[at + 1] = Nanos(power / 2 * 5);
            bounds[at + 2] = Nanos(power * 5);
            (at, power) = (at + 3, power * 10);
        }
        bounds
    };

    fn new(key: &str, of: &TimeHistogram) -> Self {
        let mut up_to = [0; Self::BOUNDS.len()];
        for (longest, count) in of.steps() {
            let first = Self::BOUNDS.partition_point(|bound| *bound < longest);
            for sum in &mut up_to[first..] {
                *sum += count;
            }
        }
        Self {
            key: key.to_owned(),
            up_to,
            count: of.count(),
            sum: of.sum() / 1e9,
        }
    }
}

/// Statistics at one moment, in the order for printing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    entries: Vec<(Key, Value)>,
    distributions: Vec<Distribution>,
}

impl Statistics {
    /// The entries in their order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Value)> {
        self.entries.iter().map(|(key, value)| (&*key.0, value))
    }

    /// The distributions of times, whose [entries](Self::iter) have their quantiles.
    pub fn distributions(&self) -> &[Distribution] {
        &self.distributions
    }

    /// Adds a count.
    pub fn count(&mut self, key: impl Into<Key>, count: u64) {
        self.entries.push((key.into(), Value::Count(count)));
    }

    /// Adds a number, shown with this many decimal places.
    pub fn number(&mut self, key: impl Into<Key>, number: f64, digits: usize) {
        self.entries
            .push((key.into(), Value::Number(number, digits)));
    }

    /// Adds a time.
    pub fn time(&mut self, key: impl Into<Key>, time: Nanos) {
        self.entries.push((key.into(), Value::Time(time)));
    }

    /// Adds text; characters that would end the line are replaced by a space.
    pub fn text(&mut self, key: impl Into<Key>, text: &str) {
        let ends_line = |c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}');
        let text = text.replace(ends_line, " ");
        self.entries.push((key.into(), Value::Text(text)));
    }

    /// Adds `key.count` and, unless it is zero, `key.p50_us`, `p90`, `p99`, `max`, `mean`, `min` and `stdev`, in
    /// microseconds.
    pub fn distribution(&mut self, key: &str, of: &TimeHistogram) {
        self.distribution_in(key, of, Nanos::from_micros(1), "_us");
        self.distributions.push(Distribution::new(key, of));
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
        self.entries
            .iter()
            .try_for_each(|(key, value)| writeln!(f, "{key}={value}"))
    }
}

/// The statistics in a text, as keys and values; other lines are skipped, so the complete output of a command may be
/// passed.
pub fn entries(text: &str) -> impl Iterator<Item = (String, &str)> {
    text.lines().filter_map(|line| entry(line.trim()))
}

fn entry(line: &str) -> Option<(String, &str)> {
    // A key begins with a word, followed by a dot or an equals sign. A sentence of the log or a command does not.
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
        statistics.count(Key::of("plc.rises", "a = b: c\\", ""), 7);
        statistics.text(Key::of("station", "x=y", "stale"), "true");
        let text = statistics.to_string();
        assert_eq!(
            text,
            "ticks=5\nstate.for_s=1.000\nmax_age=250ms\nreason=left: 1  right = 2\n\
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
                ("reason", "left: 1  right = 2"),
                ("plc.rises.a = b: c\\", "7"),
                ("station.x=y.stale", "true"),
            ]
        );
    }

    #[test]
    fn a_distribution_counts_the_times_up_to_each_bound() {
        let mut spans = TimeHistogram::new();
        for micros in [1, 40, 900, 30_000_000] {
            spans.record(Nanos::from_micros(micros));
        }
        let mut statistics = Statistics::default();
        statistics.distribution("age", &spans);
        let [age] = statistics.distributions() else {
            panic!("not one distribution: {statistics:?}");
        };
        let up_to = |micros: i64| {
            let at = |bound: &Nanos| *bound == Nanos::from_micros(micros);
            age.up_to[Distribution::BOUNDS.iter().position(at).expect("a bound")]
        };
        let found = [
            up_to(25),
            up_to(50),
            up_to(500),
            up_to(1_000),
            up_to(10_000_000),
        ];
        assert_eq!(found, [1, 2, 2, 3, 3]);
        assert_eq!((age.key.as_str(), age.count), ("age", 4));
        assert!((age.sum - 30.000_941).abs() < 1e-9, "{}", age.sum);
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
