//! Prepares sources in Structured Text.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::chart::{chart, is_chart};
use super::check::{World, all_declarations};
use super::code::{Code, line_end};
use super::duration;
use super::edit::{Edits, Marks};
use super::library::{self, Addresses, SCHEDULE, Signal, TASK};
use super::outline::{Configuration, Outline, Section, UnitKind, declared};
use tickbus_base::toml_text::{Collector, shown};

const MARKS: Marks = Marks::StructuredText;

/// What the configuration says about when programs run.
#[derive(Debug, Default)]
pub(crate) struct Plan {
    pub(crate) signals: Vec<Signal>,
    /// The signal of each program, by its name in capitals.
    pub(crate) programs: BTreeMap<String, String>,
    /// The interval of the one task, in milliseconds.
    pub(crate) cycle: u32,
}

/// When the programs of a configuration run; what cannot be done is reported, and a remark returned.
pub(crate) fn plan(
    code: &Code<'_>,
    configuration: &Configuration,
    wrong: &Collector<'_>,
) -> (Plan, Option<String>) {
    let mut plan = Plan::default();
    if let Some(second) = configuration.resources.get(1) {
        let right = "put all tasks and programs into one resource";
        wrong.report(code.start(*second), "this is a second resource", right);
    }
    let mut tasks: BTreeMap<String, Signal> = BTreeMap::new();
    let mut shortest: Option<u32> = None;
    for task in &configuration.tasks {
        let report =
            |at: usize, what: String, right: &str| wrong.report(code.start(at), what, right);
        if let Some(at) = task.single {
            report(
                at,
                "this task starts at an event".to_owned(),
                "call its programs from a cyclic task",
            );
        }
        let Some(at) = task.interval else {
            report(
                task.name,
                "this task has no INTERVAL".to_owned(),
                "write INTERVAL := T#10ms",
            );
            continue;
        };
        match duration::milliseconds(code.word(at)) {
            Ok(interval) => {
                shortest = Some(shortest.map_or(interval, |shortest| shortest.min(interval)));
                let signal = Signal::new(Some(code.word(task.name)), Some(interval));
                tasks.insert(code.capitals(task.name), signal);
            }
            Err(why) => report(
                at,
                format!("the interval {} {why}", shown(code.word(at))),
                "write whole milliseconds, such as T#10ms: TIME has no more on many PLCs",
            ),
        }
    }
    plan.cycle = shortest.unwrap_or(10);
    if configuration.instances.is_empty() {
        let right = "write PROGRAM name WITH task : program;";
        wrong.report(
            code.start(configuration.name),
            "no program runs here",
            right,
        );
    }
    for instance in &configuration.instances {
        let signal = match instance.task.map(|at| (at, tasks.get(&code.capitals(at)))) {
            None => Signal::new(None, None),
            Some((_, Some(signal))) => signal.clone(),
            Some((at, None)) => {
                let is_there = (configuration.tasks.iter())
                    .any(|task| code.capitals(task.name) == code.capitals(at));
                if !is_there {
                    let what = format!("there is no task {}", shown(code.word(at)));
                    wrong.report(code.start(at), what, "write a TASK of that name before");
                }
                continue;
            }
        };
        if !plan.signals.contains(&signal) {
            plan.signals.push(signal.clone());
        }
        let before = (plan.programs).insert(code.capitals(instance.program), signal.name.clone());
        if before.is_some_and(|before| before != signal.name) {
            wrong.report(
                code.start(instance.program),
                format!("{} runs in two tasks", shown(code.word(instance.program))),
                "give each task a program of its own: its execution controller waits for one signal",
            );
        }
    }
    let note = order_note(code, configuration);
    (plan, note)
}

/// In one task programs run as listed: a remark where priorities said otherwise.
fn order_note(code: &Code<'_>, configuration: &Configuration) -> Option<String> {
    let priority = |task: Option<usize>| {
        let task = task.map(|at| code.capitals(at))?;
        let mut tasks = configuration.tasks.iter();
        let found = tasks.find(|one| code.capitals(one.name) == task)?;
        code.word(found.priority?).parse::<u32>().ok()
    };
    let priorities: Vec<u32> = (configuration.instances.iter())
        .filter_map(|one| priority(one.task))
        .collect();
    let is_mixed = !priorities.is_sorted();
    is_mixed.then(|| {
        "programs of one step run in the order in which the configuration lists them; here a program of higher priority \
         stands behind one of lower priority: list it first if it must run first"
            .to_owned()
    })
}

/// The changes of one source.
pub(crate) struct Preparation<'c, 't> {
    pub(crate) code: &'c Code<'t>,
    pub(crate) outline: &'c Outline,
    pub(crate) world: &'c World,
    pub(crate) plan: &'c Plan,
}

impl Preparation<'_, '_> {
    /// The timers whose types this source names, in capitals.
    pub(crate) fn timers(&self) -> BTreeSet<String> {
        let found = self.timer_types();
        found.into_iter().map(|at| self.code.capitals(at)).collect()
    }

    fn timer_types(&self) -> Vec<usize> {
        let types =
            all_declarations(self.outline).flat_map(|inner| declared(self.code, inner).types);
        types
            .filter(|at| self.world.is_timer(self.code.word(*at)))
            .collect()
    }

    /// The prepared source; `blocks` is put in at its beginning.
    pub(crate) fn text(&self, blocks: Option<&str>) -> String {
        let code = self.code;
        let mut edits = Edits::default();
        if let Some(blocks) = blocks {
            let mark = code.text.len() - code.text.trim_start_matches('\u{FEFF}').len();
            let end = code.line_end();
            let blocks = format!("{end}{}{end}", blocks.replace('\n', end));
            edits.insert(mark, blocks, MARKS);
        }
        for at in self.timer_types() {
            let name = format!("TICKBUS_{}", code.capitals(at));
            edits.replace(code.tokens[at].range(), name, MARKS);
        }
        for unit in &self.outline.units {
            let signal = self.plan.programs.get(&code.capitals(unit.name));
            if let (UnitKind::Program, Some(signal)) = (unit.kind, signal) {
                self.control(unit.name, &unit.body, signal, &mut edits);
            }
        }
        for configuration in &self.outline.configurations {
            self.configure(configuration, &mut edits);
        }
        edits.apply(code.text)
    }

    /// Puts an execution controller around the statements of a program.
    fn control(&self, name: usize, body: &Range<usize>, signal: &str, edits: &mut Edits) {
        let code = self.code;
        let end = code.line_end();
        let external = format!(
            "{end}  VAR_EXTERNAL{end}    tickbus_simulated : BOOL;{end}    {signal} : BOOL;{end}  END_VAR"
        );
        edits.insert(code.end(name), external, MARKS);
        if !is_chart(code, body) {
            wrap(code, body, signal, edits);
            return;
        }
        let chart = chart(code, body);
        for (_, body) in &chart.actions {
            wrap(code, body, signal, edits);
        }
        for condition in chart
            .transitions
            .iter()
            .filter_map(|one| one.condition.as_ref())
        {
            let gate = format!("({}) AND (", library::condition(signal));
            edits.insert(code.start(condition.start), gate, MARKS);
            edits.insert(code.end(condition.end - 1), ")", MARKS);
        }
    }

    fn configure(&self, configuration: &Configuration, edits: &mut Edits) {
        let code = self.code;
        let end = code.line_end();
        let mut globals = format!("{end}  VAR_GLOBAL{end}");
        for (name, kind, value) in library::globals(&self.plan.signals) {
            let value = if value.is_empty() {
                String::new()
            } else {
                format!(" := {value}")
            };
            globals += &format!("    {name} : {kind}{value};{end}");
        }
        globals += "  END_VAR";
        edits.insert(code.end(configuration.name), globals, MARKS);

        let task = format!(
            "TASK {TASK}(INTERVAL := T#{}ms, PRIORITY := 1);",
            self.plan.cycle
        );
        let first = configuration.instances[0].start;
        let indent = format!("{end}{}", indent(code, first));
        if let Some((one, others)) = configuration.tasks.split_first() {
            edits.replace(bytes(code, &one.whole), task, MARKS);
            for other in others {
                edits.replace(bytes(code, &other.whole), "", MARKS);
            }
        } else {
            edits.insert(code.start(first), format!("{task}{indent}"), MARKS);
        }
        let program = format!("PROGRAM tickbus_first WITH {TASK} : {SCHEDULE};{indent}");
        edits.insert(code.start(first), program, MARKS);
        for instance in &configuration.instances {
            match instance.task {
                Some(task) => edits.replace(code.tokens[task].range(), TASK, MARKS),
                None => edits.insert(code.end(instance.name), format!(" WITH {TASK}"), MARKS),
            }
        }
    }
}

fn bytes(code: &Code<'_>, range: &Range<usize>) -> Range<usize> {
    code.start(range.start)..code.end(range.end - 1)
}

/// The blanks before the token in its line, if nothing else stands there.
fn indent<'t>(code: &Code<'t>, at: usize) -> &'t str {
    let before = &code.text[..code.start(at)];
    let blanks = before.trim_end_matches([' ', '\t']).len();
    if before[..blanks].ends_with(['\n', '\r']) || blanks == 0 {
        &before[blanks..]
    } else {
        ""
    }
}

/// Puts the execution controller's header and footer around statements.
fn wrap(code: &Code<'_>, body: &Range<usize>, signal: &str, edits: &mut Edits) {
    if body.is_empty() {
        return;
    }
    let Some(bytes) = code.bytes(body) else {
        return;
    };
    let (header, footer) = header_and_footer(code.text, &bytes, signal);
    edits.insert(bytes.start, header, MARKS);
    edits.insert(bytes.end, footer, MARKS);
}

/// The execution controller around what stands in these bytes of a text.
pub(crate) fn header_and_footer(
    text: &str,
    bytes: &Range<usize>,
    signal: &str,
) -> (String, String) {
    let before = &text[..bytes.start];
    let blanks = before.trim_end_matches([' ', '\t']).len();
    let own_line = before[..blanks].ends_with(['\n', '\r']);
    let lines = if own_line {
        format!("{}{}", line_end(text), &before[blanks..])
    } else {
        " ".to_owned()
    };
    let header = format!("IF {} THEN{lines}", library::condition(signal));
    (header, format!("{lines}END_IF;"))
}

/// Reports addresses of the variables for the server at which the program has variables of its own.
pub(crate) fn check_addresses(
    code: &Code<'_>,
    sections: &[&Section],
    addresses: &Addresses,
    wrong: &Collector<'_>,
) {
    let taken = [&addresses.go, &addresses.ms, &addresses.done];
    for at in sections.iter().flat_map(|section| section.inner.clone()) {
        let own = code.word(at);
        let mut taken = taken.iter().filter_map(|one| one.as_ref());
        if own.starts_with('%') && taken.any(|one| one.eq_ignore_ascii_case(own)) {
            wrong.report(
                code.start(at),
                format!("the program has a variable at {own} already"),
                "name a free address for the server's variable",
            );
        }
    }
}
