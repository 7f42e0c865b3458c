//! Prepares sources in Structured Text.

use std::collections::BTreeSet;
use std::ops::Range;

use super::chart::{chart, is_chart};
use super::check::{World, all_declarations};
use super::code::{Code, line_end};
use super::edit::{Edits, Marks};
use super::lexer::Kind;
use super::library::{self, SCHEDULE, TASK};
use super::outline::{Configuration, Outline, UnitKind, declared};
use super::plan::{self, Named, Plan};
use super::pragma;
use tickbus_base::toml_text::Collector;

const MARKS: Marks = Marks::StructuredText;

/// The schedule of a configuration's programs; reports what is impossible, and returns a remark.
pub(crate) fn plan(
    code: &Code<'_>,
    configuration: &Configuration,
    wrong: &Collector<'_>,
) -> (Plan, Option<String>) {
    if let Some(second) = configuration.resources.get(1) {
        wrong.collect(code.start(*second), plan::second_resource());
    }
    let named = |at: usize| Named {
        text: code.word(at).to_owned(),
        at: code.start(at),
    };
    let tasks = configuration.tasks.iter().map(|task| plan::Task {
        name: named(task.name),
        interval: task.interval.map(named),
        single: task.single.map(|at| code.start(at)),
        priority: task.priority.and_then(|at| code.word(at).parse().ok()),
    });
    let instances = (configuration.instances.iter()).map(|instance| plan::Instance {
        task: instance.task.map(named),
        program: named(instance.program),
    });
    let (tasks, instances): (Vec<_>, Vec<_>) = (tasks.collect(), instances.collect());
    let start = code.start(configuration.name);
    plan::plan(start, &tasks, &instances, wrong)
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

    /// The prepared source, with `blocks` inserted at its beginning.
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
        for token in code.all.iter().filter(|token| token.kind == Kind::Pragma) {
            let unit = self.outline.unit_at(code, token.start);
            let text = &code.text[token.range()];
            let ours = unit.and_then(|unit| pragma::on_virtual_time(code.word(unit.name), text));
            if let Some(ours) = ours {
                edits.replace(token.range(), ours, MARKS);
            }
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

    /// Wraps the statements of a program in an execution controller.
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
            globals.extend(["    ", &name, " : ", kind, &value, ";", end]);
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

/// The blanks before the token in its line, if it is the first one there.
fn indent<'t>(code: &Code<'t>, at: usize) -> &'t str {
    let before = &code.text[..code.start(at)];
    let blanks = before.trim_end_matches([' ', '\t']).len();
    if before[..blanks].ends_with(['\n', '\r']) || blanks == 0 {
        &before[blanks..]
    } else {
        ""
    }
}

/// Adds the execution controller's header and footer to statements.
fn wrap(code: &Code<'_>, body: &Range<usize>, signal: &str, edits: &mut Edits) {
    // For iec2c pragmas alone are statements too; it accepts no empty statement next to them.
    let Some(bytes) = code.bytes(body) else {
        return;
    };
    let (header, footer) = header_and_footer(code.text, &bytes, signal);
    edits.insert(bytes.start, header, MARKS);
    edits.insert(bytes.end, footer, MARKS);
}

/// The execution controller around these bytes of a text.
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
