//! Reading `[sweep]`.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Table, Value, did_you_mean, shown};
use tickbus_fieldbus::faults::{model_value, unknown};
use tickbus_image::signal::{DataType, Slot};

use super::disturbance::Kind;
use super::named::Named;
use super::progress::Mark;
use super::{Moments, Row, Sweep};
use crate::model_faults::ModelFaults;
use crate::sections::Reader;
use crate::test::{Step, Test, TextPosition};

/// How much sooner than without a fault a change may come, unless the file says it.
const TOLERANCE: Nanos = Nanos::from_millis(50);

/// How late a signal may be.
const LEAST: Nanos = Nanos(1);
const LONGEST: Nanos = Nanos::from_secs(60);

const SCENARIO: &str = "write the steps of a normal run, or the name of a [[test]] in this file";
const MOMENTS: &str =
    "write the signal that numbers the steps, such as moments = \"Step\", or a list of conditions";
const TOLD: &str = "write the condition by which the program tells a fault, such as \"Fault lamp\"";
const KIND: &str = "write a kind in quotes, or such as { kind = \"late\", by = \"500ms\" }";

/// Where the scenario of a sweep is, and with it the file of accepted verdicts, if the sweep names none.
#[derive(Clone, Copy)]
pub(crate) enum Scenario<'a> {
    /// In the test file, which has these tests.
    Here(&'a [Option<Test>]),
    /// In a program in another language.
    Elsewhere {
        /// The usual file of accepted verdicts.
        accepted: &'a str,
        /// How all verdicts are accepted there.
        accept: &'static str,
    },
}

impl Reader<'_> {
    /// Reads `[sweep]`, after the tests of the file.
    pub(crate) fn sweep(&self, mut table: Table<'_>, source: Scenario<'_>) -> Option<Sweep> {
        let place = table.collector().place(table.at());
        let scenario = match source {
            Scenario::Here(_) => table.require("scenario", SCENARIO),
            Scenario::Elsewhere { .. } => None,
        };
        let signals = table.take("signals");
        let kinds = table.take("kinds");
        let pairs = table.take("pairs");
        let moments = table.require("moments", MOMENTS);
        let told = table.require("told", TOLD);
        let goes_on = table.take("goes_on");
        let never = table.take("never");
        let right = "say in what time a fault must be told, such as within = \"2s\"";
        let within = table.require("within", right);
        let tolerance = table.take("tolerance");
        let accepted = table.take("accepted");
        let mut usual = Mark::usual(self.table, self.own());
        if let Some(counted) = self.counted {
            usual
                .retain(|mark| !matches!(mark, Mark::Value(signal) if counted.is_counter(*signal)));
        }
        if usual.is_empty() && goes_on.is_none() {
            table.wrong(
                "the PLC writes neither a BOOL nor an unscaled whole number that would show its progress",
                "write conditions, such as goes_on = [\"Speed > 10\", \"Speed > 90\"]",
            );
        }
        table.finish();

        let (scenario, usual_file, accept) = match source {
            Scenario::Here(tests) => {
                let steps = scenario.and_then(|value| self.scenario(&value, tests));
                (steps, "accepted.toml", "tickbus test --accept")
            }
            Scenario::Elsewhere { accepted, accept } => {
                (Some((Vec::new(), Vec::new())), accepted, accept)
            }
        };
        let signals = if let Some(value) = signals {
            self.names(&value).map(|names| once(&value, names))
        } else {
            let signals = self.table.signals.iter().enumerate();
            let read = signals.filter(|(_, signal)| signal.area == self.own());
            Some(read.map(|(index, _)| index).collect())
        };
        let kinds = match kinds {
            None => Some(None),
            Some(value) => self.kinds(&value).map(Some),
        };
        let rows = kinds.and_then(|kinds| self.rows(&signals?, kinds));
        let pairs = pairs.map_or(Some(false), |value| value.boolean());
        let rows = rows.and_then(|rows| Some(if pairs? { with_pairs(rows) } else { rows }));
        let moments = moments.and_then(|value| self.moments(&value));
        let told = told.and_then(|value| self.named(&value, TOLD));
        let never = match never {
            None => Some(Vec::new()),
            Some(value) => self.named(&value, "write the conditions that never may hold"),
        };
        let goes_on = goes_on.map_or(Some(usual), |value| self.goes_on(&value));
        let within = within.and_then(|value| self.ticks(&value, true));
        let tolerance = match tolerance {
            None => u64::try_from(TOLERANCE.0.div_euclid(self.step.0)).ok(),
            Some(value) => self.ticks(&value, true),
        };
        let accepted = match accepted {
            None => Some(usual_file),
            Some(value) => value.text("write the path of the file with accepted verdicts"),
        };
        let (initial, scenario) = scenario?;
        Some(Sweep {
            place,
            rows: rows?,
            moments: moments?,
            initial,
            scenario,
            told: told?,
            never: never?,
            goes_on: goes_on?,
            within: within?,
            tolerance: tolerance?,
            accepted: self.folder.join(accepted?),
            accept,
        })
    }

    /// The steps of a normal run: its own, or those of a test.
    #[expect(
        clippy::type_complexity,
        reason = "the values at the beginning, and the steps"
    )]
    fn scenario(
        &self,
        value: &Value<'_>,
        tests: &[Option<Test>],
    ) -> Option<(Vec<(usize, Slot)>, Vec<Step>)> {
        if let Some(name) = value.as_text() {
            let read = || tests.iter().flatten();
            if let Some(test) = read().find(|test| test.name == name) {
                return Some((test.initial.clone(), test.steps.clone()));
            }
            // A test that could not be read may be the one.
            if tests.iter().all(Option::is_some) {
                let names: Vec<&str> = read().map(|test| test.name.as_str()).collect();
                value.wrong(
                    format!("there is no test \"{}\" in this file", shown(name)),
                    did_you_mean(name, "tests", &names),
                );
            }
            return None;
        }
        value.list(SCENARIO)?;
        let steps = self.steps(value)?;
        if !steps.iter().any(Step::takes_time) {
            value.wrong(
                "no time passes in this scenario",
                "add steps such as { run = \"1s\" }",
            );
            return None;
        }
        Some((Vec::new(), steps))
    }

    /// The kinds of faults, each with its place.
    fn kinds<'v>(&self, value: &Value<'v>) -> Option<Vec<(Value<'v>, Kind)>> {
        const RIGHT: &str = "write a list of kinds, such as [\"stuck-on\", \"stuck-off\"]";
        let values = value.list(RIGHT)?;
        if values.is_empty() {
            value.wrong("without a kind there is no fault", RIGHT);
        }
        let read: Vec<Option<_>> = values
            .into_iter()
            .map(|value| kind(&value, self.model).map(|kind| (value, kind)))
            .collect();
        read.into_iter().collect()
    }

    /// The faults of all kinds: of those in the file, or of all that fit.
    fn rows(&self, signals: &[usize], kinds: Option<Vec<(Value<'_>, Kind)>>) -> Option<Vec<Row>> {
        let Some(kinds) = kinds else {
            let usual = Kind::USUAL.map(|(_, kind)| kind).into_iter();
            return Some(usual.flat_map(|kind| self.rows_of(kind, signals)).collect());
        };
        let mut rows: Vec<Row> = Vec::new();
        for (value, kind) in kinds {
            let of_kind = self.rows_of(kind, signals);
            let label = kind.label();
            let is_there = |new: &Row| rows.iter().any(|row| row.name() == new.name());
            if of_kind.iter().any(is_there) {
                value.wrong(
                    format!("the kind \"{label}\" is there already"),
                    "remove it",
                );
                return None;
            }
            if of_kind.is_empty() {
                let right = match kind {
                    Kind::StationDown(_) => "this driver has one station: write \"line-down\"",
                    Kind::Noise(_, None) => "numbers need a strength: add amplitude = 2.5",
                    Kind::Model(..) if self.model.names().is_empty() => self.model.how_to_have(),
                    Kind::Model(..) => {
                        "name each: { kind = \"model\", name = \"leak\", value = 0.4 }"
                    }
                    _ => "remove it, or name other signals",
                };
                value.wrong(
                    format!("none of the signals can have the fault \"{label}\""),
                    right,
                );
                return None;
            }
            rows.extend(of_kind);
        }
        Some(rows)
    }

    /// The faults of one kind.
    fn rows_of(&self, kind: Kind, signals: &[usize]) -> Vec<Row> {
        let row = |subject: &str, disturbance| Row {
            subject: subject.to_owned(),
            kind: kind.label(),
            disturbances: vec![disturbance],
        };
        let all = &self.table.signals;
        let of_signals = signals.iter().filter_map(|index| {
            let disturbance = kind.of_signal(*index, &all[*index], self.step)?;
            Some(row(&all[*index].name, disturbance))
        });
        let mut rows: Vec<Row> = of_signals.collect();
        rows.extend(kind.of_line().map(|disturbance| row("", disturbance)));
        let of_model = |name: &String| Some(row(name, kind.of_model(name)?));
        rows.extend(self.model_faults(kind).iter().filter_map(of_model));
        if self.table.stations.len() > 1 {
            for (index, station) in self.table.stations.iter().enumerate() {
                rows.extend(
                    kind.of_station(index)
                        .map(|fault| row(&station.name, fault)),
                );
            }
        }
        rows
    }

    /// The faults of the machine's model that a kind means: one of them, or each that is on or off.
    fn model_faults(&self, kind: Kind) -> Vec<String> {
        match kind {
            Kind::Model(None, _) => self.model.switches(),
            Kind::Model(Some(place), _) => vec![self.model.names().swap_remove(place)],
            _ => Vec::new(),
        }
    }

    fn moments(&self, value: &Value<'_>) -> Option<Vec<Moments>> {
        let one = |value: &Value<'_>| {
            let step = value.as_text().and_then(|name| self.table.position(name));
            match step {
                Some(index) if self.table.signals[index].data_type != DataType::Bool => {
                    Some(vec![Moments::EachValue(index, value.place())])
                }
                _ => {
                    let named = self.one_named(value, MOMENTS)?;
                    Some(vec![Moments::First(named)])
                }
            }
        };
        if value.as_text().is_some() {
            return one(value);
        }
        if value.is_table() {
            let named = self.named(value, MOMENTS)?;
            return Some(named.into_iter().map(Moments::First).collect());
        }
        let list = value.list(MOMENTS)?;
        if list.is_empty() {
            value.wrong("an empty list has no moment", MOMENTS);
            return None;
        }
        let read: Vec<_> = list.iter().map(one).collect();
        let read: Option<Vec<_>> = read.into_iter().collect();
        Some(read?.concat())
    }

    /// A condition, a list of which each counts alone, or a table of names and conditions.
    fn named(&self, value: &Value<'_>, right: &str) -> Option<Vec<Named>> {
        if value.as_text().is_some() {
            return Some(vec![self.one_named(value, right)?]);
        }
        let read: Vec<Option<Named>> = if value.is_table() {
            let table = value.table("conditions", right)?;
            let mut entries: Vec<(&str, Value<'_>)> = table.all().collect();
            entries.sort_by_key(|(_, value)| value.at());
            let named = |(name, value): (&str, Value<'_>)| {
                let named = self.one_named(&value, right)?;
                if name.trim().is_empty() || name.chars().any(char::is_control) {
                    value.wrong(
                        format!("\"{}\" is no name for people", shown(name)),
                        "write a name of printable characters",
                    );
                    return None;
                }
                let name = name.to_owned();
                Some(Named { name, ..named })
            };
            entries.into_iter().map(named).collect()
        } else {
            let list = value.list(right)?;
            list.iter()
                .map(|value| self.one_named(value, right))
                .collect()
        };
        if read.is_empty() {
            value.wrong("an empty list demands nothing", right);
            return None;
        }
        read.into_iter().collect()
    }

    /// A condition, or a list of which all hold at the same tick.
    fn one_named(&self, value: &Value<'_>, right: &str) -> Option<Named> {
        let place: TextPosition = value.place();
        let values = match value.as_text() {
            Some(_) => vec![value.clone()],
            None => value.list(right)?,
        };
        if values.is_empty() {
            value.wrong("an empty list demands nothing", right);
            return None;
        }
        let texts: Vec<&str> = values.iter().filter_map(Value::as_text).collect();
        let name = texts.join(" and ");
        let all: Vec<Option<_>> = values.iter().map(|value| self.condition(value)).collect();
        let all: Option<Vec<_>> = all.into_iter().collect();
        let all = all?.into_iter().map(|(condition, _)| condition);
        Some(Named {
            name,
            all: all.collect(),
            place,
        })
    }

    /// Signals and conditions whose changes are the progress.
    fn goes_on(&self, value: &Value<'_>) -> Option<Vec<Mark>> {
        const RIGHT: &str = "write signals or conditions, such as [\"Step\", \"Cycles\"]";
        let values = match value.as_text() {
            Some(_) => vec![value.clone()],
            None => value.list(RIGHT)?,
        };
        if values.is_empty() {
            value.wrong("without a signal there is no progress", RIGHT);
            return None;
        }
        let read: Vec<Option<Mark>> = values.iter().map(|value| self.mark(value, RIGHT)).collect();
        read.into_iter().collect()
    }

    fn mark(&self, value: &Value<'_>, right: &str) -> Option<Mark> {
        let text = value.text(right)?;
        if let Some(index) = self.table.position(text) {
            return Some(Mark::Value(index));
        }
        if !text.contains(['<', '>', '=', '±']) && !text.starts_with("not ") && !is_edge(text) {
            value.refuse(unknown(text, self.table));
            return None;
        }
        let (condition, _) = self.condition(value)?;
        if condition.is_edge() {
            value.wrong(
                "an edge is over at once, and is no progress",
                "write the signal alone: each of its changes counts",
            );
            return None;
        }
        Some(Mark::Holds(condition, text.to_owned()))
    }
}

fn is_edge(text: &str) -> bool {
    let endings = [" rises", " falls", " changes"];
    endings.iter().any(|ending| text.ends_with(ending))
}

/// These faults, and each two of them of different signals or stations.
fn with_pairs(mut rows: Vec<Row>) -> Vec<Row> {
    for second in 1..rows.len() {
        for first in 0..second {
            if rows[first].subject != rows[second].subject {
                rows.push(rows[first].and(&rows[second]));
            }
        }
    }
    rows
}

/// Signals without those that are named twice, which are reported.
fn once(value: &Value<'_>, names: Vec<usize>) -> Vec<usize> {
    let mut signals = Vec::new();
    for index in names {
        if signals.contains(&index) {
            value.wrong("a signal is named twice", "name each once");
        } else {
            signals.push(index);
        }
    }
    signals
}

/// A kind of fault: its name, or a table with its numbers.
fn kind(value: &Value<'_>, faults: ModelFaults<'_>) -> Option<Kind> {
    if !value.is_table() {
        value.text(KIND)?;
        return value.choice("kinds", &Kind::USUAL);
    }
    let mut table = value.table("kinds", KIND)?;
    let name = table.require("kind", KIND);
    let usual = name.and_then(|name| name.choice("kinds", &Kind::USUAL));
    let Some(usual) = usual else {
        // Which keys it has depends on the kind.
        table.finish_open();
        return None;
    };
    let span =
        |value: Option<Value<'_>>, usual| value.map_or(Some(usual), |value| value.duration());
    let read = match usual {
        Kind::Late(by) => {
            let value = table.take("by");
            let at_most =
                |value: Value<'_>| value.duration_between(LEAST, "that is no time", LONGEST);
            value.map_or(Some(by), at_most).map(Kind::Late)
        }
        Kind::LineDown(by) => {
            let value = table.take("for");
            span(value, by).map(Kind::LineDown)
        }
        Kind::StationDown(by) => {
            let value = table.take("for");
            span(value, by).map(Kind::StationDown)
        }
        Kind::Noise(chance, _) => {
            let (given, amplitude) = (table.take("chance"), table.take("amplitude"));
            noise(chance, given, amplitude)
        }
        Kind::Model(..) => {
            let (name, value) = (table.take("name"), table.take("value"));
            model(name, value, faults)
        }
        plain => Some(plain),
    };
    table.finish();
    read
}

/// A fault of the machine's model, by its name; without a name each that is on or off.
fn model(
    name: Option<Value<'_>>,
    value: Option<Value<'_>>,
    faults: ModelFaults<'_>,
) -> Option<Kind> {
    let number = model_value(value.as_ref())?;
    let Some(place) = name else {
        if let Some(value) = value {
            let right = "add its name, or remove the value: without a name all are on or off";
            value.wrong("it is not said which fault has this value", right);
        }
        return Some(Kind::Model(None, 1.0));
    };
    let name = place.text("write the name of a fault of the machine")?;
    let checked = faults.check(name, number);
    checked.map_err(|mistake| place.refuse(mistake)).ok()?;
    let names = faults.names();
    let found = names.iter().position(|known| known == name)?;
    Some(Kind::Model(Some(found), number))
}

fn noise(usual: f64, chance: Option<Value<'_>>, amplitude: Option<Value<'_>>) -> Option<Kind> {
    const CHANCE: &str = "write a chance above 0 and up to 1, such as 0.1 for one tick in ten";
    const AMPLITUDE: &str = "write how far it goes to either side, above 0";
    let positive = |value: Value<'_>, most: f64, right: &str| {
        let number = value.number(right)?;
        if number > 0.0 && number <= most {
            return Some(number);
        }
        value.wrong(format!("{} is out of range", value.written()), right);
        None
    };
    let chance = chance.map_or(Some(usual), |value| positive(value, 1.0, CHANCE));
    let amplitude = match amplitude {
        None => Some(None),
        Some(value) => positive(value, f64::MAX, AMPLITUDE).map(Some),
    };
    Some(Kind::Noise(chance?, amplitude?))
}
