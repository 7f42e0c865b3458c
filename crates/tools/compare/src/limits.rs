//! The file of limits: how much may differ.

use std::cmp::{Ordering, Reverse};
use std::fmt;
use std::path::Path;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Mistakes, Table, Value, load_text, nearest, parse_text, shown};

use super::compared::{Compared, Outcome, SignalResult};
use super::page::short;

/// A limit, or what is compared with it.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum Size {
    Likeness(f64),
    Time(Nanos),
    Edges(u64),
    Number(f64),
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Likeness(share) => write!(f, "{share:.4}"),
            Self::Time(time) => time.rounded().fmt(f),
            Self::Edges(count) => count.fmt(f),
            Self::Number(number) => f.write_str(&short(*number)),
        }
    }
}

/// A limit, and its line and column in the file.
type Placed = (Size, (usize, usize));

/// A key of the limits of a signal, how its value is read, and what it limits.
type Key = (&'static str, fn(&Value<'_>) -> Option<Size>, &'static str);

const KEYS: [Key; 9] = [
    ("likeness", likeness, "likeness"),
    ("median", time, "median of the time differences"),
    ("spread", time, "spread of the time differences"),
    ("worst", time, "worst time difference"),
    ("missing", edges, "number of missing edges"),
    ("extra", edges, "number of extra edges"),
    ("shift", time, "best shift"),
    ("rms", number, "root-mean-square difference"),
    ("greatest", number, "greatest difference"),
];

/// How many of the keys fit every signal; the others have the signal's unit.
const OF_ALL: usize = 7;

/// The limits of a signal, in the order of the keys.
type SignalLimits = [Option<Placed>; KEYS.len()];

/// A file of limits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Limits {
    file: String,
    likeness: Option<Placed>,
    step: Option<Placed>,
    all: SignalLimits,
    /// The limits of single signals, each with the place of the signal's name.
    own: Vec<(String, (usize, usize), SignalLimits)>,
}

/// A limit that is exceeded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Breach {
    /// The file of limits.
    pub file: String,
    /// Line and column of the limit, both from 1.
    pub place: (usize, usize),
    /// The value that exceeds the limit, and its time.
    pub what: String,
}

impl fmt::Display for Breach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (line, column) = self.place;
        write!(f, "{}:{line}:{column}: {}", self.file, self.what)
    }
}

const TABLE: &str = "write a table of limits, such as [limits] and worst = \"50ms\" below it";
const NAME: &str = "write the name of a signal in quotes";

impl Limits {
    /// Reads the file at `path`.
    ///
    /// # Errors
    ///
    /// With every mistake in the file.
    pub fn load(path: &Path) -> Result<Self, Mistakes> {
        Self::parse(&path.display().to_string(), &load_text(path)?)
    }

    /// Reads a text from `file`.
    fn parse(file: &str, text: &str) -> Result<Self, Mistakes> {
        parse_text(file, text, |root| Some(Self::read(file, root)))
    }

    fn read(file: &str, mut root: Table<'_>) -> Self {
        let placed = |value: Option<Value<'_>>, read: fn(&Value<'_>) -> Option<Size>| {
            let value = value?;
            Some((read(&value)?, value.place()))
        };
        let likeness = placed(root.take("likeness"), self::likeness);
        let step = placed(root.take("step"), time);
        let all = root.take("limits");
        let own = root.take("signal");
        root.finish();
        let limits = |mut table: Table<'_>, keys: usize| {
            let mut limits = SignalLimits::default();
            for (limit, (key, read, _)) in limits.iter_mut().zip(&KEYS[..keys]) {
                *limit = placed(table.take(key), *read);
            }
            table.finish();
            limits
        };
        let all = all.and_then(|value| value.table("[limits]", TABLE));
        let own = own.map(|value| value.tables("[[signal]]"));
        let own = own.into_iter().flatten().filter_map(|mut table| {
            let name = table.require("name", NAME);
            let limits = limits(table, KEYS.len());
            let name = name?;
            Some((name.text(NAME)?.to_owned(), name.place(), limits))
        });
        Self {
            file: file.to_owned(),
            likeness,
            step,
            own: own.collect(),
            all: all.map(|table| limits(table, OF_ALL)).unwrap_or_default(),
        }
    }

    fn breach(&self, place: (usize, usize), what: String) -> Breach {
        Breach {
            file: self.file.clone(),
            place,
            what,
        }
    }

    /// The limits that are exceeded, in the order of the signals.
    pub fn check(&self, compared: &Compared) -> Vec<Breach> {
        let names = || compared.signals.iter().map(|signal| &*signal.name);
        let absent = self.own.iter();
        let absent = absent.filter(|(name, ..)| !names().any(|other| other == name));
        let absent = absent.map(|(name, place, _)| {
            let near = nearest(name, names()).map_or_else(String::new, |near| {
                format!("; did you mean \"{}\"?", shown(near))
            });
            let what = format!("no signal \"{}\" is compared{near}", shown(name));
            self.breach(*place, what)
        });
        let mut found: Vec<Breach> = absent.collect();
        let mut check = |limit: Option<Placed>, (size, at): (Size, String), what: &str| {
            if let Some((limit, place)) = limit {
                // A difference that nobody knows is too great.
                let order = size.partial_cmp(&limit);
                let (is_wrong, word) = match size {
                    Size::Likeness(_) => (order.is_none_or(Ordering::is_lt), "expected"),
                    _ => (order.is_none_or(Ordering::is_gt), "permitted"),
                };
                if is_wrong {
                    let what = format!("{what} is {size}{at}, and {limit} is {word}");
                    found.push(self.breach(place, what));
                }
            }
        };
        let likeness = Size::Likeness(compared.likeness);
        check(self.likeness, (likeness, String::new()), "the likeness");
        for signal in &compared.signals {
            let own = self.own.iter().find(|(name, ..)| *name == signal.name);
            for (index, (_, _, what)) in KEYS.iter().enumerate() {
                let limit = own.and_then(|(.., limits)| limits[index]);
                if let Some(size) = size(signal, index) {
                    let what = format!("\"{}\": the {what}", shown(&signal.name));
                    check(limit.or(self.all[index]), size, &what);
                }
            }
        }
        let rows = compared.steps.iter().flat_map(|steps| &steps.rows);
        for row in rows {
            if let Some(Nanos(difference)) = row.difference() {
                let what = format!("step {}: the difference of the durations", row.number);
                let size = Size::Time(Nanos(difference.abs()));
                check(self.step, (size, String::new()), &what);
            }
        }
        found
    }
}

/// The value that the limit with this key bounds, and its time, if it has one.
fn size(signal: &SignalResult, key: usize) -> Option<(Size, String)> {
    let time = |time: Nanos| Size::Time(Nanos(time.0.abs()));
    let no_time = |size| (size, String::new());
    let key = KEYS[key].0;
    match &signal.outcome {
        _ if key == "likeness" => signal.likeness.map(Size::Likeness).map(no_time),
        Outcome::Bool(found) => match key {
            "median" | "spread" | "worst" => {
                let ways = [true, false].map(|rises| found.differences(rises));
                let sizes = ways.into_iter().flatten().map(|found| match key {
                    "median" => (found.median, None),
                    "spread" => (found.spread, None),
                    _ => (found.worst.0, Some(found.worst.1)),
                });
                let (most, at) = sizes.max_by_key(|(size, at)| (size.0.abs(), Reverse(*at)))?;
                let at = at.map(|at| format!(" at {}", at.rounded()));
                Some((time(most), at.unwrap_or_default()))
            }
            "missing" | "extra" => {
                let edges = if key == "extra" {
                    &found.extra
                } else {
                    &found.missing
                };
                let first = edges.first();
                let first = first.map(|edge| format!(" from {} on", edge.at.rounded()));
                Some((Size::Edges(edges.len() as u64), first.unwrap_or_default()))
            }
            _ => None,
        },
        Outcome::Number(found) => match key {
            "shift" => Some(no_time(time(found.shift))),
            "rms" => Some(no_time(Size::Number(found.rms))),
            "greatest" => Some((
                Size::Number(found.greatest),
                format!(" at {}", found.at.rounded()),
            )),
            _ => None,
        },
    }
}

fn time(value: &Value<'_>) -> Option<Size> {
    value.duration().map(Size::Time)
}

fn edges(value: &Value<'_>) -> Option<Size> {
    let count = value.whole(0..=i128::from(u64::MAX))?;
    u64::try_from(count).ok().map(Size::Edges)
}

fn number(value: &Value<'_>) -> Option<Size> {
    let right = "write a number from 0 on, in the unit of the signal";
    within(value, f64::INFINITY, right).map(Size::Number)
}

fn likeness(value: &Value<'_>) -> Option<Size> {
    within(value, 1.0, "write a likeness from 0 to 1").map(Size::Likeness)
}

/// A number from 0 to `most`.
fn within(value: &Value<'_>, most: f64, right: &str) -> Option<f64> {
    let number = value.number(right)?;
    if (0.0..=most).contains(&number) {
        return Some(number);
    }
    value.wrong(format!("a limit of {}", value.written()), right);
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BoolResult, Edge, NumberResult};

    fn compared() -> Compared {
        let signal = |name: &str, likeness, outcome| SignalResult {
            name: name.to_owned(),
            unit: "mm".to_owned(),
            likeness: Some(likeness),
            outcome,
        };
        let edge = |at| Edge {
            at: Nanos::from_millis(at),
            rises: true,
        };
        let of_bool = BoolResult {
            pairs: vec![(edge(1000), edge(1010)), (edge(2000), edge(2063))],
            missing: vec![edge(4000)],
            extra: Vec::new(),
            window: Nanos::from_millis(500),
        };
        let of_number = NumberResult {
            shift: Nanos::from_millis(-20),
            rms: 0.5,
            greatest: 2.0,
            at: Nanos::from_millis(1500),
            range: 100.0,
        };
        Compared {
            signals: vec![
                signal("LA1 in", 0.75, Outcome::Bool(of_bool)),
                signal("Level", 0.9, Outcome::Number(of_number)),
            ],
            likeness: 0.825,
            ..Compared::default()
        }
    }

    fn breaches(text: &str) -> Vec<String> {
        let limits = Limits::parse("limits.toml", text).expect("right");
        let found = limits.check(&compared());
        found.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn every_limit_that_is_exceeded_is_named_at_its_place() {
        let text = "likeness = 0.9\n[limits]\nworst = \"50ms\"\nmedian = \"40ms\"\nmissing = 0\nextra = 0\n\
                    shift = \"10ms\"\n[[signal]]\nname = \"Level\"\nrms = 0.4\ngreatest = 1\n";
        assert_eq!(
            breaches(text),
            [
                "limits.toml:1:12: the likeness is 0.8250, and 0.9000 is expected",
                "limits.toml:4:10: \"LA1 in\": the median of the time differences is 63ms, and 40ms is permitted",
                "limits.toml:3:9: \"LA1 in\": the worst time difference is 63ms at 2s, and 50ms is permitted",
                "limits.toml:5:11: \"LA1 in\": the number of missing edges is 1 from 4s on, and 0 is permitted",
                "limits.toml:7:9: \"Level\": the best shift is 20ms, and 10ms is permitted",
                "limits.toml:10:7: \"Level\": the root-mean-square difference is 0.5, and 0.4 is permitted",
                "limits.toml:11:12: \"Level\": the greatest difference is 2 at 1500ms, and 1 is permitted",
            ]
        );
    }

    #[test]
    fn own_limits_come_before_those_of_all() {
        let text = "[limits]\nworst = \"50ms\"\n[[signal]]\nname = \"LA1 in\"\nworst = \"100ms\"\n";
        assert!(breaches(text).is_empty());
    }

    #[test]
    fn a_limit_of_a_signal_that_is_not_compared_is_exceeded() {
        assert_eq!(
            breaches("[[signal]]\nname = \"Levl\"\nrms = 1\n"),
            ["limits.toml:2:8: no signal \"Levl\" is compared; did you mean \"Level\"?"]
        );
    }

    #[test]
    fn mistakes_come_all_at_once() {
        let text = "likeness = 2\nstep = 3\n[limits]\nrms = 3\n[[signal]]\nrms = -1\n";
        let mistakes = Limits::parse("limits.toml", text).expect_err("wrong");
        let told = mistakes.to_string();
        for part in ["toml:1:12: ", "toml:2:8: ", "toml:4:", "toml:6:7: "] {
            assert!(told.contains(part), "{part}: {told}");
        }
        assert_eq!(mistakes.len(), 5, "{told}");
    }
}
