//! `block = "FB_Valve"`: one function block or function of some Structured Text, as the program that is tested.
//!
//! The program around the block is generated and built; its located variables are the signals, and there is no
//! driver.cfg.

mod build;
mod coverage;

use std::fmt::Write as _;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use build::{Unbuilt, built};
pub(super) use coverage::Counted;
pub use coverage::{Branch, Coverage};
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{
    Mistakes, PlacedMistake, Table, Value, did_you_mean, load_text, printable, shown,
};
use tickbus_driver_cfg::loopback::Peer;
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_image::signal::{DataType, Signal, Slot};
use tickbus_prepare::{Block, NoBlock, Source, Wired, Wrapped, unfit};

/// The default step of a file with a block: that of the built-in programs' scans.
pub(super) const STEP: Nanos = Nanos::from_millis(10);

/// The largest source.
const MOST_BYTES: u64 = 10_000_000;

/// The keys of a block, as written.
pub(super) struct BlockKeys<'a> {
    block: Option<Value<'a>>,
    source: Option<Value<'a>>,
    without: Option<Value<'a>>,
}

/// A block that can be run.
pub(super) struct Ready {
    /// The signals, without a bus.
    pub(super) config: Config,
    /// The program, which is scanned at every step.
    pub(super) peer: Peer,
    /// The initial values of the inputs.
    pub(super) initial: Vec<(usize, Slot)>,
    /// The branches, if they are counted.
    pub(super) counted: Option<Arc<Counted>>,
}

/// Builds the whole program in a file of Structured Text, by `plc/build` (which needs `iec2c` and a C compiler), unless it
/// was built before. Returns the shared object.
///
/// # Errors
///
/// The file cannot be read, has mistakes that the compiler finds, or cannot be built.
pub fn build_program(path: &Path) -> Result<PathBuf, Mistakes> {
    let text = load_text(path)?;
    let file = path.display().to_string();
    built("program", &text).map_err(|unbuilt| match unbuilt {
        Unbuilt::Reason(reason) => {
            let (what, right) = remedy(&reason);
            Mistakes::of_file(&file, printable(what), right)
        }
        Unbuilt::Mistakes(found) => Mistakes::of_list(
            &file,
            found
                .into_iter()
                .map(|(line, column, words)| PlacedMistake {
                    place: Some((line, column)),
                    mistake: Mistake::new(
                        printable(&words),
                        "docs/own-plc-program.md tells what is compiled",
                    ),
                })
                .collect(),
        ),
    })
}

/// Why something was not built, and what to do about it.
fn remedy(reason: &str) -> (&str, &str) {
    let parts = reason.split_once("; ");
    parts.unwrap_or((reason, "docs/own-plc-program.md says what it needs"))
}

impl<'a> BlockKeys<'a> {
    pub(super) fn take(root: &mut Table<'a>) -> Self {
        Self {
            block: root.take("block"),
            source: root.take("source"),
            without: root.take("without"),
        }
    }

    /// The block, if the file has one.
    pub(super) const fn block(&self) -> Option<&Value<'a>> {
        self.block.as_ref()
    }

    /// Reports keys that stand without a block, or that a block does not have.
    pub(super) fn check_beside(&self, others: &[(&str, Option<&Value<'a>>)]) {
        let own = [("source", &self.source), ("without", &self.without)];
        for (key, value) in own {
            if let (Some(value), None) = (value, &self.block) {
                let what = format!("\"{key}\" stands without \"block\"");
                value.wrong(what, "name the block: block = \"FB_Valve\"");
            }
        }
        for (key, value) in others {
            if let (Some(value), Some(_)) = (value, &self.block) {
                let right = match *key {
                    "scan" => "a block is scanned at every step: write step = \"10ms\"",
                    _ => "a block has its own signals and program: remove it",
                };
                value.wrong(format!("\"{key}\" stands beside \"block\""), right);
            }
        }
    }

    /// Finds and builds the block; with `counts`, its branches are counted. Mistakes in a source go to `elsewhere`.
    pub(super) fn read(
        &self,
        (folder, kinds): (&Path, &'static Kinds),
        step: Nanos,
        counts: bool,
        elsewhere: &mut Option<Mistakes>,
    ) -> Option<Ready> {
        const NAME: &str = "write the name of a function block or function in quotes";
        let named = self.block.as_ref()?;
        let name = named.text(NAME)?;
        let Some(source) = &self.source else {
            named.wrong(
                "\"block\" stands without \"source\"",
                "add the file of the block: source = \"valve.st\", or a list of files",
            );
            return None;
        };
        let sources = sources(source, folder)?;
        let without = self.without.as_ref().map_or(Some(Vec::new()), texts)?;
        let block = match Block::find(&sources, name) {
            Ok(block) => block,
            Err(NoBlock::Unreadable(mistakes)) => {
                *elsewhere = Some(mistakes);
                return None;
            }
            Err(NoBlock::Unknown(names)) => {
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                let what = format!("there is no block \"{}\" in \"source\"", shown(name));
                named.wrong(what, did_you_mean(name, "blocks and functions", &names));
                return None;
            }
        };
        let file = &sources[block.source].name;
        if !self.knows(&block, &without) {
            return None;
        }
        let unfit: Vec<PlacedMistake> = block
            .unfit(&without)
            .map(|variable| PlacedMistake {
                place: Some(variable.place),
                mistake: unfit(variable),
            })
            .collect();
        if !unfit.is_empty() {
            *elsewhere = Some(Mistakes::of_list(file, unfit));
            return None;
        }
        let mut wrapped = block.wrap(&without, step, counts);
        let mut object = built(&block.name, &wrapped.text);
        if let (Err(Unbuilt::Mistakes(found)), true) = (&object, counts) {
            // The messages about the source as it is have its columns.
            let plain = block.wrap(&without, step, false);
            let plain_object = built(&block.name, &plain.text);
            if plain_object.is_ok() {
                let words = found.first().map_or("", |(_, _, words)| words);
                let what = format!("the branches of this block cannot be counted: {words}");
                named.wrong(printable(&what), "run its tests without --coverage");
                return None;
            }
            (wrapped, object) = (plain, plain_object);
        }
        let object = match object {
            Ok(object) => object,
            Err(Unbuilt::Reason(reason)) => {
                let (what, right) = remedy(&reason);
                named.wrong(printable(what), right);
                return None;
            }
            Err(Unbuilt::Mistakes(found)) => {
                *elsewhere = Some(mistakes(&sources, &wrapped, found));
                return None;
            }
        };
        let config = config(&block.name, &wrapped, kinds);
        let config = match config {
            Ok(config) => config,
            Err(mistakes) => {
                *elsewhere = Some(mistakes);
                return None;
            }
        };
        let signals = wrapped.signals.iter().enumerate();
        let initial = signals.filter(|(_, wired)| wired.initial != 0.0);
        let table = &config.table;
        let initial = initial.map(|(index, wired)| (index, slot(wired, &table.signals[index])));
        let counters = wrapped.signals.len()..wrapped.signals.len() + wrapped.counters.len();
        Some(Ready {
            initial: initial.collect(),
            counted: counts.then(|| Arc::new(Counted::new(file, &block, counters))),
            peer: Peer::Program {
                name: object.to_string_lossy().into_owned(),
                options: Vec::new(),
                scan: None,
            },
            config,
        })
    }

    /// Reports names in `without` that the block does not have.
    fn knows(&self, block: &Block, without: &[String]) -> bool {
        let names = block.variables.iter().map(|one| one.name.as_str());
        let names: Vec<&str> = names.collect();
        let mut unknown = without
            .iter()
            .filter(|name| !names.iter().any(|one| one.eq_ignore_ascii_case(name)));
        let (Some(name), Some(value)) = (unknown.next(), &self.without) else {
            return true;
        };
        let what = format!("\"{}\" has no variable \"{}\"", block.name, shown(name));
        value.wrong(what, did_you_mean(name, "its variables", &names));
        false
    }
}

/// A text, or a list of texts.
fn texts(value: &Value<'_>) -> Option<Vec<String>> {
    const RIGHT: &str = "write a name in quotes, or a list of names";
    if let Some(text) = value.as_text() {
        return Some(vec![text.to_owned()]);
    }
    let read = value.list(RIGHT)?.into_iter();
    let read: Vec<_> = read
        .map(|value| value.text(RIGHT).map(str::to_owned))
        .collect();
    read.into_iter().collect()
}

/// The files in `source`.
fn sources(value: &Value<'_>, folder: &Path) -> Option<Vec<Source>> {
    const RIGHT: &str = "write the path of a file in Structured Text, as seen from this file";
    let files = texts(value)?;
    if files.is_empty() {
        value.wrong("an empty list has no block", RIGHT);
        return None;
    }
    let mut sources = Vec::new();
    for file in files {
        let path = folder.join(&file);
        let name = path.display().to_string();
        let size = std::fs::metadata(&path).map(|file| (file.is_file(), file.len()));
        let read = match size {
            Ok((true, ..=MOST_BYTES)) => std::fs::read(&path).map_err(|error| error.to_string()),
            Ok((true, _)) => Err(format!("has more than {MOST_BYTES} bytes")),
            Ok((false, _)) => Err("is no file".to_owned()),
            Err(error) if error.kind() == ErrorKind::NotFound => Err("is not there".to_owned()),
            Err(error) => Err(error.to_string()),
        };
        match read {
            Ok(bytes) => sources.push(Source { name, bytes }),
            Err(why) => {
                value.wrong(format!("{}: {why}", shown(&file)), RIGHT);
                return None;
            }
        }
    }
    Some(sources)
}

/// The compiler's messages at their places in the sources: those of the first file that has some.
fn mistakes(sources: &[Source], wrapped: &Wrapped, found: Vec<(usize, usize, String)>) -> Mistakes {
    const RIGHT: &str = "so the compiler says, which reads the second edition of IEC 61131-3";
    let home = |line: usize| wrapped.lines.iter().position(|lines| lines.contains(&line));
    let first = found.iter().find_map(|(line, ..)| home(*line));
    let Some(first) = first else {
        // In the program around the block: a type that cannot be assigned, for example.
        let words = found.into_iter().map(|(_, _, words)| words);
        let words: Vec<String> = words.collect();
        let what = format!("the program around the block: {}", words.join("; "));
        return Mistakes::of_file(&sources[0].name, printable(&what), RIGHT);
    };
    let in_first = found
        .into_iter()
        .filter(|(line, ..)| home(*line) == Some(first));
    let list = in_first.map(|(line, column, words)| PlacedMistake {
        place: Some((line + 1 - wrapped.lines[first].start, column)),
        mistake: Mistake::new(printable(&words), RIGHT),
    });
    Mistakes::of_list(&sources[first].name, list.collect())
}

/// The signals of the block, as those of a driver.cfg.
fn config(name: &str, wrapped: &Wrapped, kinds: &'static Kinds) -> Result<Config, Mistakes> {
    let mut text = format!(
        "[driver]\nid = 1\nname = \"{name}\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"block\"\n"
    );
    for wired in wrapped.signals.iter().chain(&wrapped.counters) {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "[[signal]]\nname = \"{}\"\naddress = \"{}\"\ntype = \"{}\"",
            wired.name, wired.address, wired.data_type
        );
        if let Some(unit) = wired.unit {
            let _ = writeln!(text, "unit = \"{unit}\"");
        }
    }
    Config::parse(name, &text, kinds)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a literal of the signal's own type"
)]
fn slot(wired: &Wired, signal: &Signal) -> Slot {
    match signal.data_type {
        _ if !signal.is_integer_slot() => Slot::from_real(wired.initial),
        DataType::Lint => Slot::from_signed(wired.initial as i64),
        _ => Slot::from_unsigned(wired.initial as u64),
    }
}
