//! Reading VCD of other programs: each time is a tick, and each variable a signal that is named after its scopes.

use std::collections::HashMap;
use std::io::{self, BufRead, Read as _};

use super::vcd::MOST_COLUMNS;
use super::{RECORD_AGAIN, ReadError};
use crate::{Column, Columns, Tick, ValueKind};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::{DataType, Slot};

/// The longest line, in bytes.
const LONGEST: u64 = 64 << 20;

/// Femtoseconds in a nanosecond.
const FEMTOS: i128 = 1_000_000;

/// The remedy for a file that is not VCD.
const EXPORT_AGAIN: &str = "write it as VCD (IEEE 1364) again";

/// A variable of the file.
#[derive(Clone, Copy, Debug)]
struct Variable {
    column: usize,
    shape: Shape,
}

/// The meaning of a variable's bits.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Bit,
    Unsigned,
    /// Two's complement of this many bits.
    Signed(usize),
    Real,
}

pub(super) struct ForeignReader<R> {
    tokens: Tokens<R>,
    /// By identifier; several names can have the same one, and texts have none.
    variables: HashMap<Vec<u8>, Vec<Variable>>,
    /// The length of a unit of time, in femtoseconds.
    unit: i128,
    /// The time whose changes are being read, in units.
    time: Option<u64>,
    at: Nanos,
}

/// True if a VCD file that begins like this is a recording of tickbus.
pub(super) fn is_own(head: &[u8]) -> bool {
    let mark = b"tickbus recording ";
    head.windows(mark.len()).any(|part| part == mark)
}

impl<R: BufRead> ForeignReader<R> {
    /// Reads the header.
    pub(super) fn open(from: R) -> Result<(Self, Columns), (ReadError, u64)> {
        let mut reader = Self {
            tokens: Tokens::new(from),
            variables: HashMap::new(),
            unit: FEMTOS,
            time: None,
            at: Nanos::ZERO,
        };
        let columns = reader.header();
        let columns = columns.map_err(|fault| (fault, reader.line()))?;
        Ok((reader, columns))
    }

    pub(super) fn line(&self) -> u64 {
        self.tokens.number
    }

    fn header(&mut self) -> Result<Columns, ReadError> {
        let mut columns = Columns::default();
        let mut scopes: Vec<String> = Vec::new();
        let mut names = HashMap::new();
        loop {
            let Some(command) = self.tokens.next()? else {
                return Err(ReadError::new(
                    "the file ends within its header",
                    EXPORT_AGAIN,
                ));
            };
            let Some(command) = command.strip_prefix('$').map(str::to_owned) else {
                let what = format!("\"{}\" is no command of a header", shown(&command));
                return Err(ReadError::new(what, EXPORT_AGAIN));
            };
            let words = self.words(&command)?;
            match command.as_str() {
                "enddefinitions" => break,
                "timescale" => self.unit = unit(&words.concat())?,
                "scope" => {
                    let name = words.get(1).ok_or_else(|| incomplete("scope"))?;
                    scopes.push(name.clone());
                }
                "upscope" if scopes.pop().is_none() => {
                    return Err(ReadError::new("$upscope ends no scope", EXPORT_AGAIN));
                }
                "var" => {
                    if let Some(column) = self.variable(&words, &scopes, columns.columns.len())? {
                        let name = unique(&column.name, &mut names);
                        columns.columns.push(Column { name, ..column });
                    }
                    if columns.columns.len() > MOST_COLUMNS {
                        let what = format!("the file has more than {MOST_COLUMNS} variables");
                        return Err(ReadError::new(what, "export the ones that you need"));
                    }
                }
                // Dates, comments, attributes of single programs.
                _ => {}
            }
        }
        if columns.columns.is_empty() {
            return Err(ReadError::of_file(
                "the file has no variable with a number",
                "export signals: wires, integers or reals",
            ));
        }
        Ok(columns)
    }

    /// The words up to `$end`.
    fn words(&mut self, command: &str) -> Result<Vec<String>, ReadError> {
        let mut words = Vec::new();
        // A comment can be long, and none of its words is needed.
        let is_wanted = matches!(command, "timescale" | "scope" | "var");
        loop {
            match self.tokens.next()? {
                None => {
                    let what = format!("the file ends within ${}", shown(command));
                    return Err(ReadError::new(what, EXPORT_AGAIN));
                }
                Some(word) if word == "$end" => return Ok(words),
                Some(word) if is_wanted => words.push(word),
                Some(_) => {}
            }
        }
    }

    /// Takes a variable; `None` for one without a number.
    fn variable(
        &mut self,
        words: &[String],
        scopes: &[String],
        column: usize,
    ) -> Result<Option<Column>, ReadError> {
        let [kind, width, id, name, index @ ..] = words else {
            return Err(incomplete("var"));
        };
        let known = self.variables.entry(id.as_bytes().to_vec()).or_default();
        let bits: usize = width.parse().map_err(|_| {
            let what = format!("\"{}\" is no number of bits", shown(width));
            ReadError::new(what, EXPORT_AGAIN)
        })?;
        let (shape, data_type) = match (kind.as_str(), bits) {
            ("string" | "event", _) => return Ok(None),
            ("real" | "realtime" | "shortreal" | "real_parameter", _) => {
                (Shape::Real, DataType::Lreal)
            }
            ("integer" | "int", 1..=32) => (Shape::Signed(bits), DataType::Dint),
            (_, 0 | 1) => (Shape::Bit, DataType::Bool),
            (_, 2..=8) => (Shape::Unsigned, DataType::Usint),
            (_, 9..=16) => (Shape::Unsigned, DataType::Uint),
            (_, 17..=32) => (Shape::Unsigned, DataType::Udint),
            _ => (Shape::Unsigned, DataType::Lreal),
        };
        known.push(Variable { column, shape });
        let index = index.concat();
        let mut name = format!("{name}{index}");
        // The range of a vector is in its type; the number of a single bit is a part of its name.
        if name.ends_with(']')
            && let Some(open) = name.rfind('[')
            && name[open..].contains(':')
        {
            name.truncate(open);
        }
        let path = scopes.iter().map(String::as_str).chain([name.as_str()]);
        let name = path.collect::<Vec<_>>().join(".");
        Ok(Some(Column::plain(name, data_type, String::new())))
    }

    /// Reads all changes of the next time.
    pub(super) fn next(&mut self, tick: &mut Tick) -> Result<bool, ReadError> {
        if tick.number == 0 {
            // Nothing is known of a variable before its first value.
            tick.values.fill(Slot::from_real(f64::NAN));
        }
        let mut time = self.time.take();
        loop {
            let Some(word) = self.tokens.next()? else {
                return Ok(time.is_some_and(|_| self.end(tick)));
            };
            if let Some(next) = word.strip_prefix('#') {
                let next: u64 = next.parse().map_err(|_| {
                    let what = format!("\"{}\" is no time", shown(&word));
                    ReadError::new(what, RECORD_AGAIN)
                })?;
                match time {
                    Some(time) if next < time => {
                        let what = format!("the time goes back from {time} to {next}");
                        return Err(ReadError::new(what, RECORD_AGAIN));
                    }
                    Some(time) if next > time => {
                        self.end(tick);
                        self.time = Some(next);
                        self.at = self.nanos(next)?;
                        return Ok(true);
                    }
                    _ => {}
                }
                time = Some(next);
                self.at = self.nanos(next)?;
            } else if let Some(command) = word.strip_prefix('$') {
                // Values stand between these words and $end.
                if !matches!(
                    command,
                    "dumpvars" | "dumpall" | "dumpon" | "dumpoff" | "end"
                ) {
                    self.words(command)?;
                }
            } else {
                self.change(&word, tick)?;
                time = time.or(Some(0));
            }
        }
    }

    /// Ends the tick of the present time.
    fn end(&self, tick: &mut Tick) -> bool {
        tick.number += 1;
        tick.time = self.at;
        true
    }

    fn nanos(&self, time: u64) -> Result<Nanos, ReadError> {
        let nanos = i128::from(time) * self.unit / FEMTOS;
        let nanos = i64::try_from(nanos).map_err(|_| {
            let what = format!("the time {time} is beyond 292 years");
            ReadError::new(what, "export a shorter time, or correct $timescale")
        })?;
        Ok(Nanos(nanos))
    }

    /// Takes one change: `1!`, `b101 !`, `r1.5 !` or `stext !`.
    fn change(&mut self, word: &str, tick: &mut Tick) -> Result<(), ReadError> {
        let mut chars = word.chars();
        let kind = chars.next().unwrap_or(' ');
        let rest = chars.as_str();
        let (value, id) = match kind {
            'b' | 'B' | 'r' | 'R' | 's' | 'S' => (rest, self.tokens.next()?),
            'p' => {
                return Err(ReadError::new(
                    "values of ports (extended VCD) cannot be read",
                    "export four-state VCD ($dumpvars)",
                ));
            }
            _ if bit(kind).is_some() => (&word[..kind.len_utf8()], Some(rest.to_owned())),
            _ => {
                let what = format!("\"{}\" is no change of a value", shown(word));
                return Err(ReadError::new(what, RECORD_AGAIN));
            }
        };
        let id = id.unwrap_or_default();
        let Some(variables) = self.variables.get(id.as_bytes()) else {
            let id = shown(&id);
            let what = format!("the value of \"{id}\", which the header does not have");
            return Err(ReadError::new(what, RECORD_AGAIN));
        };
        for Variable { column, shape } in variables {
            let number = match (kind, shape) {
                ('s' | 'S', _) => continue,
                ('r' | 'R', _) => value.parse().ok(),
                (_, Shape::Signed(width)) => number(value, Some(*width)),
                _ => number(value, None),
            };
            let number = number.ok_or_else(|| {
                let what = format!("\"{}\" is no value", shown(word));
                ReadError::new(what, RECORD_AGAIN)
            })?;
            let kind = match shape {
                Shape::Bit => ValueKind::Bit,
                Shape::Unsigned | Shape::Signed(_) | Shape::Real => ValueKind::Real,
            };
            tick.values[*column] = kind.kept(Slot::from_real(number));
        }
        Ok(())
    }
}

/// A bit; `NaN` if it is unknown. VHDL has nine states.
fn bit(state: char) -> Option<f64> {
    match state.to_ascii_lowercase() {
        '0' | 'l' => Some(0.0),
        '1' | 'h' => Some(1.0),
        'x' | 'z' | 'u' | 'w' | '-' => Some(f64::NAN),
        _ => None,
    }
}

/// The number of these bits, or of two's complement of `width` bits; NaN if one is unknown.
fn number(bits: &str, width: Option<usize>) -> Option<f64> {
    if bits.is_empty() {
        return None;
    }
    let whole = bits.chars().try_fold(0.0, |number, state| {
        bit(state).map(|bit| number * 2.0 + bit)
    })?;
    let is_negative = width.is_some_and(|width| bits.len() >= width && bits.starts_with('1'));
    let size = 2_f64.powi(i32::try_from(bits.len()).ok()?);
    Some(if is_negative { whole - size } else { whole })
}

/// The femtoseconds of a `$timescale`, such as `10ns`.
fn unit(text: &str) -> Result<i128, ReadError> {
    let digits = text
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(text.len());
    let (count, name) = text.split_at(digits);
    let femtos = match name {
        "s" => 1_000_000_000 * FEMTOS,
        "ms" => 1_000_000 * FEMTOS,
        "us" => 1_000 * FEMTOS,
        "ns" => FEMTOS,
        "ps" => FEMTOS / 1_000,
        "fs" => 1,
        _ => 0,
    };
    let count: Option<i128> = count.parse::<u32>().ok().map(Into::into);
    count
        .map(|count| count * femtos)
        .filter(|unit| *unit > 0)
        .ok_or_else(|| {
            let what = format!("\"{}\" is no time scale", shown(text));
            ReadError::new(what, "write one such as $timescale 1 ns $end")
        })
}

/// The name, or with a number if it is taken. `names` has how often each was given.
fn unique(name: &str, names: &mut HashMap<String, usize>) -> String {
    let mut own = name.to_owned();
    while names.contains_key(&own) {
        let given = names.entry(name.to_owned()).or_insert(1);
        *given += 1;
        own = format!("{name} ({given})");
    }
    names.insert(own.clone(), 1);
    own
}

fn incomplete(command: &str) -> ReadError {
    ReadError::new(format!("${command} is incomplete"), EXPORT_AGAIN)
}

/// The words of a file, which are separated by blanks and line ends.
struct Tokens<R> {
    inner: R,
    line: String,
    at: usize,
    /// The number of the line.
    number: u64,
}

impl<R: BufRead> Tokens<R> {
    const fn new(inner: R) -> Self {
        Self {
            inner,
            line: String::new(),
            at: 0,
            number: 0,
        }
    }

    fn next(&mut self) -> Result<Option<String>, ReadError> {
        loop {
            let rest = self.line[self.at..].trim_start();
            if let Some(word) = rest.split_ascii_whitespace().next() {
                self.at = self.line.len() - rest.len() + word.len();
                return Ok(Some(word.to_owned()));
            }
            let mut line = Vec::new();
            let read = (&mut self.inner).take(LONGEST).read_until(b'\n', &mut line);
            let read = read.map_err(|error| ReadError::io(&error))?;
            self.number += 1;
            if read == 0 {
                return Ok(None);
            }
            if read as u64 == LONGEST {
                let what = format!("a line is longer than {} MiB", LONGEST >> 20);
                return Err(ReadError::io(&io::Error::other(what)));
            }
            // Names and comments may be in any encoding.
            self.line = String::from_utf8_lossy(&line).into_owned();
            self.at = 0;
        }
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    /// A file as simulators of hardware write it.
    const FILE: &str = "$date today $end\n$version Some simulator $end\n$comment $scope in words $end\n\
        $timescale 10ps $end\n$scope module top $end\n$var wire 1 ! clk $end\n$var reg 8 \" data [7:0] $end\n\
        $scope begin cpu $end\n$var integer 32 # i $end\n$var real 64 $ level $end\n$var string 1 % text $end\n\
        $var wire 1 ! clk $end\n$var wire 1 & bus[3] $end\n$var wire 40 ' wide $end\n$upscope $end\n\
        $var wire 1 ( clk $end\n$upscope $end\n$enddefinitions $end\n\
        $dumpvars\nx!\nbx \"\nb0 #\nr1.5 $\nsidle %\n1&\nz(\n$end\n\
        #100\n1!\nb1010 \"\nb11111111111111111111111111111110 #\n#100\n0&\n\
        #250 0! bZ0 \" sbusy % r-2e3 $\n$comment words 1! $end\n#300\n\
        b1111111111111111111111111111111111111111 '\nU!\n#1000000";

    /// A mistake, and its line.
    type Placed = (ReadError, u64);

    /// Number, time in nanoseconds and values.
    type Seen = (u64, i64, Vec<f64>);

    fn open(text: &'static str) -> Result<(ForeignReader<&'static [u8]>, Columns), Placed> {
        ForeignReader::open(text.as_bytes())
    }

    /// The ticks of a file.
    fn ticks(text: &'static str) -> Result<Vec<Seen>, Placed> {
        let (mut reader, columns) = open(text)?;
        let mut tick = Tick::new(&columns);
        let mut all = Vec::new();
        while reader
            .next(&mut tick)
            .map_err(|fault| (fault, reader.line()))?
        {
            let values = tick.values.iter().map(|value| value.real());
            all.push((tick.number, tick.time.0, values.collect()));
        }
        Ok(all)
    }

    #[test]
    fn every_variable_with_a_number_is_a_signal_of_its_scopes() {
        let (_, columns) = open(FILE).expect("VCD");
        let told = columns.columns.iter();
        let told: Vec<(&str, &str)> = told
            .map(|it| (&*it.name, it.data_type.expect("a type").name()))
            .collect();
        let expected = [
            ("top.clk", "BOOL"),
            ("top.data", "USINT"),
            ("top.cpu.i", "DINT"),
            ("top.cpu.level", "LREAL"),
            ("top.cpu.clk", "BOOL"),
            ("top.cpu.bus[3]", "BOOL"),
            ("top.cpu.wide", "LREAL"),
            ("top.clk (2)", "BOOL"),
        ];
        assert_eq!(told, expected);
    }

    #[test]
    fn each_time_is_a_tick_with_all_of_its_changes() {
        let found = ticks(FILE).expect("VCD");
        // NaN, which equals nothing, as its text.
        let x = f64::NAN;
        let expected = [
            (1, 0, vec![x, x, 0.0, 1.5, x, 1.0, x, x]),
            (2, 1, vec![1.0, 10.0, -2.0, 1.5, 1.0, 0.0, x, x]),
            (3, 2, vec![0.0, x, -2.0, -2000.0, 0.0, 0.0, x, x]),
            (
                4,
                3,
                vec![x, x, -2.0, -2000.0, x, 0.0, 1_099_511_627_775.0, x],
            ),
            (
                5,
                10_000,
                vec![x, x, -2.0, -2000.0, x, 0.0, 1_099_511_627_775.0, x],
            ),
        ];
        assert_eq!(format!("{found:?}"), format!("{expected:?}"));
    }

    #[test]
    fn damage_is_told_with_its_line() {
        let head = "$timescale 1 ns $end\n$var wire 1 ! a $end\n$enddefinitions $end\n";
        for (text, line, told) in [
            ("", 1, "the file ends within its header"),
            ("no VCD", 1, "\"no\" is no command of a header"),
            ("$comment x", 2, "the file ends within $comment"),
            ("$upscope $end", 1, "$upscope ends no scope"),
            (
                "\n$timescale 3 weeks $end",
                2,
                "\"3weeks\" is no time scale",
            ),
            ("$var wire 1 ! $end", 1, "$var is incomplete"),
            (
                "$var wire many ! a $end",
                1,
                "\"many\" is no number of bits",
            ),
            (
                "$var string 1 ! a $end $enddefinitions $end",
                1,
                "the file has no variable with a number",
            ),
            ("HEAD#x", 4, "\"#x\" is no time"),
            ("HEAD#5\n#4", 5, "the time goes back from 5 to 4"),
            (
                "HEAD#18446744073709551615",
                4,
                "the time 18446744073709551615 is beyond 292 years",
            ),
            (
                "HEAD1?",
                4,
                "the value of \"?\", which the header does not have",
            ),
            ("HEADb12 !", 4, "\"b12\" is no value"),
            ("HEADrtwo !", 4, "\"rtwo\" is no value"),
            ("HEADq!", 4, "\"q!\" is no change of a value"),
            (
                "HEADpU 0 0 !",
                4,
                "values of ports (extended VCD) cannot be read",
            ),
        ] {
            let text = text.replace("HEAD", head).leak();
            let (fault, at) = ticks(text).expect_err(text);
            assert_eq!((at, fault.mistake.what.as_str()), (line, told), "{text}");
        }
    }

    #[test]
    fn no_bytes_make_the_reader_panic() {
        for at in 0..FILE.len() {
            for byte in [b' ', b'$', b'#', b'9', b'-', b'[', 0xFF] {
                let mut bytes = FILE.as_bytes().to_vec();
                bytes[at] = byte;
                let Ok((mut reader, columns)) = ForeignReader::open(&*bytes) else {
                    continue;
                };
                let mut tick = Tick::new(&columns);
                let mut before = Nanos(i64::MIN);
                while reader.next(&mut tick).unwrap_or(false) {
                    assert!(tick.time >= before);
                    before = tick.time;
                }
            }
        }
    }
}
