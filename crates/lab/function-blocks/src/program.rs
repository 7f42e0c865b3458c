//! Programs, and reading them.

use std::path::Path;

use tickbus_base::toml_text::{
    Collector, Mistakes, Table, Value, did_you_mean, load_text, read_text, shown,
};
use tickbus_plc::blocks::{Ctu, Rs, Tof, Ton, Tp};

use crate::block::{Block, Kind};
use crate::week::{Cam, DAYS, time_of_day};
use crate::wires::{Quantity, Terminal, Terminals, Wire};

/// The most wires of an AND or an OR.
const MOST_WIRES: usize = 16;

/// A program: blocks in the order of evaluation, and the wires of the outputs.
#[derive(Clone, Debug)]
pub struct Program {
    pub(crate) terminals: Terminals,
    pub(crate) blocks: Vec<Block>,
    pub(crate) outputs: Vec<Option<Wire>>,
    pub(crate) analog_outputs: Vec<Option<Quantity>>,
    /// The outputs that a block drives, each with the name of that block: `Q1`, `pump`.
    pub names: Vec<(String, String)>,
}

impl Program {
    /// Reads the program at `path` for a controller with these terminals.
    ///
    /// # Errors
    ///
    /// With every mistake in it.
    pub fn load(path: &Path, terminals: Terminals) -> Result<Self, Mistakes> {
        Self::parse(&path.display().to_string(), &load_text(path)?, terminals)
    }

    /// Reads a program from `text`, which came from `file`.
    ///
    /// # Errors
    ///
    /// With every mistake in it.
    pub fn parse(file: &str, text: &str, terminals: Terminals) -> Result<Self, Mistakes> {
        const OUTPUTS: &str = "write an [outputs] table with lines such as Q1 = \"pump\"";

        let mut collector = Collector::new(file, text);
        let program = read_text(&mut collector, text, |mut root| {
            let outputs = root.require("outputs", OUTPUTS);
            let blocks = root.take("blocks");
            root.finish();
            let outputs = outputs?.table("[outputs]", OUTPUTS)?;
            let blocks = match blocks {
                Some(blocks) => entries(&blocks.table("[blocks]", "write a [blocks] table")?),
                None => Vec::new(),
            };
            Some(read(terminals, &outputs, blocks))
        });
        match (program, collector.finish()) {
            (Some(program), None) => Ok(program),
            (_, Some(mistakes)) => Err(mistakes),
            (None, None) => unreachable!("what could not be read was reported"),
        }
    }
}

/// The entries of a table in the order of the text.
fn entries<'a>(table: &Table<'a>) -> Vec<(&'a str, Value<'a>)> {
    let mut entries: Vec<_> = table.all().collect();
    entries.sort_by_key(|(_, value)| value.at());
    entries
}

fn read<'a>(
    terminals: Terminals,
    outputs: &Table<'a>,
    blocks: Vec<(&'a str, Value<'a>)>,
) -> Program {
    let mut tables = Vec::new();
    let mut reader = Reader {
        terminals,
        blocks: Vec::new(),
        outputs: entries(outputs),
    };
    for (name, value) in blocks {
        let title = format!("\"{}\"", shown(name));
        if name.trim().is_empty() || Terminal::split(name).is_some() {
            value.wrong(
                format!("{title} cannot be the name of a block"),
                "write a name that is no input and no output, such as pump",
            );
        }
        let right = "write a table such as { type = \"NOT\", input = \"I1\" }";
        let table = value.table(&title, right).map(|mut table| {
            let kind = table.require("type", "write a type such as \"AND\"");
            let kind = kind.and_then(|kind| kind.choice("types of blocks", &Kind::NAMES));
            (table, kind)
        });
        reader
            .blocks
            .push((name, table.as_ref().and_then(|(_, kind)| *kind)));
        tables.extend(table);
    }
    if reader.outputs.is_empty() {
        outputs.wrong(
            "no output is wired",
            "write lines such as Q1 = \"pump\" in [outputs]",
        );
    }
    let mut program = Program {
        terminals,
        blocks: Vec::new(),
        outputs: vec![None; terminals.outputs],
        analog_outputs: vec![None; terminals.analog_outputs],
        names: Vec::new(),
    };
    for (mut table, kind) in tables {
        if let Some(kind) = kind {
            let block = reader.block(&mut table, kind);
            table.finish();
            program.blocks.extend(block);
        } else {
            // The expected keys are unknown.
            table.finish_open();
        }
    }
    for (key, value) in &reader.outputs {
        match Terminal::split(key).filter(|(kind, _)| kind.is_output()) {
            Some((kind, number)) if (1..=terminals.of(kind)).contains(&number) => {
                let blocks = || reader.blocks.iter();
                if let Some(text) = value.as_text()
                    && let Some((name, _)) = blocks().find(|(name, _)| *name == text)
                {
                    program.names.push(((*key).to_owned(), (*name).to_owned()));
                }
                if kind.is_analog() {
                    program.analog_outputs[number - 1] = reader.quantity(value);
                } else {
                    program.outputs[number - 1] = reader.wire(value);
                }
            }
            Some((kind, _)) => value.wrong(
                format!("there is no output {}", shown(key)),
                reader.range(kind),
            ),
            None => value.wrong(
                format!("\"{}\" is no output", shown(key)),
                "write Q1, AQ1 or the like",
            ),
        }
    }
    program
}

/// The possible meanings of names in a program.
struct Reader<'a> {
    terminals: Terminals,
    /// All blocks, including those with mistakes, so that indices match the evaluation.
    blocks: Vec<(&'a str, Option<Kind>)>,
    outputs: Vec<(&'a str, Value<'a>)>,
}

/// The meaning of a text in a program.
enum Meaning {
    Terminal(Terminal, usize),
    Block(usize),
}

impl<'a> Reader<'a> {
    fn block(&self, table: &mut Table<'a>, kind: Kind) -> Option<Block> {
        // Every key is taken before the first wrong one ends this, since a key that was not taken counts as unknown.
        Some(match kind {
            Kind::And => Block::And(self.wires(table)?),
            Kind::Or => Block::Or(self.wires(table)?),
            Kind::Xor => {
                let value = table.require("inputs", TWO);
                let wires = self.list(&value?, TWO)?;
                let [a, b] = wires[..] else {
                    table.wrong(format!("an XOR with {} inputs", wires.len()), TWO);
                    return None;
                };
                Block::Xor([a, b])
            }
            Kind::Not => Block::Not(self.input(table, "input")?),
            Kind::Rs => {
                let (set, reset) = (self.input(table, "set"), self.input(table, "reset"));
                Block::Rs {
                    set: set?,
                    reset: reset?,
                    memory: Rs::default(),
                }
            }
            Kind::OnDelay | Kind::OffDelay | Kind::Pulse => {
                let input = self.input(table, "input");
                let time = table.require("time", "write a duration such as \"500ms\"");
                let time = time.and_then(|time| time.duration());
                let (input, time) = (input?, time?);
                match kind {
                    Kind::OnDelay => Block::OnDelay {
                        input,
                        time,
                        timer: Ton::default(),
                    },
                    Kind::OffDelay => Block::OffDelay {
                        input,
                        time,
                        timer: Tof::default(),
                    },
                    _ => Block::Pulse {
                        input,
                        time,
                        timer: Tp::default(),
                    },
                }
            }
            Kind::Counter => {
                let input = self.input(table, "input");
                let reset = table.take("reset").map(|reset| self.wire(&reset));
                let limit = table.require("limit", "write a count such as 10");
                let limit = limit.and_then(|limit| limit.whole(1..=i128::from(i16::MAX)));
                Block::Counter {
                    input: input?,
                    reset: match reset {
                        Some(reset) => Some(reset?),
                        None => None,
                    },
                    limit: i16::try_from(limit?).ok()?,
                    counter: Ctu::default(),
                }
            }
            Kind::WeeklyTimer => {
                let right = "write cams = [{ days = [\"Mon\"], on = \"06:00\", off = \"07:30\" }]";
                let cams = table.require("cams", right)?.list(right)?;
                if cams.is_empty() {
                    table.wrong("a weekly timer without a cam", right);
                }
                let cams = cams.iter().map(|value| cam(value.table("the cam", right)?));
                // Collected first, so that the mistakes of all are reported.
                let cams: Vec<_> = cams.collect();
                Block::WeeklyTimer(cams.into_iter().collect::<Option<_>>()?)
            }
            Kind::Comparator => {
                let (a, b) = (self.number(table, "a"), self.number(table, "b"));
                Block::Comparator { a: a?, b: b? }
            }
            Kind::Hysteresis => {
                let input = self.number(table, "input");
                let mut threshold = |key| table.require(key, NUMBER)?.number(NUMBER);
                let (on, off) = (threshold("on"), threshold("off"));
                let (input, on, off) = (input?, on?, off?);
                #[expect(clippy::float_cmp, reason = "the same text")]
                if on == off {
                    table.wrong(
                        format!("it switches on and off at {on}"),
                        "let \"on\" and \"off\" differ, or take a comparator",
                    );
                    return None;
                }
                Block::Hysteresis { input, on, off }
            }
        })
    }

    fn wires(&self, table: &mut Table<'a>) -> Option<Vec<Wire>> {
        let right = format!(
            "write a list of 1 to {MOST_WIRES} blocks and inputs, such as [\"I1\", \"I2\"]"
        );
        let value = table.require("inputs", right.as_str())?;
        let wires = self.list(&value, &right)?;
        if !(1..=MOST_WIRES).contains(&wires.len()) {
            value.wrong(format!("{} inputs", wires.len()), right);
            return None;
        }
        Some(wires)
    }

    fn list(&self, value: &Value<'a>, right: &str) -> Option<Vec<Wire>> {
        let elements = value.list(right)?;
        let wires: Vec<_> = elements.iter().map(|element| self.wire(element)).collect();
        wires.into_iter().collect()
    }

    /// The wire of a required key.
    fn input(&self, table: &mut Table<'a>, key: &'static str) -> Option<Wire> {
        self.wire(&table.require(key, "write a block or an input, such as \"I1\"")?)
    }

    /// The number of a required key.
    fn number(&self, table: &mut Table<'a>, key: &'static str) -> Option<Quantity> {
        self.quantity(&table.require(key, ANALOG)?)
    }

    /// A source that is on or off.
    fn wire(&self, value: &Value<'a>) -> Option<Wire> {
        let text = value.text("write the name of a block or an input in quotes, such as \"I1\"")?;
        Some(match self.meaning(value, text)? {
            Meaning::Terminal(Terminal::Input, place) => Wire::Input(place),
            Meaning::Terminal(Terminal::Output, place) => Wire::Output(place),
            Meaning::Block(place) => Wire::Block(place),
            Meaning::Terminal(Terminal::AnalogInput | Terminal::AnalogOutput, _) => {
                value.wrong(
                    format!("{text} is analog, and this is on or off"),
                    "put a comparator or a hysteresis in between",
                );
                return None;
            }
        })
    }

    /// A source of a number.
    fn quantity(&self, value: &Value<'a>) -> Option<Quantity> {
        if !value.written().is_empty() {
            return value.number(ANALOG).map(Quantity::Constant);
        }
        let text = value.text(ANALOG)?;
        Some(match self.meaning(value, text)? {
            Meaning::Terminal(Terminal::AnalogInput, place) => Quantity::Input(place),
            Meaning::Terminal(Terminal::AnalogOutput, place) => Quantity::Output(place),
            Meaning::Block(place) if matches!(self.blocks[place].1, None | Some(Kind::Counter)) => {
                Quantity::Count(place)
            }
            Meaning::Terminal(..) | Meaning::Block(_) => {
                value.wrong(
                    format!("\"{}\" is on or off, and this is a number", shown(text)),
                    ANALOG,
                );
                return None;
            }
        })
    }

    fn meaning(&self, value: &Value<'a>, text: &str) -> Option<Meaning> {
        if let Some(place) = self.blocks.iter().position(|(name, _)| *name == text) {
            return Some(Meaning::Block(place));
        }
        let Some((kind, number)) = Terminal::split(text) else {
            let names: Vec<&str> = self.blocks.iter().map(|(name, _)| *name).collect();
            value.wrong(
                format!("there is no block \"{}\"", shown(text)),
                did_you_mean(text, "blocks", &names),
            );
            return None;
        };
        if !(1..=self.terminals.of(kind)).contains(&number) {
            let side = if kind.is_output() { "output" } else { "input" };
            value.wrong(
                format!("there is no {side} {}", shown(text)),
                self.range(kind),
            );
            return None;
        }
        if kind.is_output() && !self.outputs.iter().any(|(key, _)| *key == text) {
            value.wrong(
                format!("{text} is read, but nothing is wired to it"),
                format!("write a line {text} = in [outputs]"),
            );
            return None;
        }
        Some(Meaning::Terminal(kind, number - 1))
    }

    /// The existing terminals of a kind.
    fn range(&self, kind: Terminal) -> String {
        let letters = kind.letters();
        match self.terminals.of(kind) {
            0 => format!("this controller has no {letters}"),
            1 => format!("write {letters}1"),
            count => format!("write {letters}1 to {letters}{count}"),
        }
    }
}

const TWO: &str = "write a list of two, such as [\"I1\", \"I2\"]";
const NUMBER: &str = "write a number such as 4.5";
const ANALOG: &str = "write an analog input, a counter or a number, such as \"AI1\" or 4.5";

fn cam(mut table: Table<'_>) -> Option<Cam> {
    let right = "write a list of days, such as [\"Mon\", \"Tue\"]";
    let days = table.require("days", right).and_then(|value| {
        let list = value.list(right)?;
        if list.is_empty() {
            value.wrong("there is no day in it", right);
        }
        let mut days = [false; 7];
        for day in list {
            if let Some(day) = day.choice("days", &DAYS) {
                days[day] = true;
            }
        }
        Some(days)
    });
    let mut time = |key| {
        let right = "write a time of day, from \"00:00\" to \"24:00\"";
        let value = table.require(key, right)?;
        let text = value.text(right)?;
        let time = time_of_day(text);
        if time.is_none() {
            value.wrong(format!("\"{}\" is no time of day", shown(text)), right);
        }
        time
    };
    let (on, off) = (time("on"), time("off"));
    if on.is_some() && on == off {
        table.wrong(
            "the cam switches on and off at the same time",
            "for a whole day write on = \"00:00\", off = \"24:00\"",
        );
    }
    table.finish();
    Some(Cam {
        days: days?,
        on: on?,
        off: off?,
    })
}
