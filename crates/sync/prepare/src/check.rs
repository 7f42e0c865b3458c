//! Checks for constructs that cannot be put on virtual time.

use std::collections::HashSet;
use std::ops::Range;

use super::addresses;
use super::chart::{Chart, chart, is_chart};
use super::code::Code;
use super::cycle;
use super::lexer::Kind;
use super::library::Addresses;
use super::outline::{Outline, Unit, UnitKind, declared};
use super::pragma;
use super::words;
use tickbus_base::toml_text::{Collector, shown};

/// The names that the sources themselves declare, in capitals, and those that the user vouches for.
#[derive(Debug, Default)]
pub(crate) struct World {
    /// Types, function blocks, functions and programs.
    pub(crate) types: HashSet<String>,
    /// Global variables.
    pub(crate) globals: HashSet<String>,
    /// The names that the user vouches for; their pragmas read no clock, either.
    pub(crate) vouched: HashSet<String>,
}

impl World {
    /// Adds the names that the user vouches for.
    pub(crate) fn vouch<'n>(&mut self, names: impl IntoIterator<Item = &'n String>) {
        let names = names.into_iter().map(|name| name.to_uppercase());
        self.vouched.extend(names);
        self.types.extend(self.vouched.iter().cloned());
    }

    /// Adds the declarations of a source.
    pub(crate) fn add(&mut self, code: &Code<'_>, outline: &Outline) {
        for unit in &outline.units {
            self.types.insert(code.capitals(unit.name));
        }
        for inner in &outline.types {
            let found = declared(code, inner.clone());
            self.types
                .extend(found.names.iter().map(|at| code.capitals(*at)));
        }
        for section in all_globals(outline) {
            let found = declared(code, section);
            self.globals
                .extend(found.names.iter().map(|at| code.capitals(*at)));
        }
    }

    /// True if a type is one of the timers to replace, and not declared by the sources themselves.
    pub(crate) fn is_timer(&self, name: &str) -> bool {
        let name = name.to_uppercase();
        words::TIMERS.contains(&name.as_str()) && !self.types.contains(&name)
    }
}

/// The declarations between `VAR_GLOBAL` and `END_VAR`, wherever they are.
pub(crate) fn all_globals(outline: &Outline) -> impl Iterator<Item = Range<usize>> {
    let inner = outline.configurations.iter().flat_map(|one| &one.globals);
    let sections = outline.globals.iter().chain(inner);
    sections.map(|section| section.inner.clone())
}

/// Everything that declares variables or types.
pub(crate) fn all_declarations(outline: &Outline) -> impl Iterator<Item = Range<usize>> {
    let units = outline.units.iter().flat_map(|unit| {
        let sections = unit.sections.iter();
        sections.map(|section| section.inner.clone())
    });
    let types = outline.types.iter().cloned();
    all_globals(outline).chain(units).chain(types)
}

/// Reports everything in a source that cannot be prepared.
pub(crate) fn check(code: &Code<'_>, outline: &Outline, world: &World, wrong: &Collector<'_>) {
    check_words(code, wrong);
    for pragma in code.all.iter().filter(|token| token.kind == Kind::Pragma) {
        let unit = outline.unit_at(code, pragma.start);
        let function = unit.map(|unit| code.word(unit.name));
        let text = &code.text[pragma.range()];
        if function.is_none_or(|name| pragma::on_virtual_time(name, text).is_none()) {
            check_pragma(text, code.base + pragma.start, function, world, wrong);
        }
    }
    let cycled = cycle::types(code, outline);
    for inner in all_declarations(outline) {
        for at in declared(code, inner).types {
            if cycled.contains(&at) && !world.types.contains(&code.capitals(at)) {
                continue;
            }
            check_type(code.word(at), code.start(at), world, wrong);
        }
    }
    let types = outline.types.iter();
    let types = types.flat_map(|inner| declared(code, inner.clone()).names);
    for at in outline.units.iter().map(|unit| unit.name).chain(types) {
        check_name(code.word(at), code.start(at), wrong);
    }
    for unit in &outline.units {
        for at in unit.returns.clone().filter(|at| code.is_word(*at)) {
            check_type(code.word(at), code.start(at), world, wrong);
        }
        check_unit(code, unit, world, wrong);
    }
}

/// Reports a pragma, at a byte of the file and in this unit, that is unknown code.
pub(crate) fn check_pragma(
    text: &str,
    at: usize,
    unit: Option<&str>,
    world: &World,
    wrong: &Collector<'_>,
) {
    if pragma::reads_clock(text) {
        wrong.report(
            at,
            "this pragma reads the time of the PLC",
            "use a TON, TOF, TP or RTC",
        );
    } else if pragma::is_code(text) {
        let what = "this pragma holds code, which may read the clock of the PLC";
        match unit {
            Some(unit) if world.vouched.contains(&unit.to_uppercase()) => {}
            Some(unit) => wrong.report(
                at,
                what,
                format!("if it reads no clock, name the unit: --no-clock {unit}"),
            ),
            None => wrong.report(at, what, "take it out"),
        }
    }
}

/// Reports comments within comments that can be read in two ways, and reserved names.
pub(crate) fn check_words(code: &Code<'_>, wrong: &Collector<'_>) {
    for token in &code.all {
        let text = &code.text[token.range()];
        match token.kind {
            Kind::Comment if code.is_in_doubt && text.len() > 2 && text.starts_with("(*") => {
                if let Some(at) = text[2..].find("(*") {
                    wrong.report(
                        code.base + token.start + 2 + at,
                        "a comment begins within a comment, and compilers disagree where the outer one ends",
                        "take out the (*, or say how your compiler reads it: --comments flat ends it at the first *), --comments nested at its own",
                    );
                }
            }
            Kind::Word if words::is_put_in(text) => wrong.report(
                code.base + token.start,
                format!("the name {} is reserved by tickbus", shown(text)),
                "a program that was synchronised by hand needs no preparing; otherwise choose another name",
            ),
            _ => {}
        }
    }
}

/// Reports addresses that the program and the server's variables share; returns remarks about possibly shared ones.
pub(crate) fn check_addresses(
    code: &Code<'_>,
    settings: &Addresses,
    wrong: &Collector<'_>,
) -> Vec<String> {
    let all = (0..code.tokens.len()).filter(|at| code.kind(*at) == Some(Kind::Address));
    all.filter_map(|at| addresses::check(code.word(at), code.start(at), settings, wrong))
        .collect()
}

/// Reports the name of a type or program, declared at a byte of the file, that an inserted variable has too.
pub(crate) fn check_name(name: &str, at: usize, wrong: &Collector<'_>) {
    if words::is_variable_put_in(name) {
        let what = format!("tickbus puts in a variable named {}, too", shown(name));
        wrong.report(
            at,
            what,
            "choose another name for this type or program: compilers take one for the other",
        );
    }
}

/// Reports a type, named at a byte of the file, that uses a clock, or may use one.
pub(crate) fn check_type(name: &str, at: usize, world: &World, wrong: &Collector<'_>) {
    let is_own = world.types.contains(&name.to_uppercase());
    if is_own || world.is_timer(name) || words::is_standard_type(name) {
        return;
    }
    if words::is_clock(name) {
        wrong.report(
            at,
            format!("{} runs on a clock of its own", shown(name)),
            format!(
                "use TON, TOF, TP or RTC, or a block of your own that is built from them; a PID whose calls set CYCLE is \
                 accepted; another block that takes its cycle as an input has to be named: --no-clock {}",
                shown(name)
            ),
        );
    } else {
        wrong.report(
            at,
            format!("the type {} is in none of these sources", shown(name)),
            "also pass its source file; if it comes from a library and uses no clock, name it with --no-clock",
        );
    }
}

/// The names of a unit's variables, in capitals.
pub(crate) fn variables(code: &Code<'_>, unit: &Unit) -> HashSet<String> {
    let sections = unit.sections.iter();
    let names = sections.flat_map(|section| declared(code, section.inner.clone()).names);
    names.map(|at| code.capitals(at)).collect()
}

fn check_unit(code: &Code<'_>, unit: &Unit, world: &World, wrong: &Collector<'_>) {
    let mut known = variables(code, unit);
    if is_chart(code, &unit.body) {
        let chart = chart(code, &unit.body);
        check_chart(code, unit, &chart, wrong);
        known.extend(chart.actions.iter().map(|(name, _)| code.capitals(*name)));
        let conditions = chart
            .transitions
            .iter()
            .filter_map(|one| one.condition.clone());
        let bodies = chart.actions.iter().map(|(_, body)| body.clone());
        for body in conditions.chain(bodies) {
            check_statements(code, &body, &known, world, wrong);
        }
    } else {
        check_statements(code, &unit.body, &known, world, wrong);
        let parts = ["END_STEP", "END_TRANSITION", "END_ACTION"];
        if let Some(part) = (unit.body.clone()).find(|at| code.is_any(*at, &parts)) {
            let what = format!("{} stands among statements", shown(code.word(part)));
            let right =
                "put the statements into actions of the chart, or the chart into a function block";
            wrong.report(code.start(part), what, right);
        }
    }
}

/// Reports clocks that statements read, and calls that may read one.
pub(crate) fn check_statements(
    code: &Code<'_>,
    body: &Range<usize>,
    known: &HashSet<String>,
    world: &World,
    wrong: &Collector<'_>,
) {
    if !body.is_empty() && is_instructions(code, body.start) {
        wrong.report(
            code.start(body.start),
            "these statements are in IL",
            "write them in Structured Text",
        );
        return;
    }
    for at in body.clone() {
        if !code.is_word(at) || code.word(at + 1) != "(" {
            continue;
        }
        let name = code.capitals(at);
        if at > body.start && code.word(at - 1) == "." {
            // timer.TON(...) of TIA Portal; other members are blocks, and their types were checked.
            if words::TIMERS.contains(&name.as_str()) {
                wrong.report(
                    code.start(at),
                    format!(
                        "this calls the {} of a timer of TIA Portal",
                        shown(code.word(at))
                    ),
                    "declare an instance of TON, TOF or TP, and call that",
                );
            } else if words::is_clock(&name) {
                wrong.report(code.start(at), reads_clock(code.word(at)), MEASURE);
            } else {
                check_chain(code, at, known, world, wrong);
            }
            continue;
        }
        let is_own = known.contains(&name) || world.types.contains(&name);
        if is_own
            || world.globals.contains(&name)
            || words::is_keyword(&name)
            || words::is_standard_function(&name)
        {
            continue;
        }
        if words::is_clock(&name) {
            wrong.report(code.start(at), reads_clock(code.word(at)), MEASURE);
        } else {
            wrong.report(
                code.start(at),
                format!("{} is in none of these sources", shown(code.word(at))),
                "also pass its source file; if it comes from a library and reads no clock, name it with --no-clock",
            );
        }
    }
}

pub(crate) const MEASURE: &str = "measure with a TON, whose ET is virtual time";

pub(crate) fn reads_clock(name: &str) -> String {
    format!("{}() reads the clock of the PLC", shown(name))
}

/// Reports a call behind a dot, at `at`, whose first name is not declared here: it may come from a library.
fn check_chain(
    code: &Code<'_>,
    at: usize,
    known: &HashSet<String>,
    world: &World,
    wrong: &Collector<'_>,
) {
    // array[1].block.inner(...)
    let mut first = at;
    while code.word(first.wrapping_sub(1)) == "." && first >= 2 {
        first -= 2;
        while first > 0 && matches!(code.word(first), "^" | "]" | ")") {
            if code.word(first) != "^" {
                first = code.opening(first);
            }
            first = first.saturating_sub(1);
        }
    }
    let name = code.capitals(first);
    let is_own = known.contains(&name)
        || world.globals.contains(&name)
        || world.types.contains(&name)
        || name == "THIS";
    if !is_own {
        wrong.report(
            code.start(first),
            format!("{} is not declared in these sources", shown(code.word(first))),
            "also pass the source file that declares it; if it is a list of variables or a library that reads no clock, name it with --no-clock",
        );
    }
}

/// Reports calls of programs that a task runs: their execution controllers wait for the signal of that task.
pub(crate) fn check_callers(
    code: &Code<'_>,
    body: &Range<usize>,
    known: &HashSet<String>,
    is_run: impl Fn(&str) -> bool,
    wrong: &Collector<'_>,
) {
    for at in body.clone() {
        let name = code.capitals(at);
        if code.is_word(at)
            && matches!(code.word(at + 1), "(" | ".")
            && code.word(at.wrapping_sub(1)) != "."
            && !known.contains(&name)
            && is_run(&name)
            && (code.word(at + 1) == "(" || code.word(at + 3) == "(")
        {
            wrong.report(
                code.start(at),
                format!("{} is called here, and a task runs it too", shown(code.word(at))),
                "call it or give it a task, not both: its execution controller waits for one signal",
            );
        }
    }
}

/// True if the token begins an instruction in IL, or a label of one.
fn is_instructions(code: &Code<'_>, at: usize) -> bool {
    let operand = matches!(
        code.kind(at + 1),
        Some(Kind::Word | Kind::Literal | Kind::Address | Kind::Text)
    );
    let is_label = code.is_word(at) && code.word(at + 1) == ":";
    is_label || (code.is_any(at, words::INSTRUCTIONS) && operand)
}

fn check_chart(code: &Code<'_>, unit: &Unit, chart: &Chart, wrong: &Collector<'_>) {
    let steps: HashSet<String> = chart.steps.iter().map(|at| code.capitals(*at)).collect();
    if let Some(stray) = chart.stray {
        let what = format!(
            "{} stands in a chart, outside of its parts",
            shown(code.word(stray))
        );
        let right = "put statements into an ACTION";
        wrong.report(code.start(stray), what, right);
    }
    let actions: HashSet<String> = (chart.actions.iter())
        .map(|(name, _)| code.capitals(*name))
        .collect();
    for (action, qualifier) in &chart.associations {
        let Some(at) = *qualifier else { continue };
        if code.is_any(at, &["L", "D", "SD", "DS", "SL"]) {
            wrong.report(
                code.start(at),
                format!("the PLC times this {} itself", code.word(at)),
                "use the qualifier N, and a TON that the action calls",
            );
        }
        // Charts of programs are gated; those of blocks stop as a whole when they are not called.
        if code.is_any(at, &["P", "P0", "P1"])
            && unit.kind == UnitKind::Program
            && !actions.contains(&code.capitals(*action))
        {
            wrong.report(
                code.start(at),
                format!(
                    "{} would be on for a cycle of the PLC, not for one of its task",
                    shown(code.word(*action))
                ),
                "give it an ACTION with statements",
            );
        }
    }
    for transition in &chart.transitions {
        if transition.condition.is_none() {
            wrong.report(
                code.start(transition.start),
                "the condition of this transition is not in Structured Text",
                "write FROM step TO step := condition;",
            );
        }
    }
    for at in unit.body.clone() {
        let is_time = code.word(at + 1) == "." && code.is(at + 2, "T");
        if is_time && steps.contains(&code.capitals(at)) {
            wrong.report(
                code.start(at),
                format!("the PLC measures {}.T itself", code.word(at)),
                "measure with a TON that the step's action calls",
            );
        }
    }
}
