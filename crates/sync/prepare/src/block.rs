//! A function block or function alone: its declarations, and a program around it whose located variables are its inputs
//! and outputs.
//!
//! `iec2c` compiles whole projects only. [`Block::find`] reads the sources, and [`Block::wrap`] writes them again without
//! their programs and configurations, line by line where they were, followed by a program that calls the block once per
//! scan. With counting, each branch of the block sets one bit of a located variable when it is taken.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::ops::Range;

use super::branches::{self, Branch};
use super::code::Code;
use super::interface::{Variable, declarations, is_among, variables};
use super::outline::{self, Outline, Section, UnitKind};
use super::wrapper::{Wired, Wrapper};
use super::{Source, decode, with_lines};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Mistakes, PlacedMistake};

/// A block with a program around it.
#[derive(Clone, Debug, PartialEq)]
pub struct Wrapped {
    /// The program, for `iec2c`.
    pub text: String,
    /// The block's signals.
    pub signals: Vec<Wired>,
    /// The signals whose bits are the branches, in their order.
    pub counters: Vec<Wired>,
    /// The lines of `text` that a source takes, one range for each: the first line of the text is 1.
    pub lines: Vec<Range<usize>>,
}

/// Why there is no such block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoBlock {
    /// A source cannot be read.
    Unreadable(Mistakes),
    /// No source has a block or function of this name; these they have.
    Unknown(Vec<String>),
}

/// A function block or function of some sources.
#[derive(Clone, Debug)]
pub struct Block {
    /// The name as declared.
    pub name: String,
    /// The source that declares the block, by its place in the list.
    pub source: usize,
    /// The interface: inputs, outputs and the result.
    pub variables: Vec<Variable>,
    /// The branches in the block's statements.
    pub branches: Vec<Branch>,
    is_function: bool,
    /// The sources without programs and configurations.
    texts: Vec<String>,
    /// The global variables of all sources.
    globals: String,
}

impl Block {
    /// Finds the function block or function called `name`, in any case.
    ///
    /// # Errors
    ///
    /// A source cannot be read, or none has the block.
    pub fn find(sources: &[Source], name: &str) -> Result<Self, NoBlock> {
        let texts: Vec<String> = sources
            .iter()
            .map(|source| with_lines(&decode(&source.bytes).0).into_owned())
            .collect();
        let codes: Vec<Code<'_>> = texts.iter().map(|text| Code::new(text)).collect();
        let mut outlines = Vec::new();
        for (source, code) in sources.iter().zip(&codes) {
            let outline = outline::outline(code).map_err(|(at, mistake)| {
                let place = Some(Collector::new(&source.name, code.text).place(at));
                let list = vec![PlacedMistake { place, mistake }];
                NoBlock::Unreadable(Mistakes::of_list(&source.name, list))
            })?;
            outlines.push(outline);
        }
        let read = || codes.iter().zip(&outlines).enumerate();
        let units = read().flat_map(|(index, (code, outline))| {
            let units = outline.units.iter();
            let blocks = units.filter(|unit| unit.kind != UnitKind::Program);
            blocks.map(move |unit| (index, code, unit))
        });
        let units: Vec<_> = units.collect();
        let found = units
            .iter()
            .find(|(_, code, unit)| code.is(unit.name, name));
        let Some((source, code, unit)) = found else {
            let names = units
                .iter()
                .map(|(_, code, unit)| code.word(unit.name).to_owned());
            return Err(NoBlock::Unknown(names.collect()));
        };
        let mut types = HashMap::new();
        for (_, (code, outline)) in read() {
            for inner in &outline.types {
                for declared in declarations(code, inner.clone()) {
                    for name in declared.names {
                        types.insert(code.capitals(name), (code, declared.kind.clone()));
                    }
                }
            }
        }
        let globals = read().map(|(_, (code, outline))| globals(code, outline));
        let stripped = read().map(|(_, (code, outline))| stripped(code, outline));
        Ok(Self {
            name: code.word(unit.name).to_owned(),
            source: *source,
            variables: variables(code, unit, &types),
            branches: branches::branches(code, &unit.body),
            is_function: unit.kind == UnitKind::Function,
            globals: globals.collect(),
            texts: stripped.collect(),
        })
    }

    /// The variables of which no signal can be made, without those that are left out on purpose.
    pub fn unfit<'b>(&'b self, without: &'b [String]) -> impl Iterator<Item = &'b Variable> {
        let unfit = self.variables.iter().filter(|one| one.elementary.is_none());
        unfit.filter(|one| !is_among(without, &one.name))
    }

    /// Writes a program around the block, which runs every `interval`; the variables in `without` get no signal. With
    /// `counted`, the block's branches are counted.
    pub fn wrap(&self, without: &[String], interval: Nanos, counted: bool) -> Wrapped {
        let mut made = Wrapper::default();
        let mut arguments = Vec::new();
        for (number, variable) in self.variables.iter().enumerate() {
            let signal = variable.elementary;
            let signal = signal.filter(|_| !is_among(without, &variable.name));
            arguments.extend(made.wire(number, variable, signal, self.is_function));
        }
        let arguments = arguments.join(", ");
        let call = if self.is_function {
            format!("TickbusR := {}({arguments});", self.name)
        } else {
            let _ = writeln!(made.own, "  TickbusB : {};", self.name);
            format!("TickbusB({arguments});")
        };
        let branches = if counted { &self.branches[..] } else { &[] };
        for number in 0..branches.len().div_ceil(branches::BITS) {
            made.count(number);
        }

        let (mut text, mut lines, mut line) = (String::new(), Vec::new(), 1);
        for (index, source) in self.texts.iter().enumerate() {
            if index == self.source {
                let counters = made.counters.iter().map(|one| one.address.clone());
                let counters: Vec<String> = counters.collect();
                text.push_str(&branches::counted(source, branches, &counters));
            } else {
                text.push_str(source);
            }
            if !source.ends_with('\n') {
                text.push('\n');
            }
            let next = text.matches('\n').count() + 1;
            lines.push(line..next);
            line = next;
        }
        text.push_str("PROGRAM TickbusBlock\n");
        for section in [&made.located, &made.own] {
            if !section.is_empty() {
                let _ = writeln!(text, "VAR\n{section}END_VAR");
            }
        }
        let (before, after) = (&made.before, &made.after);
        let globals = &self.globals;
        let cycle = short_milliseconds(interval);
        let _ = write!(
            text,
            "{before}{call}\n{after}END_PROGRAM\n\
             CONFIGURATION TickbusConfiguration\n{globals}  RESOURCE TickbusResource ON PLC\n    \
             TASK TickbusTask(INTERVAL := T#{cycle}ms, PRIORITY := 0);\n    \
             PROGRAM TickbusInstance WITH TickbusTask : TickbusBlock;\n  END_RESOURCE\nEND_CONFIGURATION\n"
        );
        Wrapped {
            text,
            signals: made.signals,
            counters: made.counters,
            lines,
        }
    }
}

/// A duration as `iec2c` reads it behind `T#`, without its unit.
fn short_milliseconds(interval: Nanos) -> String {
    let (whole, part) = (interval.0 / 1_000_000, interval.0 % 1_000_000);
    let text = format!("{whole}.{part:06}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// The bytes of a section, from its keyword to `END_VAR`.
fn whole(code: &Code<'_>, section: &Section) -> Range<usize> {
    code.start(section.inner.start - 1)..code.end(section.inner.end)
}

/// The global variables of a source, without their addresses.
fn globals(code: &Code<'_>, outline: &Outline) -> String {
    let of_configurations = outline.configurations.iter().flat_map(|one| &one.globals);
    let mut text = String::new();
    for section in outline.globals.iter().chain(of_configurations) {
        let mut kept = whole(code, section).start;
        let end = whole(code, section).end;
        for at in section.inner.clone().filter(|at| code.is(*at, "AT")) {
            text.push_str(&code.text[kept..code.start(at)]);
            kept = code.end(at + 1);
        }
        text.push_str(&code.text[kept..end]);
        text.push('\n');
    }
    text
}

/// The source with blanks in the place of its programs, configurations and lists of global variables.
fn stripped(code: &Code<'_>, outline: &Outline) -> String {
    let programs = outline.units.iter();
    let programs = programs.filter(|unit| unit.kind == UnitKind::Program);
    let programs = programs.map(|unit| code.start(unit.name - 1)..code.end(unit.body.end));
    let configurations = outline.configurations.iter().map(|one| {
        let mut rest = one.start..code.tokens.len();
        let end = rest.find(|at| code.is(*at, "END_CONFIGURATION"));
        code.start(one.start)..end.map_or(code.text.len(), |at| code.end(at))
    });
    let lists = outline.globals.iter().map(|section| whole(code, section));
    let mut bytes = code.text.as_bytes().to_vec();
    for range in programs.chain(configurations).chain(lists) {
        for byte in &mut bytes[range] {
            if *byte != b'\n' {
                *byte = b' ';
            }
        }
    }
    // A mark at the beginning is no Structured Text.
    let text = String::from_utf8(bytes).unwrap_or_default();
    text.replace('\u{FEFF}', "   ")
}

#[cfg(test)]
mod tests {
    use super::super::interface::Direction;
    use super::*;

    fn source(text: &str) -> Source {
        Source {
            name: "b.st".to_owned(),
            bytes: text.into(),
        }
    }

    fn block(text: &str, name: &str) -> Block {
        Block::find(&[source(text)], name).expect("the block")
    }

    const FIRST: &str = "\
(* a comment *)
PROGRAM Main
  VAR x AT %QX0.0 : BOOL; END_VAR
  x := TRUE;
END_PROGRAM
FUNCTION_BLOCK Valve
  VAR_INPUT
    Open, Close : BOOL := TRUE;
    Time : TIME := T#1s500ms;
    Edge : BOOL R_EDGE;
  END_VAR
  VAR_OUTPUT RETAIN
    State : INT (0..3);
    Text : STRING[20] := 'a; b';
  END_VAR
  VAR_IN_OUT Count : UINT; END_VAR
  VAR inner : REAL; END_VAR
  IF Open THEN State := 1; END_IF;
END_FUNCTION_BLOCK
";

    #[test]
    fn the_interface_is_read() {
        let valve = block(FIRST, "VALVE");
        let read = valve.variables.iter().map(|one| {
            let signal = one.elementary.map(|signal| signal.name);
            (one.name.as_str(), one.direction, signal, one.initial)
        });
        assert_eq!(
            read.collect::<Vec<_>>(),
            [
                ("Open", Direction::Input, Some("BOOL"), 1.0),
                ("Close", Direction::Input, Some("BOOL"), 1.0),
                ("Time", Direction::Input, Some("TIME"), 1500.0),
                ("Edge", Direction::Input, Some("BOOL"), 0.0),
                ("State", Direction::Output, Some("INT"), 0.0),
                ("Text", Direction::Output, None, 0.0),
                ("Count", Direction::InOut, Some("UINT"), 0.0),
            ]
        );
        let unfit: Vec<_> = valve.unfit(&[]).map(|one| one.place).collect();
        assert_eq!(unfit, [(14, 5)]);
        assert_eq!(valve.unfit(&["TEXT".to_owned()]).count(), 0);
    }

    #[test]
    fn the_program_around_a_block_calls_it_with_its_signals() {
        let wrapped = block(FIRST, "Valve").wrap(&["Text".to_owned()], Nanos(2_500_000), false);
        let (first, rest) = wrapped
            .text
            .split_once("PROGRAM TickbusBlock\n")
            .expect("it");
        // Lines stay where they were, without the other program.
        assert_eq!(first.lines().count(), FIRST.lines().count());
        assert_eq!(wrapped.lines[0].end, FIRST.lines().count() + 1);
        assert!(!first.contains("Main"), "{first}");
        assert!(first.ends_with("END_FUNCTION_BLOCK\n"), "{first}");
        assert_eq!(
            rest,
            "\
VAR
  TickbusI0 AT %IX0.0 : BOOL;
  TickbusI1 AT %IX1.0 : BOOL;
  TickbusI2 AT %ID4 : DINT;
  TickbusI3 AT %IX8.0 : BOOL;
  TickbusQ4 AT %QW0 : INT;
  TickbusI6 AT %IW10 : UINT;
  TickbusQ6 AT %QW2 : UINT;
END_VAR
VAR
  TickbusV6 : UINT;
  TickbusL6 : UINT;
  TickbusB : Valve;
END_VAR
IF TickbusI6 <> TickbusL6 THEN TickbusV6 := TickbusI6; TickbusL6 := TickbusI6; END_IF;
TickbusB(Open := TickbusI0, Close := TickbusI1, Time := LREAL_TO_TIME((DINT_TO_LREAL(TickbusI2) + 0.0000005) / 1000.0), \
Edge := TickbusI3, Count := TickbusV6);
TickbusQ4 := TickbusB.State;
TickbusQ6 := TickbusV6;
END_PROGRAM
CONFIGURATION TickbusConfiguration
  RESOURCE TickbusResource ON PLC
    TASK TickbusTask(INTERVAL := T#2.5ms, PRIORITY := 0);
    PROGRAM TickbusInstance WITH TickbusTask : TickbusBlock;
  END_RESOURCE
END_CONFIGURATION
"
        );
        let names: Vec<_> = wrapped
            .signals
            .iter()
            .map(|one| one.name.as_str())
            .collect();
        let all = [
            "Open",
            "Close",
            "Time",
            "Edge",
            "State",
            "Count",
            "Count out",
        ];
        assert_eq!(names, all);
    }

    #[test]
    fn a_branch_sets_its_bit() {
        let wrapped = block(FIRST, "Valve").wrap(&["Text".to_owned()], Nanos(1_000_000), true);
        let counted = "IF Open THEN {extern unsigned int *__QD4; *__QD4 |= 1u}  State := 1; \
                       \x20ELSE {extern unsigned int *__QD4; *__QD4 |= 2u} END_IF;";
        assert!(wrapped.text.contains(counted), "{}", wrapped.text);
        assert_eq!(wrapped.counters[0].name, "(branches 0)");
    }

    #[test]
    fn another_name_is_refused_with_those_there_are() {
        let text = "FUNCTION F : INT\nF := 1;\nEND_FUNCTION\n";
        let found = Block::find(&[source(FIRST), source(text)], "Main");
        let names = vec!["Valve".to_owned(), "F".to_owned()];
        assert_eq!(found.expect_err("a program"), NoBlock::Unknown(names));
        let broken = Block::find(&[source("FUNCTION_BLOCK A\nx := 1;\n")], "A");
        let Err(NoBlock::Unreadable(mistakes)) = broken else {
            panic!("{broken:?}");
        };
        let told = "b.st:1:1: A has no END_FUNCTION_BLOCK; end it";
        assert_eq!(mistakes.to_string(), told);
    }
}
