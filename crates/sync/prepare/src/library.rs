//! The code inserted into a program: the blocks of `plc/iec61131`, and the scheduler's program.

use std::fmt::Write as _;

use super::code::Code;
use super::lexer::{Comments, Kind, tokens};
use super::outline::{Outline, outline};
use super::words;

/// The sources of the blocks, each with its name. Links lead to the files, since a published package has no files from
/// outside its crate.
pub const SOURCES: [(&str, &str); 3] = [
    ("timers", include_str!("library/timers.st")),
    ("action_control", include_str!("library/action_control.st")),
    ("scheduler", include_str!("library/scheduler.st")),
];

/// The program that runs first in each cycle.
pub(crate) const SCHEDULE: &str = "TICKBUS_SCHEDULE";

/// The one task.
pub(crate) const TASK: &str = "tickbus_cycle";

/// A task of the original.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Signal {
    /// The variable that signals when the task's programs run.
    pub(crate) name: String,
    /// The interval in milliseconds; `None`: in every step.
    pub(crate) interval: Option<u32>,
}

impl Signal {
    /// The signal of the task called `task`, next to those of other tasks.
    pub(crate) fn of_task<'s>(
        task: &str,
        interval: u32,
        others: impl Iterator<Item = &'s Self>,
    ) -> Self {
        let others: Vec<String> = others.map(|one| one.name.to_uppercase()).collect();
        let is_free = |name: &String| !others.contains(&name.to_uppercase());
        let first = format!("tickbus_execute_{}", identifier(task));
        let mut numbered = (2..).map(|number: usize| format!("{first}_{number}"));
        let name = if is_free(&first) {
            first
        } else {
            numbered.find(is_free).expect("numbers do not end")
        };
        let interval = Some(interval);
        Self { name, interval }
    }

    /// The signal of programs without a task.
    pub(crate) fn of_every_step() -> Self {
        Self {
            name: "tickbus_execute".to_owned(),
            interval: None,
        }
    }
}

/// A name as part of another one: some editors accept blanks and letters beyond ASCII, and no compiler accepts two
/// adjacent `_`.
fn identifier(name: &str) -> String {
    let parts = name.split(|c: char| !c.is_ascii_alphanumeric());
    let parts: Vec<&str> = parts.filter(|part| !part.is_empty()).collect();
    if parts.is_empty() {
        "task".to_owned()
    } else {
        parts.join("_")
    }
}

/// The condition under which a program of a task runs: the execution controller's header.
pub(crate) fn condition(signal: &str) -> String {
    format!("NOT tickbus_simulated OR {signal}")
}

/// The global variables, as declarations.
pub(crate) fn globals(signals: &[Signal]) -> Vec<(String, &'static str, &'static str)> {
    let fixed = [
        ("tickbus_now".to_owned(), "TIME", ""),
        ("tickbus_simulated".to_owned(), "BOOL", "TRUE"),
    ];
    let own = signals
        .iter()
        .map(|signal| (signal.name.clone(), "BOOL", ""));
    fixed.into_iter().chain(own).collect()
}

/// The addresses of the server's variables, such as `%ID0`; `None` leaves them to the user.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Addresses {
    /// `go`, a UDINT that the server writes.
    pub go: Option<String>,
    /// `ms`, a UDINT that the server writes before `go`.
    pub ms: Option<String>,
    /// `done`, a UDINT that the server reads.
    pub done: Option<String>,
    /// A second copy of `go`, at the other end of the server's outputs: a step begins when both agree.
    pub go_end: Option<String>,
    /// A second copy of `done`, at the other end of the server's inputs.
    pub done_end: Option<String>,
}

impl Addresses {
    /// The variables for the server, with their addresses.
    pub(crate) fn variables(&self) -> impl Iterator<Item = (&'static str, &Option<String>)> {
        let second = [("go_end", &self.go_end), ("done_end", &self.done_end)];
        let first = [("go", &self.go), ("ms", &self.ms), ("done", &self.done)];
        let second = second.into_iter().filter(|(_, address)| address.is_some());
        first.into_iter().chain(second)
    }
}

/// The required blocks and the scheduler's program, without comments.
pub(crate) fn text(timers: &[&str], signals: &[Signal], addresses: &Addresses) -> String {
    let mut made = String::new();
    for (_, source) in SOURCES {
        let code = Code::new(source);
        let read = outline(&code).expect("our own sources can be read");
        for unit in &read.units {
            let name = code.word(unit.name);
            let is_needed = name == "TICKBUS_SCHEDULER"
                || timers
                    .iter()
                    .any(|timer| name.strip_prefix(words::PREFIX) == Some(timer));
            if is_needed {
                let unit = unit_text(&code, &read, unit.name);
                write!(made, "{unit}\n\n").expect("a String takes all");
            }
        }
    }
    made + &schedule(signals, addresses)
}

/// A unit from its first to its last word, without its comments.
fn unit_text(code: &Code<'_>, read: &Outline, name: usize) -> String {
    let unit = read.units.iter().find(|unit| unit.name == name);
    let unit = unit.expect("it is one of them");
    let text = &code.text[code.start(name - 1)..code.end(unit.body.end)];
    let kept = tokens(text, Comments::Flat).into_iter();
    let kept = kept.filter(|token| token.kind != Kind::Comment);
    let kept: String = kept.map(|token| &text[token.range()]).collect();
    let lines = kept.lines().map(str::trim_end);
    let lines: Vec<&str> = lines.filter(|line| !line.is_empty()).collect();
    lines.join("\n")
}

/// The scheduler's program: the handshake, and the signal of each task.
fn schedule(signals: &[Signal], addresses: &Addresses) -> String {
    let at = |address: &Option<String>| {
        let address = address.as_ref();
        address.map_or(String::new(), |address| format!("AT {address} "))
    };
    let mut made = format!("PROGRAM {SCHEDULE}\n  VAR_EXTERNAL\n");
    for (name, kind, _) in globals(signals) {
        writeln!(made, "    {name} : {kind};").expect("a String takes all");
    }
    // A section holds either variables with an address or others, not both.
    for (name, address) in addresses.variables() {
        let at = at(address);
        write!(made, "  END_VAR\n  VAR\n    {name} {at}: UDINT;\n").expect("a String takes all");
    }
    made.push_str("  END_VAR\n  VAR\n    handshake : TICKBUS_SCHEDULER;\n  END_VAR\n\n");
    let go = match addresses.go_end {
        // 0 is never a step.
        Some(_) => "SEL(go = go_end, UDINT#0, go)",
        None => "go",
    };
    writeln!(
        made,
        "  handshake(SIMULATED := tickbus_simulated, GO := {go}, MS := ms);\n  done := handshake.DONE;"
    )
    .expect("a String takes all");
    if addresses.done_end.is_some() {
        made.push_str("  done_end := handshake.DONE;\n");
    }
    made.push_str("  tickbus_now := handshake.NOW;\n");
    for signal in signals {
        let due = match signal.interval {
            Some(interval) => format!(" AND ms MOD {interval} = 0"),
            None => String::new(),
        };
        writeln!(made, "  {} := handshake.STEPPING{due};", signal.name)
            .expect("a String takes all");
    }
    made + "END_PROGRAM"
}
