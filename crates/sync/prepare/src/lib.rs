//! PLC programs put on virtual time, and taken off it again, byte for byte.
//!
//! [`prepare`] takes sources in Structured Text, or a project as `PLCopen` XML, and makes the changes by which a real
//! PLC keeps in step with a server of virtual time: timers are replaced, each program's statements are wrapped in an
//! execution controller, all tasks become one, and a scheduler runs first in it. [`undo`] reverts exactly these
//! changes. docs/virtual-time-plc.md describes them from the engineer's side.
//!
//! Sources are never reformatted: inserted text is enclosed in marks, which hold the text that was replaced. Bytes that
//! are not UTF-8 are read as Latin-1 and written back unchanged.
//!
//! The parsers for Structured Text on crates.io (`iecst`, `iec61131`, `ironplc-parser`, all MIT) build syntax trees,
//! which cannot restore comments, pragmas and blanks, and none of them reads every dialect of the programs to preserve
//! here. Only declarations, charts and the configuration have to be understood, so there is a lexer that keeps every
//! byte, and an outline read from its tokens. XML is read with `roxmltree`, which reports the position of each element.

mod addresses;
mod block;
mod branches;
mod chart;
mod check;
mod code;
mod cycle;
mod diagram;
mod duration;
mod edit;
mod interface;
mod lexer;
mod library;
mod outline;
mod plan;
mod plcopen;
mod pragma;
mod structured_text;
#[cfg(test)]
mod tests;
mod words;
mod wrapper;
mod xml;

use std::borrow::Cow;
use std::collections::BTreeSet;

use check::World;
use code::Code;
use lexer::Kind;
use outline::Outline;
use plan::Plan;
use structured_text::{Preparation, plan};
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, Mistakes, PlacedMistake, shown};

pub use block::{Block, NoBlock, Wrapped};
pub use branches::Branch;
pub use interface::{Direction, Variable, unfit};
pub use lexer::Comments;
pub use library::{Addresses, SOURCES};
pub use wrapper::Wired;

/// A file with a part of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// The name in messages.
    pub name: String,
    /// The contents.
    pub bytes: Vec<u8>,
}

/// The settings for preparing a program.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    /// The addresses of the server's variables.
    pub addresses: Addresses,
    /// Names of types and functions of libraries that use no clock.
    pub no_clock: Vec<String>,
    /// The compiler's reading of comments within comments; `None`: the one under which a source can be a program.
    pub comments: Option<Comments>,
}

/// A prepared program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Prepared {
    /// The contents of each source, in their order.
    pub files: Vec<Vec<u8>>,
    /// Remarks for the user.
    pub notes: Vec<String>,
}

/// Puts a program on virtual time.
///
/// # Errors
///
/// The constructs that cannot be prepared, per source, with their positions.
pub fn prepare(sources: &[Source], settings: &Settings) -> Result<Prepared, Vec<Mistakes>> {
    let vouched = settings.no_clock.iter();
    let timers = vouched.filter(|name| words::TIMERS.contains(&name.to_uppercase().as_str()));
    let wrong: Vec<Mistakes> = timers
        .map(|name| Mistakes::of("--no-clock", timer(name)))
        .collect();
    let wrong = [wrong, addresses::mistakes(&settings.addresses)].concat();
    if !wrong.is_empty() {
        return Err(wrong);
    }
    let texts: Vec<(Cow<'_, str>, Encoding)> =
        sources.iter().map(|source| decode(&source.bytes)).collect();
    let lines: Vec<Cow<'_, str>> = texts.iter().map(|(text, _)| with_lines(text)).collect();
    let wrong: Vec<Collector<'_>> = (sources.iter().zip(&lines))
        .map(|(source, text)| Collector::new(&source.name, text))
        .collect();
    let made = prepared(&texts, settings, &wrong);
    let mistakes: Vec<Mistakes> = wrong.into_iter().filter_map(Collector::finish).collect();
    match made {
        Some((made, notes)) if mistakes.is_empty() => {
            let files = made.into_iter().zip(&texts);
            let mut encoded = Vec::new();
            let mut wrong = Vec::new();
            for ((text, (_, encoding)), source) in files.zip(sources) {
                match encode(text, *encoding) {
                    Ok(bytes) => encoded.push(bytes),
                    Err(mistake) => wrong.push(Mistakes::of(&source.name, mistake)),
                }
            }
            if !wrong.is_empty() {
                return Err(wrong);
            }
            Ok(Prepared {
                files: encoded,
                notes,
            })
        }
        _ if mistakes.is_empty() => Err(vec![Mistakes::of_file(
            sources.first().map_or("", |source| &source.name),
            "there is no CONFIGURATION",
            "also pass the source file that has the tasks and their programs: intervals are taken from there",
        )]),
        _ => Err(mistakes),
    }
}

/// The changed sources; `None` if mistakes were reported, or no source has a configuration.
fn prepared(
    texts: &[(Cow<'_, str>, Encoding)],
    settings: &Settings,
    wrong: &[Collector<'_>],
) -> Option<(Vec<String>, Vec<String>)> {
    for ((text, _), wrong) in texts.iter().zip(wrong) {
        if let Some(at) = edit::marked(text) {
            let right = "take that out first, with --undo";
            wrong.report(at, "this program was prepared before", right);
        } else if let Some(at) = text.find('\0') {
            wrong.report(at, "this file is not UTF-8 text", "save it as UTF-8");
        }
    }
    let projects = texts
        .iter()
        .zip(wrong)
        .filter(|((text, _), _)| xml::is_xml(text));
    for (_, wrong) in projects.clone().filter(|_| texts.len() > 1) {
        wrong.collect(0, xml::not_alone());
    }
    if !wrong.iter().all(Collector::is_empty) {
        return None;
    }
    if let Some(((text, _), wrong)) = projects.last() {
        let (made, notes) = xml::prepare(text, settings, wrong)?;
        return Some((vec![made], notes));
    }
    let codes: Vec<Code<'_>> = (texts.iter())
        .map(|(text, _)| Code::with(text, 0, settings.comments))
        .collect();
    let mut outlines: Vec<Outline> = Vec::new();
    for (code, wrong) in codes.iter().zip(wrong) {
        match outline::outline(code) {
            Ok(found) => outlines.push(found),
            Err((at, mistake)) => {
                wrong.collect(at, mistake);
                outlines.push(Outline::default());
            }
        }
    }
    if !wrong.iter().all(Collector::is_empty) {
        return None;
    }
    let mut world = World::default();
    for (code, outline) in codes.iter().zip(&outlines) {
        world.add(code, outline);
    }
    world.vouch(&settings.no_clock);
    let mut found = None;
    let mut shared = BTreeSet::new();
    for (index, outline) in outlines.iter().enumerate() {
        check::check(&codes[index], outline, &world, &wrong[index]);
        for configuration in &outline.configurations {
            if found.replace((index, configuration)).is_some() {
                let at = codes[index].start(configuration.start);
                let right = "prepare the program of one PLC at a time";
                wrong[index].report(at, "this is a second CONFIGURATION", right);
            }
        }
        shared.extend(check::check_addresses(
            &codes[index],
            &settings.addresses,
            &wrong[index],
        ));
    }
    let (home, configuration) = found?;
    let (plan, note) = plan(&codes[home], configuration, &wrong[home]);
    let remarks = check_runs(&codes, &outlines, &plan, settings, wrong);
    for instance in &configuration.instances {
        let name = codes[home].capitals(instance.program);
        if !world.types.contains(&name) {
            let shown = shown(codes[home].word(instance.program));
            let what = format!("the program {shown} is in none of these sources");
            let at = codes[home].start(instance.program);
            wrong[home].report(at, what, "also pass its source file");
        }
    }
    if !wrong.iter().all(Collector::is_empty) {
        return None;
    }
    let parts: Vec<Preparation<'_, '_>> = (codes.iter().zip(&outlines))
        .map(|(code, outline)| Preparation {
            code,
            outline,
            world: &world,
            plan: &plan,
        })
        .collect();
    let timers: BTreeSet<String> = parts.iter().flat_map(Preparation::timers).collect();
    let timers: Vec<&str> = timers.iter().map(String::as_str).collect();
    let blocks = library::text(&timers, &plan.signals, &settings.addresses);
    let files = parts.iter().enumerate();
    let files = files.map(|(index, part)| part.text((index == home).then_some(blocks.as_str())));
    let notes = note.into_iter().chain(shared).chain(remarks);
    Some((files.collect(), notes.collect()))
}

/// Reports calls of programs that a task runs; returns remarks about comments and cycles.
fn check_runs(
    codes: &[Code<'_>],
    outlines: &[Outline],
    plan: &Plan,
    settings: &Settings,
    wrong: &[Collector<'_>],
) -> Vec<String> {
    let mut remarks = Vec::new();
    for (code, (outline, wrong)) in codes.iter().zip(outlines.iter().zip(wrong)) {
        if settings.comments.is_none() {
            remarks.extend(nested_remark(code, wrong));
        }
        for unit in &outline.units {
            if let Some(interval) = plan.interval(&code.capitals(unit.name)) {
                let found = cycle::differing(code, &unit.body, interval).into_iter();
                remarks.extend(found.map(|(at, remark)| placed_remark(wrong, at, &remark)));
            }
            let known = check::variables(code, unit);
            let is_run = |name: &str| plan.programs.contains_key(name);
            check::check_callers(code, &unit.body, &known, is_run, wrong);
        }
    }
    remarks
}

/// A remark about a comment within a comment, if there is one.
fn nested_remark(code: &Code<'_>, wrong: &Collector<'_>) -> Option<String> {
    let mut all = code
        .all
        .iter()
        .filter(|_| code.comments == Comments::Nested);
    let first = all.find(|token| {
        let text = &code.text[token.range()];
        token.kind == Kind::Comment && text.get(2..).is_some_and(|text| text.contains("(*"))
    })?;
    let remark = "a comment is within a comment: compile with the option for that (-n of iec2c)";
    Some(placed_remark(wrong, first.start, remark))
}

/// A remark with its place.
pub(crate) fn placed_remark(wrong: &Collector<'_>, at: usize, remark: &str) -> String {
    let (line, column) = wrong.place(at);
    format!("{}:{line}:{column}: {remark}", wrong.file())
}

fn timer(name: &str) -> Mistake {
    let what = format!("{} runs on the clock of the PLC", shown(name));
    Mistake::new(
        what,
        "leave it out: it is replaced by a timer on virtual time",
    )
}

/// A project as `PLCopen` XML in one file of Structured Text, with its diagrams as statements.
///
/// # Errors
///
/// The file is no such project, or has charts or types that cannot be written, with their positions.
pub fn structured_text(source: &Source) -> Result<String, Mistakes> {
    let (text, _) = decode(&source.bytes);
    let lines = with_lines(&text);
    let wrong = Collector::new(&source.name, &lines);
    let made = xml::structured_text(&text, &wrong);
    match (made, wrong.finish()) {
        (Some(made), None) => Ok(made),
        (_, Some(mistakes)) => Err(mistakes),
        // Nothing is refused without a reason.
        (None, None) => Err(Mistakes::of_file(
            &source.name,
            "this project cannot be written as text",
            "export the project again from its editor",
        )),
    }
}

/// True if a source is XML.
pub fn is_xml(source: &Source) -> bool {
    xml::is_xml(&decode(&source.bytes).0)
}

/// Reverts the changes of [`prepare`]; other changes made since then stay.
///
/// # Errors
///
/// The file has no marks, or damaged ones.
pub fn undo(source: &Source) -> Result<Vec<u8>, Mistakes> {
    let (text, encoding) = decode(&source.bytes);
    let wrong = |at, mistake| {
        let text = with_lines(&text);
        let collector = Collector::new(&source.name, &text);
        let place = Some(collector.place(at));
        Mistakes::of_list(&source.name, vec![PlacedMistake { place, mistake }])
    };
    if edit::marked(&text).is_none() {
        return Err(Mistakes::of(&source.name, nothing_to_undo()));
    }
    let original = edit::undo(&text).map_err(|(at, mistake)| wrong(at, mistake))?;
    encode(original, encoding).map_err(|mistake| Mistakes::of(&source.name, mistake))
}

/// True if [`prepare`] has changed a file.
pub fn is_prepared(source: &Source) -> bool {
    edit::marked(&decode(&source.bytes).0).is_some()
}

fn nothing_to_undo() -> Mistake {
    let right = "name a file that was prepared; an editor may have dropped its comments";
    Mistake::new("there is nothing to take out of this file", right)
}

/// The blocks of one of our [`SOURCES`] as a file in `PLCopen` XML.
pub fn plcopen_xml(name: &str, source: &str) -> String {
    plcopen::document(name, source)
}

/// The encoding of a source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Utf8,
    /// Each byte is a character: bytes that are no UTF-8 are written back unchanged.
    Latin1,
}

fn decode(bytes: &[u8]) -> (Cow<'_, str>, Encoding) {
    if let Ok(text) = std::str::from_utf8(bytes) {
        return (Cow::Borrowed(text), Encoding::Utf8);
    }
    let text = bytes.iter().map(|byte| char::from(*byte)).collect();
    (Cow::Owned(text), Encoding::Latin1)
}

/// A text with the same positions as `text`, with line ends for counting lines: some old editors write bare CR.
fn with_lines(text: &str) -> Cow<'_, str> {
    if text.contains('\r') && !text.contains('\n') {
        Cow::Owned(text.replace('\r', "\n"))
    } else {
        Cow::Borrowed(text)
    }
}

/// The bytes of a text.
///
/// # Errors
///
/// A source in Latin-1 cannot express the inserted text.
fn encode(text: String, encoding: Encoding) -> Result<Vec<u8>, Mistake> {
    if encoding == Encoding::Utf8 {
        return Ok(text.into_bytes());
    }
    let bytes = text.chars().map(|c| u8::try_from(u32::from(c)));
    bytes.collect::<Result<_, _>>().map_err(|_| {
        let what = "this file is not UTF-8 text, and names of another file do not fit into it";
        Mistake::new(what, "save it as UTF-8")
    })
}
