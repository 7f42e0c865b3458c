//! The lines that a client may send.
//!
//! ```text
//! line       = [key | ident | values | connect | disconnect | name-of | list | "PING" | "BYE"] (CRLF | LF)
//! key        = "KEY" 16*128(visible character)
//! ident      = ("VR" | "VP") name 1*(("Q" | "I" | "AQ" | "AI") 1*DIGIT) *("V=2" | "V=3" | "ALIVE=" time)
//! values     = "P" *(channel "=" number)
//! connect    = "CONNECT" 1*(channel ":" name ":" channel)
//! disconnect = "DISCONNECT" 1*channel
//! name-of    = "NAME" channel 1*120(character without controls)
//! list       = "LIST" ["NAMES"]
//! channel    = ("Q" | "I" | "AQ" | "AI") 1*DIGIT
//! number     = ["-" | "+"] (1*DIGIT ["." *DIGIT] | "." 1*DIGIT) ["E" ["-" | "+"] 1*DIGIT]
//! time       = 1*DIGIT ["." 1*DIGIT] ("ms" | "s")
//! name       = 1*63(ALPHA | DIGIT | "_" | "-" | ".")
//! ```
//!
//! Words are separated by blanks or tabs. Keywords and channels are read in any case. Blanks beside `:` and `=` do not
//! count, since the published examples have some.

use crate::channel::{Channel, Counts, Kind, MOST_CHANNELS};
use crate::device::Role;
use crate::label::{LONGEST_LABEL, Label};
use crate::name::{LONGEST_NAME, is_name, is_shown_name};
use crate::number::Number;
use crate::refusal::{Code, Refusal};
use tickbus_base::time::Nanos;

/// The longest line, in bytes, with its end.
pub const LONGEST_LINE: usize = 4096;

/// The shortest time that a client can promise between two lines: threads and networks are some milliseconds late.
pub const LEAST_PROMISE: Nanos = Nanos::from_millis(10);

/// The longest such time: 60 s.
pub const LONGEST_PROMISE: Nanos = Nanos::from_secs(60);

/// A line, read as far as its keyword says what it is.
#[derive(Clone, Debug)]
pub enum Line<'a> {
    /// An empty line.
    Nothing,
    /// The key of the laboratory, as the client states it.
    Key(&'a [u8]),
    /// The client's identification.
    Identify(Identification<'a>),
    /// Values of its outputs.
    Values(Values<'a>),
    /// Connections to make.
    Connect(Joints<'a>),
    /// Channels whose connections are to be cut.
    Disconnect(Channels<'a>),
    /// The label of a channel.
    Name(Channel, Label),
    /// A request for the list of devices.
    List {
        /// With the labels of their channels.
        with_names: bool,
    },
    /// A sign of life.
    Ping,
    /// Good-bye.
    Bye,
}

/// A client's description of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identification<'a> {
    /// The role.
    pub role: Role,
    /// The name.
    pub name: &'a str,
    /// The channels.
    pub counts: Counts,
    /// True if the client wants confirmations: version 2 and later.
    pub is_version_2: bool,
    /// True if the client wants to learn when an input loses its source: version 3.
    pub hears_losses: bool,
    /// The client promises a line at least this often.
    pub alive: Option<Nanos>,
}

/// Reads a line, without its end.
///
/// # Errors
///
/// The line is not in the grammar. The items that the iterators of [`Line`] yield can be invalid as well.
pub fn parse(line: &[u8]) -> Result<Line<'_>, Refusal> {
    const VERBS: [&str; 7] = ["P", "CONNECT", "DISCONNECT", "LIST", "PING", "BYE", "NAME"];

    let mut words = Words(line);
    let Some(keyword) = words.word() else {
        return match words.sign() {
            None => Ok(Line::Nothing),
            Some(_) => Err(words.unexpected("a keyword such as P or CONNECT")),
        };
    };
    if keyword.eq_ignore_ascii_case(b"KEY") {
        // A key can have any sign, and no answer repeats it.
        return Ok(Line::Key(words.0.trim_ascii()));
    }
    if let Some(role) = Role::parse(keyword) {
        return identification(role, words).map(Line::Identify);
    }
    let verb = VERBS
        .iter()
        .position(|verb| keyword.eq_ignore_ascii_case(verb.as_bytes()));
    let simple = match verb {
        Some(0) => return Ok(Line::Values(Values::said(words))),
        Some(1) => {
            return words
                .not_empty("I1:NAME:Q2")
                .map(|()| Line::Connect(Joints(words)));
        }
        Some(2) => {
            return words
                .not_empty("I1")
                .map(|()| Line::Disconnect(Channels(words)));
        }
        Some(3) => {
            let word = words.word();
            let with_names = word.is_some_and(|word| word.eq_ignore_ascii_case(b"NAMES"));
            if let Some(word) = word.filter(|_| !with_names) {
                return Err(Code::Syntax.because(format_args!(
                    "\"{}\" stands behind LIST; write LIST or LIST NAMES",
                    shown(word)
                )));
            }
            Line::List { with_names }
        }
        Some(4) => Line::Ping,
        Some(5) => Line::Bye,
        Some(6) => {
            let channel = words.channel()?;
            let label = Label::read(words.0).ok_or_else(|| {
                Code::Syntax.because(format_args!(
                    "{channel} needs a name of 1 to {LONGEST_LABEL} printable characters of UTF-8, such as NAME {channel} Level"
                ))
            })?;
            return Ok(Line::Name(channel, label));
        }
        _ => {
            return Err(Code::Syntax.because(format_args!(
                "\"{}\" is no keyword; write VR, VP, P, CONNECT, DISCONNECT, NAME, LIST, PING or BYE",
                shown(keyword)
            )));
        }
    };
    words.end().map(|()| simple)
}

fn identification(role: Role, mut words: Words<'_>) -> Result<Identification<'_>, Refusal> {
    let name = words.word().and_then(|word| std::str::from_utf8(word).ok());
    let Some(name) = name.filter(|name| is_name(name)) else {
        return Err(Code::Syntax.because(format_args!(
            "{} needs a name of 1 to {LONGEST_NAME} letters, digits, _, - and .",
            role.keyword()
        )));
    };
    let mut counts = [None; 4];
    let (mut version, mut alive) = (None, None);
    while let Some(word) = words.word() {
        if words.take(b'=') {
            let value = words.word();
            if word.eq_ignore_ascii_case(b"V") && version.is_none() {
                version = match value {
                    Some(b"2") => Some(2),
                    Some(b"3") => Some(3),
                    _ => return Err(Code::Syntax.because("the version is 2 or 3, as V=2")),
                };
            } else if word.eq_ignore_ascii_case(b"ALIVE") && alive.is_none() {
                alive = Some(promise(value.unwrap_or_default())?);
            } else {
                return Err(Code::Syntax.because(format_args!(
                    "\"{}=\" stands where V=2 or ALIVE=500ms was expected, each at most once",
                    shown(word)
                )));
            }
            continue;
        }
        if version.is_some() || alive.is_some() {
            return Err(Code::Syntax.because(format_args!(
                "\"{}\" stands where the end of the line was expected",
                shown(word)
            )));
        }
        let Some((kind, count)) = Kind::with_number(word) else {
            return Err(Code::Syntax.because(format_args!(
                "\"{}\" is no number of channels; write Q08, I08, AQ02, AI03 or the like",
                shown(word)
            )));
        };
        if count > MOST_CHANNELS {
            return Err(Code::Limit.because(format_args!(
                "\"{}\" is too many: a client has up to {MOST_CHANNELS} channels of a kind",
                shown(word)
            )));
        }
        if counts[kind as usize].replace(count).is_some() {
            let letters = kind.letters();
            return Err(Code::Syntax.because(format_args!("{letters} stands here twice")));
        }
    }
    words.end()?;
    if counts == [None; 4] {
        return Err(Code::Syntax.because("say how many channels there are, such as Q08 I08"));
    }
    let [q, i, aq, ai] = counts.map(Option::unwrap_or_default);
    Ok(Identification {
        role,
        name,
        counts: Counts::new(q, i, aq, ai),
        is_version_2: version.is_some(),
        hears_losses: version == Some(3),
        alive,
    })
}

/// Reads the time within which a client promises a line.
fn promise(text: &[u8]) -> Result<Nanos, Refusal> {
    let time = std::str::from_utf8(text).ok();
    let time = time.and_then(|text| text.parse::<Nanos>().ok());
    time.filter(|time| (LEAST_PROMISE..=LONGEST_PROMISE).contains(time))
        .ok_or_else(|| {
            Code::Syntax.because(format_args!(
                "\"{}\" is no time for ALIVE; write one of {LEAST_PROMISE} to {LONGEST_PROMISE}, as ALIVE=500ms",
                shown(text)
            ))
        })
}

/// The values of a line, each checked when it is reached.
#[derive(Clone, Debug)]
pub struct Values<'a> {
    words: Words<'a>,
    /// True if `?` may stand for the value of an input that has lost its source.
    may_be_lost: bool,
}

impl<'a> Values<'a> {
    const fn said(words: Words<'a>) -> Self {
        Self {
            words,
            may_be_lost: false,
        }
    }

    /// The values in a line from the dispatcher, after its keyword.
    pub const fn delivered(text: &'a [u8]) -> Self {
        Self {
            words: Words(text),
            may_be_lost: true,
        }
    }
}

impl Iterator for Values<'_> {
    type Item = Result<(Channel, Number), Refusal>;

    fn next(&mut self) -> Option<Self::Item> {
        let may_be_lost = self.may_be_lost;
        self.words.item(|words| {
            let channel = words.channel()?;
            if !words.take(b'=') {
                return Err(words.unexpected("= and a number, as in Q1=20"));
            }
            let text = words.word().unwrap_or_default();
            match Number::parse(text) {
                _ if may_be_lost && text == b"?" => Ok((channel, Number::LOST)),
                Some(number) => Ok((channel, number)),
                None => Err(Code::Syntax.because(format_args!(
                    "\"{}\" is no number for {channel}; write one such as 20 or -4.5, of up to 23 characters",
                    shown(text)
                ))),
            }
        })
    }
}

/// One connection, as a client requests it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Joint<'a> {
    /// The channel of the client itself.
    pub own: Channel,
    /// The other client: its name, or `P1` for the first process.
    pub peer: &'a str,
    /// The channel of the other client.
    pub channel: Channel,
}

/// The connections of a line, each checked when it is reached.
#[derive(Clone, Debug)]
pub struct Joints<'a>(Words<'a>);

impl<'a> Joints<'a> {
    /// The connections in a text without a keyword.
    pub(crate) const fn of(text: &'a [u8]) -> Self {
        Self(Words(text))
    }
}

impl<'a> Iterator for Joints<'a> {
    type Item = Result<Joint<'a>, Refusal>;

    fn next(&mut self) -> Option<Self::Item> {
        const SHAPE: &str = ": as in I1:NAME:Q2";

        self.0.item(|words| {
            let own = words.channel()?;
            if !words.take(b':') {
                return Err(words.unexpected(SHAPE));
            }
            let word = words.word().unwrap_or_default();
            let peer = std::str::from_utf8(word).unwrap_or_default();
            if !is_shown_name(peer) {
                let text = format!("\"{}\" cannot be the name of a client", shown(word));
                return Err(Code::Syntax.because(text));
            }
            if !words.take(b':') {
                return Err(words.unexpected(SHAPE));
            }
            let channel = words.channel()?;
            Ok(Joint { own, peer, channel })
        })
    }
}

/// The channels of a line, each checked when it is reached.
#[derive(Clone, Debug)]
pub struct Channels<'a>(Words<'a>);

impl Iterator for Channels<'_> {
    type Item = Result<Channel, Refusal>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.item(Words::channel)
    }
}

/// The rest of a line.
#[derive(Clone, Copy, Debug)]
struct Words<'a>(&'a [u8]);

impl<'a> Words<'a> {
    fn skip_blanks(&mut self) {
        while let [b' ' | b'\t', rest @ ..] = self.0 {
            self.0 = rest;
        }
    }

    /// Takes the next word; `None` at a sign and at the end.
    fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let is_end = |byte: &u8| matches!(byte, b' ' | b'\t' | b':' | b'=');
        let length = self.0.iter().position(is_end).unwrap_or(self.0.len());
        let (word, rest) = self.0.split_at(length);
        self.0 = rest;
        (length > 0).then_some(word)
    }

    /// The sign that comes next.
    fn sign(&mut self) -> Option<u8> {
        self.skip_blanks();
        self.0.first().copied().filter(|byte| b":=".contains(byte))
    }

    /// Takes this sign, if it comes next.
    fn take(&mut self, sign: u8) -> bool {
        let is_next = self.sign() == Some(sign);
        if is_next {
            self.0 = &self.0[1..];
        }
        is_next
    }

    fn channel(&mut self) -> Result<Channel, Refusal> {
        let word = self.word().unwrap_or_default();
        Channel::parse(word).ok_or_else(|| {
            Code::Syntax.because(format_args!(
                "\"{}\" is no channel; write Q1, I1, AQ1, AI1 or the like",
                shown(word)
            ))
        })
    }

    /// The next item of a list; after a mistake there are no more.
    fn item<T>(
        &mut self,
        read: impl FnOnce(&mut Self) -> Result<T, Refusal>,
    ) -> Option<Result<T, Refusal>> {
        self.skip_blanks();
        if self.0.is_empty() {
            return None;
        }
        let item = read(self);
        if item.is_err() {
            self.0 = &[];
        }
        Some(item)
    }

    fn not_empty(&mut self, example: &str) -> Result<(), Refusal> {
        self.skip_blanks();
        if self.0.is_empty() {
            return Err(Code::Syntax.because(format_args!("say what, such as {example}")));
        }
        Ok(())
    }

    fn end(&mut self) -> Result<(), Refusal> {
        self.skip_blanks();
        if self.0.is_empty() {
            return Ok(());
        }
        Err(self.unexpected("the end of the line"))
    }

    fn unexpected(&self, expected: &str) -> Refusal {
        Code::Syntax.because(format_args!(
            "\"{}\" stands where {expected} was expected",
            shown(self.0)
        ))
    }
}

/// A client's text, shortened for an answer of one line.
fn shown(bytes: &[u8]) -> String {
    const LONGEST: usize = 40;

    let text = printable(&bytes[..bytes.len().min(LONGEST)]).replace('"', "?");
    let end = if bytes.len() > LONGEST { ".." } else { "" };
    text + end
}

/// A text with ? in place of all characters that cannot be printed.
pub fn printable(bytes: &[u8]) -> String {
    let character = |byte: &u8| match byte {
        b' '..=b'~' => char::from(*byte),
        _ => '?',
    };
    bytes.iter().map(character).collect()
}

/// A value in its usual form within a line.
pub(crate) struct QuickValue {
    /// The place of its output.
    pub(crate) place: usize,
    pub(crate) number: Number,
    /// Where the next value begins, or the next line.
    pub(crate) next: usize,
    pub(crate) is_last: bool,
}

/// How a line of values in its usual form begins.
pub(crate) const QUICK: &[u8] = b"P ";

/// Reads a value in its usual form at `at` in a line of values, in one pass; its client has these `counts`. `None` if
/// the line needs the full parser.
#[inline]
pub(crate) fn quick_value(bytes: &[u8], mut at: usize, counts: Counts) -> Option<QuickValue> {
    let kind = match *bytes.get(at)? {
        b'Q' => Kind::DigitalOutput,
        b'A' if *bytes.get(at + 1)? == b'Q' => {
            at += 1;
            Kind::AnalogOutput
        }
        _ => return None,
    };
    at += 1;
    let first = at;
    let mut number = 0_u16;
    while let digit @ b'0'..=b'9' = *bytes.get(at)? {
        if at - first == 4 {
            return None;
        }
        number = number * 10 + u16::from(digit - b'0');
        at += 1;
    }
    if at == first || bytes[at] != b'=' {
        return None;
    }
    let place = counts.place(Channel { kind, number })?;
    let (number, length) = Number::quick(&bytes[at + 1..])?;
    at += 1 + length;
    let end = *bytes.get(at)?;
    at += match end {
        b' ' | b'\n' => 1,
        b'\r' if *bytes.get(at + 1)? == b'\n' => 2,
        _ => return None,
    };
    (at <= LONGEST_LINE).then_some(QuickValue {
        place,
        number,
        next: at,
        is_last: end != b' ',
    })
}
