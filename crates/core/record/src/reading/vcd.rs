//! Reading VCD as written by tickbus.

use std::collections::HashMap;
use std::io::{self, BufRead, ErrorKind};

use vcd::{Command, IdCode, ParseError, Parser, TimescaleUnit, Value, Vector};

use super::lines::WholeLines;
use super::{RECORD_AGAIN, ReadError};
use crate::{Column, Columns, Tick, VERSION, ValueKind};
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Address, DataType, Slot};

/// The largest number of columns that a reader accepts.
pub const MOST_COLUMNS: usize = 250_000;

/// The meaning of a variable in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Variable {
    Tick,
    Dropped,
    Status,
    Station(usize),
    Column(usize, ValueKind),
}

pub(super) struct VcdReader<R> {
    parser: Parser<WholeLines<R>>,
    variables: HashMap<IdCode, Variable>,
    time: Nanos,
    /// The recorder's last comment.
    ending: Option<String>,
    cut: bool,
}

impl<R: BufRead> VcdReader<R> {
    /// Reads the header.
    pub(super) fn open(from: R) -> Result<(Self, Columns), (ReadError, u64)> {
        let mut reader = Self {
            parser: Parser::new(WholeLines::new(from)),
            variables: HashMap::new(),
            time: Nanos::ZERO,
            ending: None,
            cut: false,
        };
        let mut header = Header::default();
        loop {
            let read = match reader.parser.next() {
                Some(Ok(Command::Enddefinitions)) => header.check(),
                Some(Ok(command)) => header.take(command).map(|()| false),
                Some(Err(error)) if error.kind() == ErrorKind::UnexpectedEof => Err(cut_header()),
                Some(Err(error)) => Err(fault(&error)),
                None => Err(cut_header()),
            };
            match read {
                Ok(true) => break,
                Ok(false) => {}
                Err(fault) => return Err((fault, reader.line())),
            }
        }
        reader.variables = header.variables;
        Ok((reader, header.columns))
    }

    pub(super) fn line(&self) -> u64 {
        self.parser.line()
    }

    pub(super) fn is_cut(&self) -> bool {
        self.cut
    }

    pub(super) fn ending(&self) -> String {
        match &self.ending {
            Some(ending) => ending.clone(),
            None => "the recording is cut: it was never ended".to_owned(),
        }
    }

    /// Reads to the end of the next tick.
    pub(super) fn next(&mut self, tick: &mut Tick) -> Result<bool, ReadError> {
        loop {
            let command = match self.parser.next() {
                Some(Ok(command)) => command,
                Some(Err(error)) if error.kind() != ErrorKind::UnexpectedEof => {
                    return Err(fault(&error));
                }
                // The rest after the last whole tick is incomplete.
                _ => {
                    self.cut = self.ending.is_none();
                    return Ok(false);
                }
            };
            match command {
                Command::Timestamp(time) => {
                    let time = Nanos(i64::try_from(time).unwrap_or(i64::MAX));
                    if time < self.time {
                        return Err(ReadError::new(
                            format!("the time goes back from {} to {time}", self.time),
                            RECORD_AGAIN,
                        ));
                    }
                    self.time = time;
                }
                Command::ChangeScalar(id, value) => {
                    self.change(id, Change::Bit(value), tick)?;
                }
                Command::ChangeReal(id, value) => {
                    self.change(id, Change::Real(value), tick)?;
                }
                Command::ChangeVector(id, value) => {
                    if self.change(id, Change::Bits(&value), tick)? {
                        return Ok(true);
                    }
                }
                Command::Comment(text) => {
                    if let Some(note) = text.strip_prefix("end ") {
                        let mut words = Words(note);
                        self.ending = words.next().and_then(Word::quoted);
                    }
                }
                Command::Begin(_) | Command::End(_) => {}
                other => {
                    let what = format!("{} stands among the values", name_of(&other));
                    return Err(ReadError::new(what, RECORD_AGAIN));
                }
            }
        }
    }

    /// Applies one change to the tick; true if it ends the tick.
    fn change(&self, id: IdCode, change: Change<'_>, tick: &mut Tick) -> Result<bool, ReadError> {
        let Some(variable) = self.variables.get(&id) else {
            let what = format!("the value of \"{id}\", which the header does not have");
            return Err(ReadError::new(what, RECORD_AGAIN));
        };
        let wrong = || {
            ReadError::new(
                format!("the value of \"{id}\" does not fit its type"),
                RECORD_AGAIN,
            )
        };
        match *variable {
            Variable::Tick => {
                let number = change.integer().ok_or_else(wrong)?;
                if number <= tick.number {
                    let what = format!("tick {number} comes after tick {}", tick.number);
                    return Err(ReadError::new(what, RECORD_AGAIN));
                }
                tick.number = number;
                tick.time = self.time;
                return Ok(true);
            }
            Variable::Dropped => tick.dropped = change.integer().ok_or_else(wrong)?,
            Variable::Status => tick.status = change.status().ok_or_else(wrong)?,
            Variable::Station(station) => {
                tick.stations[station] = change.status().ok_or_else(wrong)?;
            }
            Variable::Column(index, kind) => {
                tick.values[index] = change.slot(kind).ok_or_else(wrong)?;
            }
        }
        Ok(false)
    }
}

/// The new value of a variable.
#[derive(Clone, Copy)]
enum Change<'a> {
    Bit(Value),
    Bits(&'a Vector),
    Real(f64),
}

impl Change<'_> {
    /// The bits as an integer.
    fn integer(self) -> Option<u64> {
        let Self::Bits(bits) = self else {
            return None;
        };
        if !(1..=64).contains(&bits.len()) {
            return None;
        }
        bits.iter().try_fold(0, |number, bit| match bit {
            Value::V0 => Some(number << 1),
            Value::V1 => Some(number << 1 | 1),
            Value::X | Value::Z => None,
        })
    }

    fn status(self) -> Option<i32> {
        let bits = u32::try_from(self.integer()?).ok()?;
        Some(bits.cast_signed())
    }

    fn slot(self, kind: ValueKind) -> Option<Slot> {
        match (kind, self) {
            (ValueKind::Bit, Self::Bit(Value::X | Value::Z)) => Some(Slot::from_real(f64::NAN)),
            (ValueKind::Bit, Self::Bit(bit)) => {
                let set = bit == Value::V1;
                Some(Slot::from_real(f64::from(u8::from(set))))
            }
            (ValueKind::Real, Self::Real(value)) => {
                Some(ValueKind::Real.kept(Slot::from_real(value)))
            }
            (ValueKind::Signed | ValueKind::Unsigned, _) => self.integer().map(Slot::from_unsigned),
            (ValueKind::Count, _) => {
                let count = u32::try_from(self.integer()?).ok()?;
                Some(Slot::from_real(f64::from(count)))
            }
            _ => None,
        }
    }
}

/// The information in the header, comment by comment.
#[derive(Default)]
struct Header {
    version: Option<u32>,
    nanoseconds: bool,
    columns: Columns,
    variables: HashMap<IdCode, Variable>,
}

impl Header {
    fn take(&mut self, command: Command) -> Result<(), ReadError> {
        match command {
            Command::Timescale(1, TimescaleUnit::NS) => self.nanoseconds = true,
            Command::Comment(text) => self.comment(&text)?,
            Command::Date(_)
            | Command::Version(_)
            | Command::Timescale(..)
            | Command::ScopeDef(..)
            | Command::VarDef(..)
            | Command::Upscope => {}
            other => {
                let what = format!("{} stands in the header", name_of(&other));
                return Err(ReadError::new(what, RECORD_AGAIN));
            }
        }
        Ok(())
    }

    fn comment(&mut self, text: &str) -> Result<(), ReadError> {
        if let Some(version) = text.strip_prefix("tickbus recording ") {
            self.version = version.trim().parse().ok();
            return Ok(());
        }
        // Comments of other programs are ignored.
        if self.version.is_none() {
            return Ok(());
        }
        let mut words = Words(text);
        let Some(Word::Plain(what)) = words.next() else {
            return Ok(());
        };
        let understood = match what {
            "driver" => self.driver(words),
            "tick" => self.id(&mut words, Variable::Tick),
            "dropped" => self.id(&mut words, Variable::Dropped),
            "status" => self.status(words),
            "signal" | "edges" => self.column(what == "edges", words),
            _ => Some(()),
        };
        understood.ok_or_else(|| {
            ReadError::new(
                format!("the comment \"{what} …\" is not as tickbus writes it"),
                RECORD_AGAIN,
            )
        })
    }

    fn driver(&mut self, mut words: Words<'_>) -> Option<()> {
        self.columns.driver = words.next()?.quoted()?;
        // VCD of another program and CSV that were saved as a recording have no role.
        if let Some(role) = words.next() {
            role.plain()?.clone_into(&mut self.columns.role);
        }
        Some(())
    }

    fn id(&mut self, words: &mut Words<'_>, variable: Variable) -> Option<()> {
        let id = words.next()?.plain()?.parse().ok()?;
        self.variables.insert(id, variable).is_none().then_some(())
    }

    fn status(&mut self, mut words: Words<'_>) -> Option<()> {
        let id = words.next()?.plain()?.parse().ok()?;
        let variable = match words.next() {
            None => Variable::Status,
            Some(word) => {
                let (key, station) = word.pair()?;
                (key == "station").then_some(())?;
                self.columns.stations.push(station);
                Variable::Station(self.columns.stations.len() - 1)
            }
        };
        self.variables.insert(id, variable).is_none().then_some(())
    }

    fn column(&mut self, is_edges: bool, mut words: Words<'_>) -> Option<()> {
        let id = words.next()?.plain()?.parse().ok()?;
        let address: Option<Address> = match words.next()?.plain()? {
            "-" => None,
            address => Some(address.parse().ok()?),
        };
        let data_type: DataType = words.next()?.plain()?.parse().ok()?;
        let mut column = Column {
            name: words.next()?.quoted()?,
            is_edges,
            kind: ValueKind::Count,
            address,
            data_type: Some(data_type),
            unit: None,
            station: String::new(),
        };
        let mut scaled = false;
        for word in words {
            match word {
                Word::Plain("scaled") => scaled = true,
                Word::Plain(_) | Word::Quoted(_) => return None,
                Word::Pair("unit", value) => column.unit = Some(value),
                Word::Pair("station", value) => column.station = value,
                // A later version may state more.
                Word::Pair(..) => {}
            }
        }
        if !is_edges {
            column.kind = ValueKind::of(data_type, scaled);
        }
        let variable = Variable::Column(self.columns.columns.len(), column.kind);
        self.columns.columns.push(column);
        (self.columns.columns.len() <= MOST_COLUMNS).then_some(())?;
        self.variables.insert(id, variable).is_none().then_some(())
    }

    /// Checks the header for completeness once it is over.
    fn check(&self) -> Result<bool, ReadError> {
        match self.version {
            None => {
                return Err(ReadError::of_file(
                    "this VCD file was not made by tickbus",
                    "only recordings of tickbus can be read: they say in comments what their variables are",
                ));
            }
            Some(VERSION) => {}
            Some(other) => {
                return Err(ReadError::of_file(
                    format!(
                        "this recording has version {other}, this tickbus reads version {VERSION}"
                    ),
                    "read it with the tickbus that made it, or a newer one",
                ));
            }
        }
        let has = |variable| self.variables.values().any(|known| *known == variable);
        let needed = [Variable::Tick, Variable::Dropped, Variable::Status];
        if !self.nanoseconds || !needed.into_iter().all(has) {
            return Err(ReadError::of_file(
                "the header lacks the time scale of 1 ns, the tick, its status or the dropped ticks",
                RECORD_AGAIN,
            ));
        }
        Ok(true)
    }
}

/// One word of a comment.
#[derive(Debug)]
enum Word<'a> {
    Plain(&'a str),
    Quoted(String),
    Pair(&'a str, String),
}

impl<'a> Word<'a> {
    fn plain(self) -> Option<&'a str> {
        match self {
            Self::Plain(word) => Some(word),
            _ => None,
        }
    }

    fn quoted(self) -> Option<String> {
        match self {
            Self::Quoted(text) => Some(text),
            _ => None,
        }
    }

    fn pair(self) -> Option<(&'a str, String)> {
        match self {
            Self::Pair(key, value) => Some((key, value)),
            _ => None,
        }
    }
}

/// The words of a comment: plain ones, texts in quotes, and `key="text"`.
struct Words<'a>(&'a str);

impl<'a> Iterator for Words<'a> {
    type Item = Word<'a>;

    fn next(&mut self) -> Option<Word<'a>> {
        let text = self.0.trim_start();
        let end = text.find(char::is_whitespace).unwrap_or(text.len());
        let open = text[..end].find('"');
        let close = open.and_then(|open| Some(open + 1 + text[open + 1..].find('"')?));
        let (Some(open), Some(close)) = (open, close) else {
            let (word, rest) = text.split_at(end);
            self.0 = rest;
            return (!word.is_empty()).then_some(Word::Plain(word));
        };
        let quoted = unescaped(&text[open + 1..close]);
        self.0 = &text[close + 1..];
        Some(match text[..open].strip_suffix('=') {
            Some(key) => Word::Pair(key, quoted),
            None => Word::Quoted(quoted),
        })
    }
}

/// The text with its `\u{…}` escapes decoded.
fn unescaped(text: &str) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find("\\u{") {
        let (before, escape) = rest.split_at(at);
        out.push_str(before);
        let code = escape[3..].split_once('}');
        let c = code.and_then(|(code, _)| char::from_u32(u32::from_str_radix(code, 16).ok()?));
        if let (Some((_, behind)), Some(c)) = (code, c) {
            out.push(c);
            rest = behind;
        } else {
            out.push_str("\\u{");
            rest = &escape[3..];
        }
    }
    out.push_str(rest);
    out
}

fn cut_header() -> ReadError {
    ReadError::new("the recording is cut within its header", RECORD_AGAIN)
}

/// The VCD parser's error in our words.
fn fault(error: &io::Error) -> ReadError {
    let inner = error.get_ref().and_then(|inner| inner.downcast_ref());
    match inner {
        Some(parse) => {
            let parse: &ParseError = parse;
            ReadError::new(format!("this is no VCD: {}", parse.kind()), RECORD_AGAIN)
        }
        None => ReadError::io(error),
    }
}

fn name_of(command: &Command) -> &'static str {
    match command {
        Command::Timestamp(_) => "a time",
        Command::ChangeScalar(..)
        | Command::ChangeVector(..)
        | Command::ChangeReal(..)
        | Command::ChangeString(..) => "a value",
        Command::Begin(_) => "a dump",
        Command::End(_) => "an $end",
        _ => "a declaration",
    }
}
