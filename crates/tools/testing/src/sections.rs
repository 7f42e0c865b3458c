//! The sections of a test file: the machine, the tests, their steps.

use std::path::Path;
use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Mistakes, Table, Value, shown};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::Role;
use tickbus_fieldbus::faults::{self, Effect, Fault, unknown};
use tickbus_image::signal::{Area, SignalTable, Slot};
use tickbus_reply::{self as reply, Condition, Reply, Rule, Signals, read_rule, texts};

use super::block::Counted;
use super::model_faults::ModelFaults;
use super::plant::{FmuKeys, Plant};
use super::playback::MachineRecording;
use super::test::{Passage, Step, Test, TextPosition, Unswallowed};
use super::unswallowed;

/// Conditions on signals, and that nothing is swallowed.
type Expectations = (Vec<(Condition, TextPosition)>, Vec<Unswallowed>);

/// The longest time that may pass in one step: ten minutes on a fast machine.
const MOST_TICKS: i128 = 1_000_000_000;

/// How long a button is pressed: about as long as by a finger, and longer than any scan.
const PRESS: Nanos = Nanos::from_millis(200);

/// The longest name of a test, in characters.
const NAME_LIMIT: usize = 200;

/// The longest hint, in characters.
const HINT_LIMIT: usize = 500;

/// The facts that reading the other sections depends on.
pub(super) struct Reader<'a> {
    pub(super) table: &'a SignalTable,
    pub(super) role: Role,
    pub(super) step: Nanos,
    pub(super) folder: &'a Path,
    pub(super) config: &'a Config,
    /// The faults of the machine, once it is read.
    pub(super) model: ModelFaults<'a>,
    /// The counted branches of a block.
    pub(super) counted: Option<&'a Counted>,
}

/// The machine in a test file.
#[derive(Default)]
pub(super) struct Machine {
    pub(super) initial: Vec<(usize, Slot)>,
    pub(super) rules: Vec<Rule>,
    /// All replies of the machine, if the test file adds some to those of the driver.cfg.
    pub(super) replies: Option<Vec<Reply>>,
    pub(super) tape: Option<MachineRecording>,
    pub(super) fmu: Option<Plant>,
    /// Mistakes in files that the section names.
    pub(super) elsewhere: Option<Mistakes>,
}

impl Reader<'_> {
    pub(super) fn machine(&self, mut table: Table<'_>) -> Machine {
        let set = table.take("set");
        let recording = table.take("recording");
        let compare = table.take("compare");
        let fmu = FmuKeys::take(&mut table);
        let rules = table.take("rule");
        let replies = table.take("reply");
        table.finish();
        if let (Some(value), None) = (&compare, &recording) {
            value.wrong(
                "\"compare\" stands without \"recording\"",
                "name the recording that the PLC is compared with, or remove it",
            );
        }
        let (fmu, elsewhere) = fmu.read(self.config, self.folder);
        let initial = self.assignments(set.as_ref());
        let rules = rules.map(|value| value.tables("[[machine.rule]]"));
        let rules = rules.into_iter().flatten();
        let condition = |value: &Value<'_>| self.condition(value).map(|(condition, _)| condition);
        let replies = replies.map(|value| self.replies(value.tables("[[machine.reply]]")));
        Machine {
            initial: initial.unwrap_or_default(),
            rules: rules
                .filter_map(|table| read_rule(table, self.signals(), condition))
                .collect(),
            replies,
            tape: recording.and_then(|value| self.tape(&value, compare.as_ref())),
            fmu,
            elsewhere,
        }
    }

    /// The replies of the driver.cfg, and those of the test file.
    fn replies(&self, sections: Vec<Table<'_>>) -> Vec<Reply> {
        if let (Some(first), Role::Controller) = (sections.first(), self.role) {
            first.wrong(
                "the driver.cfg is that of the PLC, and replies are made by the machine",
                "remove [[machine.reply]], or name the driver.cfg of the machine",
            );
            return Vec::new();
        }
        let mut taken = self.config.made_signals();
        for reply in &self.config.replies {
            let what = format!("the reply \"{}\" of the driver.cfg", shown(&reply.name));
            taken.extend(reply.outputs.iter().map(|signal| (*signal, what.clone())));
        }
        let scope = reply::Scope {
            table: self.table,
            writes: self.own(),
            tick: Some(self.step),
            taken: &taken,
            earlier: &self.config.replies,
        };
        reply::read_sections(sections, scope)
    }

    /// The area that the machine writes.
    pub(super) fn own(&self) -> Area {
        self.role.areas().0
    }

    fn tape(&self, value: &Value<'_>, compare: Option<&Value<'_>>) -> Option<MachineRecording> {
        let file = value.text("write the path of a recording, as seen from this file")?;
        let opened = MachineRecording::open(
            &self.folder.join(file),
            self.table,
            self.own(),
            value.place(),
        );
        let mut tape = opened.map_err(|mistake| value.refuse(mistake)).ok()?;
        let compared = match compare {
            None => Vec::new(),
            Some(value) => value.list("write a list of signals, such as [\"LA1 run\"]")?,
        };
        for value in compared {
            let name = value.text("write the name of a signal in quotes")?;
            let added = match self.table.position(name) {
                None => Err(unknown(name, self.table)),
                Some(index) => tape.compare(index, self.table),
            };
            if let Err(mistake) = added {
                value.refuse(mistake);
            }
        }
        Some(tape)
    }

    pub(super) fn test(&self, mut table: Table<'_>) -> Option<Test> {
        let place = table.collector().place(table.at());
        let name = table.require("name", "say in a sentence what is tested");
        let set = table.take("set");
        let hint = table.take("hint").and_then(|value| hint_of(&value));
        let steps = table.require("steps", "write the steps, such as [{ tick = 1 }]");
        table.finish();
        let name = name.and_then(|value| {
            let name = value.label(NAME_LIMIT, "say in a sentence what is tested");
            name.map(str::to_owned)
        });
        let initial = self.assignments(set.as_ref());
        let steps = steps.and_then(|value| {
            let mut steps = self.steps(&value)?;
            for step in &mut steps {
                step.hint = step.hint.take().or_else(|| hint.clone());
            }
            let timed = steps.iter().rposition(Step::takes_time);
            let timed = timed.map_or(0, |last| last + 1);
            let watches = |step: &Step| {
                let always = &step.always_unswallowed;
                !step.always.is_empty() || !step.never.is_empty() || !always.is_empty()
            };
            let proves = timed > 0 || steps.iter().any(|step| !step.expect.is_empty());
            if !steps.is_empty() && (!proves || steps[timed..].iter().any(watches)) {
                value.wrong(
                    "no time passes in which its conditions are checked: this test proves nothing",
                    "let time pass with or after \"always\" and \"never\", such as { never = \"Jam lamp\", run = \"1s\" }",
                );
            }
            Some(steps)
        });
        Some(Test {
            name: name?,
            place,
            initial: initial?,
            steps: steps?,
        })
    }

    /// The steps of a test or of a sweep's scenario.
    pub(super) fn steps(&self, value: &Value<'_>) -> Option<Vec<Step>> {
        let tables = value.tables("steps");
        if tables.is_empty() {
            value.wrong(
                "a test without steps proves nothing",
                "write some, such as [{ run = \"1s\" }, { expect = \"Ready lamp\" }]",
            );
        }
        let steps: Vec<_> = tables.into_iter().map(|table| self.step(table)).collect();
        let steps: Option<Vec<_>> = steps.into_iter().collect();
        Some(steps?.concat())
    }

    /// A step, or the steps of a table.
    fn step(&self, mut table: Table<'_>) -> Option<Vec<Step>> {
        let place = table.collector().place(table.at());
        if let Some(rows) = table.take("table") {
            for (key, value) in table.all().filter(|(key, _)| *key != "table") {
                let what = format!("\"{}\" stands beside \"table\" in one step", shown(key));
                value.wrong(what, "write a step for each");
            }
            let collector = table.collector();
            table.finish_open();
            return self.table_steps(&rows, collector);
        }
        let (set, force) = (table.take("set"), table.take("force"));
        let release = table.take("release");
        let (fault, end) = (table.take("fault"), table.take("end"));
        let passages = ["press", "tick", "run", "await"].map(|key| (key, table.take(key)));
        let within = table.take("within");
        let expect = table.take("expect");
        let during = table.take("during");
        let (always, never) = (table.take("always"), table.take("never"));
        let hint = table.take("hint").and_then(|value| hint_of(&value));
        if table.all().all(|(key, _)| key == "hint") {
            table.wrong(
                "a step without anything to do",
                "write such as { run = \"1s\" }",
            );
        }
        table.finish();

        let given: Vec<_> = passages
            .iter()
            .filter_map(|(key, value)| Some((*key, value.as_ref()?)))
            .collect();
        if let [(first, _), (key, value), ..] = given[..] {
            value.wrong(
                format!("\"{key}\" stands beside \"{first}\" in one step"),
                "write a step for each",
            );
        }
        let passage = given
            .first()
            .map(|(key, value)| self.passage(key, value, within.as_ref()));
        if let (Some(value), false) = (&within, given.iter().any(|(key, _)| *key == "await")) {
            value.wrong(
                "\"within\" stands without \"await\"",
                "add the condition that is waited for, or remove it",
            );
        }
        if let (Some(value), None) = (&during, &expect) {
            value.wrong(
                "\"during\" stands without \"expect\"",
                "add what is expected for so long, or write run",
            );
        }
        let set = self.assignments(set.as_ref());
        let force = self.assignments(force.as_ref());
        let release = release.map_or(Some(Vec::new()), |value| self.names(&value));
        let inject = fault.map_or(Some(Vec::new()), |value| self.faults(&value));
        let end = end.map_or(Some(Vec::new()), |value| ended(&value));
        let expect = self.expectations(expect.as_ref());
        let during = during.map_or(Some(0), |value| self.ticks(&value, true));
        let (always, never) = (
            self.expectations(always.as_ref()),
            self.conditions(never.as_ref()),
        );
        let passage = match passage {
            None => None,
            Some(passage) => Some(passage?),
        };
        let (expect, unswallowed) = expect?;
        let (always, always_unswallowed) = always?;
        Some(vec![Step {
            place,
            row: None,
            hint,
            set: set?,
            force: force?,
            release: release?,
            inject: inject?,
            end: end?,
            passage,
            expect,
            unswallowed,
            during: during?,
            always,
            always_unswallowed,
            never: never?,
        }])
    }

    fn passage(&self, key: &str, value: &Value<'_>, within: Option<&Value<'_>>) -> Option<Passage> {
        match key {
            "press" => {
                let name = value.text("write the name of a push button in quotes")?;
                let signal = self.settable(value, name)?;
                let ticks = PRESS.0.div_euclid(self.step.0) + 1;
                Some(Passage::Press(signal, u64::try_from(ticks).ok()?))
            }
            "tick" => {
                let ticks = value.whole(1..=MOST_TICKS)?;
                Some(Passage::Ticks(u64::try_from(ticks).ok()?))
            }
            "run" => self.ticks(value, true).map(Passage::Ticks),
            _ => {
                let conditions = self.conditions(Some(value));
                let Some(within) = within else {
                    value.wrong(
                        "\"await\" has no \"within\"",
                        "add the limit, such as within = \"3s\", or within = 40 for ticks",
                    );
                    return None;
                };
                let limit = self.ticks(within, false);
                Some(Passage::Await(conditions?, limit?))
            }
        }
    }

    /// A span of simulation time in ticks: a number of ticks, or a duration, rounded up or down.
    pub(super) fn ticks(&self, value: &Value<'_>, up: bool) -> Option<u64> {
        if value.as_text().is_none() {
            return u64::try_from(value.whole(1..=MOST_TICKS)?).ok();
        }
        let span = value.duration()?;
        let whole = span.0 / self.step.0;
        let ticks = whole + i64::from(up && span.0 % self.step.0 != 0);
        if ticks < 1 {
            value.wrong(
                format!("{span} is shorter than one tick of {}", self.step),
                "write a longer time, or a shorter step at the top of the file",
            );
            return None;
        }
        if i128::from(ticks) > MOST_TICKS {
            value.wrong(
                format!("{span} is {ticks} ticks of {}", self.step),
                format!("write at most {MOST_TICKS} ticks, or a longer step"),
            );
            return None;
        }
        u64::try_from(ticks).ok()
    }

    /// The signals that conditions and values name.
    fn signals(&self) -> Signals<'_> {
        Signals {
            table: self.table,
            writes: self.own(),
        }
    }

    /// A signal that this end writes, by its name.
    fn settable(&self, value: &Value<'_>, name: &str) -> Option<usize> {
        self.signals().settable(value, name)
    }

    /// `{ "Start button" = true }`: signals and their values.
    fn assignments(&self, value: Option<&Value<'_>>) -> Option<Vec<(usize, Slot)>> {
        self.signals().assignments(value)
    }

    /// One name or a list of them.
    pub(super) fn names(&self, value: &Value<'_>) -> Option<Vec<usize>> {
        const RIGHT: &str = "write the name of a signal in quotes, or a list of names";
        let name = |value: &Value<'_>| self.settable(value, value.text(RIGHT)?);
        if value.as_text().is_some() {
            return name(value).map(|name| vec![name]);
        }
        let read: Vec<_> = value.list(RIGHT)?.iter().map(name).collect();
        read.into_iter().collect()
    }

    /// One fault or a list of them.
    fn faults(&self, value: &Value<'_>) -> Option<Vec<(Fault, TextPosition)>> {
        const RIGHT: &str =
            "write a fault, such as { kind = \"stuck\", signal = \"LA1 bottom\", value = true }";
        let values = if value.is_table() {
            vec![value.clone()]
        } else {
            value.list(RIGHT)?
        };
        let fault = |value: Value<'_>| {
            let section = value.table("fault", RIGHT)?;
            // The mistakes of an unreadable section were reported.
            let fault = faults::read_sections(vec![section], Some(self.table.into())).pop()?;
            if let Effect::Model(number) = fault.effect {
                let checked = self.model.check(&fault.name, number);
                checked.map_err(|mistake| value.refuse(mistake)).ok()?;
            }
            Some((fault, value.place()))
        };
        let read: Vec<_> = values.into_iter().map(fault).collect();
        read.into_iter().collect()
    }

    /// A condition, a list of them, or a table of signals and values.
    fn conditions(&self, value: Option<&Value<'_>>) -> Option<Vec<(Condition, TextPosition)>> {
        let Some(value) = value else {
            return Some(Vec::new());
        };
        let one = |value: &Value<'_>| self.condition(value).map(|(condition, _)| condition);
        let read = self.signals().conditions(value, one)?.into_iter();
        Some(
            read.map(|(condition, value)| (condition, value.place()))
                .collect(),
        )
    }

    /// Conditions, among which may be that nothing is swallowed.
    fn expectations(&self, value: Option<&Value<'_>>) -> Option<Expectations> {
        let (mut plain, mut unswallowed) = (Vec::new(), Vec::new());
        let values = match value {
            Some(value) if !value.is_table() => texts(value)?,
            other => return Some((self.conditions(other)?, unswallowed)),
        };
        let mut is_right = true;
        for value in values {
            let text = value.as_text();
            match text.and_then(|text| unswallowed::signals_of(text, self.table)) {
                None => match self.condition(&value) {
                    Some(condition) => plain.push(condition),
                    None => is_right = false,
                },
                Some(Ok(signals)) => unswallowed.push(Unswallowed {
                    signals,
                    place: value.place(),
                }),
                Some(Err(mistake)) => {
                    value.refuse(mistake);
                    is_right = false;
                }
            }
        }
        is_right.then_some((plain, unswallowed))
    }

    pub(super) fn condition(&self, value: &Value<'_>) -> Option<(Condition, TextPosition)> {
        let text = value.text("write a condition in quotes, such as \"Phase == 3\"")?;
        match Condition::parse(text, self.table) {
            Ok(condition) => Some((condition, value.place())),
            Err(_) if unswallowed::is_meant(text) => {
                value.refuse(unswallowed::mistake(text, self.table));
                None
            }
            Err(mistake) => {
                value.refuse(mistake);
                None
            }
        }
    }
}

/// The sentence for a program that fails here.
fn hint_of(value: &Value<'_>) -> Option<Arc<str>> {
    let text = value.label(
        HINT_LIMIT,
        "say in a sentence what is missing in the program",
    );
    text.map(Arc::from)
}

/// Names of faults: one, or a list of them.
fn ended(value: &Value<'_>) -> Option<Vec<(String, TextPosition)>> {
    const RIGHT: &str = "write the name of a fault in quotes, or a list of names";
    let values = match value.as_text() {
        Some(_) => vec![value.clone()],
        None => value.list(RIGHT)?,
    };
    let name = |value: Value<'_>| Some((value.text(RIGHT)?.to_owned(), value.place()));
    let read: Vec<_> = values.into_iter().map(name).collect();
    read.into_iter().collect()
}
