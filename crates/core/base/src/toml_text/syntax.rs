//! Syntax errors of TOML text, in this project's words.

use toml::Spanned;
use toml::de::{DeTable, DeValue, Error};

use super::shown;
use crate::Mistake;

/// The effect of a syntax error on the rest of the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// The grammar of its line is broken, and perhaps that of the lines below it.
    Grammar,
    /// A list, table or string is not closed and swallows the following text.
    Endless,
    /// The lines can be separated, but a key or a value is invalid.
    Content,
    /// A key or a table appears twice.
    Double,
}

/// One syntax error.
#[derive(Debug)]
pub(super) struct SyntaxError {
    /// Byte offset of the error.
    pub(super) at: usize,
    pub(super) kind: Kind,
    /// True if the error makes a table header unreadable, so that the keys below it belong nowhere.
    pub(super) header: bool,
    pub(super) mistake: Mistake,
}

/// The syntax errors of a text in order, the first of each line, without mere consequences.
pub(super) fn faults(text: &str) -> Vec<SyntaxError> {
    let (root, mut errors) = DeTable::parse_recoverable(text);
    let begin = |error: &Error| begin(error, text);
    let endless = errors
        .iter()
        .find(|error| {
            ENDLESS
                .iter()
                .any(|begin| error.message().starts_with(begin))
        })
        .and_then(|error| endless(error, text, root.get_ref()));
    errors.sort_by_key(begin);
    let mut faults: Vec<SyntaxError> = Vec::new();
    let mut end = None;
    for error in &errors {
        let at = begin(error);
        if end.is_some_and(|end| at <= end) || endless.as_ref().is_some_and(|open| at >= open.at) {
            continue;
        }
        end = Some(line_around(text, at).end);
        faults.push(translate(error, text));
    }
    if let Some(endless) = endless {
        // Everything before it in the same line is just its key.
        let line = line_around(text, endless.at);
        faults.retain(|fault| fault.at < line.start);
        faults.push(endless);
    }
    without_consequences(faults, text)
}

/// The start of the span that an error blames, moved to a character boundary within the text.
fn begin(error: &Error, text: &str) -> usize {
    let at = error.span().map_or(0, |span| span.start).min(text.len());
    (0..=at)
        .rev()
        .find(|at| text.is_char_boundary(*at))
        .unwrap_or(0)
}

/// Drops duplicate keys that only result from a broken table header above them.
fn without_consequences(mut faults: Vec<SyntaxError>, text: &str) -> Vec<SyntaxError> {
    // Where the last broken header is, unless another header has followed it.
    let mut lost: Option<usize> = None;
    faults.retain(|fault| {
        if let Some(from) = lost {
            let mut lines = text[from..fault.at].lines();
            let found = lines.any(|line| line.trim_start().starts_with('['));
            lost = (!found).then_some(fault.at);
        }
        let consequence = lost.is_some() && fault.kind == Kind::Double && !fault.header;
        if fault.header {
            lost = Some(line_around(text, fault.at).end);
        }
        !consequence
    });
    faults
}

/// The line around byte offset `at`, without its line end.
pub(super) fn line_around(text: &str, at: usize) -> std::ops::Range<usize> {
    let bytes = text.as_bytes();
    let at = at.min(bytes.len());
    let start = bytes[..at]
        .iter()
        .rposition(|byte| *byte == b'\n')
        .map_or(0, |found| found + 1);
    let end = bytes[at..]
        .iter()
        .position(|byte| *byte == b'\n')
        .map_or(bytes.len(), |n| at + n);
    let end = if end > start && bytes[end - 1] == b'\r' {
        end - 1
    } else {
        end
    };
    start..end
}

/// The beginnings of the parser's messages about unterminated values.
const ENDLESS: [&str; 4] = [
    "cannot recurse further",
    "unclosed array,",
    "unclosed inline table,",
    "invalid multi-line",
];

/// The value that is not closed, or nested too deeply, that one of the [`ENDLESS`] messages is about.
fn endless(error: &Error, text: &str, root: &DeTable<'_>) -> Option<SyntaxError> {
    let message = error.message();
    let end = begin(error, text);
    let (at, what, right) = if message.starts_with(ENDLESS[0]) {
        (
            end,
            "lists and tables lie too deep in one another",
            "nothing here needs more than two levels",
        )
    } else {
        let at = open_value(root, text, end)?;
        match text.as_bytes().get(at)? {
            b'[' => (at, "this list is never closed", "end it with ]"),
            b'{' => (at, "this table is never closed", "end it with }"),
            _ => (
                at,
                "this text is never closed",
                "end it with the three quotes that begin it",
            ),
        }
    };
    Some(SyntaxError {
        at,
        kind: Kind::Endless,
        header: false,
        mistake: Mistake::new(what, right),
    })
}

/// The start of the outermost value that is still open at `end`.
fn open_value(table: &DeTable<'_>, text: &str, end: usize) -> Option<usize> {
    table
        .iter()
        .filter_map(|(_, value)| open_at(value, text, end))
        .min()
}

fn open_at(value: &Spanned<DeValue<'_>>, text: &str, end: usize) -> Option<usize> {
    let span = value.span();
    let written = text.get(span.clone())?;
    let reaches = span.start < end && end <= span.end;
    let unclosed = (written.starts_with('[') && !written.ends_with(']'))
        || (written.starts_with('{') && !written.ends_with('}'));
    match value.get_ref() {
        DeValue::Table(_) | DeValue::Array(_) if reaches || unclosed => Some(span.start),
        DeValue::String(_) if reaches => Some(span.start),
        // The span of a table with a header, or of a list of such tables, covers the header only.
        DeValue::Table(table) => open_value(table, text, end),
        DeValue::Array(list) => list
            .iter()
            .filter_map(|element| open_at(element, text, end))
            .min(),
        _ => None,
    }
}

/// The kind of error that the parser's message reports.
fn kind_of(message: &str) -> Kind {
    const BEGINNINGS: [&str; 9] = [
        "extra ",
        "invalid inline table",
        "invalid key",
        "invalid table",
        "key with no value",
        "unclosed ",
        "unexpected key or value",
        "unexpected content",
        "unexpected `=`",
    ];
    const MISSING: [&str; 7] = [
        "array",
        "assignment",
        "comma",
        "inline table",
        "key",
        "table",
        "value",
    ];
    let missing = message.strip_prefix("missing ");
    let of_grammar = BEGINNINGS
        .iter()
        .any(|beginning| message.starts_with(beginning))
        || missing.is_some_and(|missing| MISSING.iter().any(|what| missing.starts_with(what)));
    if of_grammar {
        Kind::Grammar
    } else if message == "duplicate key" || message.starts_with("cannot extend") {
        Kind::Double
    } else {
        Kind::Content
    }
}

/// A parser's message in this project's words.
fn translate(error: &Error, text: &str) -> SyntaxError {
    let at = begin(error, text);
    let piece = named(text.get(error.span().unwrap_or(0..0)).unwrap_or(""));
    let line = text[line_around(text, at)].trim();
    let (message, expected) = error
        .message()
        .split_once(", expected ")
        .unwrap_or((error.message(), ""));
    let opens_no_header = message == "key with no value" && line.ends_with(']');
    SyntaxError {
        at,
        kind: kind_of(message),
        header: line.starts_with('[') || opens_no_header,
        mistake: words(message, expected, &piece, line),
    }
}

/// The piece of text that a parser blames, for quoting in messages; an invisible character by its number.
fn named(piece: &str) -> String {
    let invisible = |c: char| {
        !c.is_ascii()
            && (c.is_whitespace() || matches!(c, '\u{200B}'..='\u{200F}' | '\u{FEFF}' | '\u{AD}'))
    };
    match piece.trim_matches(' ').chars().next() {
        Some(c) if invisible(c) => format!("the invisible character U+{:04X}", u32::from(c)),
        _ => shown(piece.trim()),
    }
}

/// The mistake and its remedy, derived from the parser's message and expectation, the piece of text that it blames, and
/// the line around that.
fn words(message: &str, expected: &str, piece: &str, line: &str) -> Mistake {
    let foreign_comment = ["//", ";", "--", "/*"]
        .iter()
        .any(|sign| line.starts_with(sign));
    match message {
        _ if foreign_comment => Mistake::new("this is no comment", "a comment begins with #"),
        "string values must be quoted" if piece.is_empty() => {
            Mistake::new("a value is missing", "write key = value")
        }
        "string values must be quoted" => Mistake::new(
            format!("{piece} is not a value"),
            "a text stands in quotes, a comment begins with #",
        ),
        "key with no value" if line.ends_with(']') => {
            Mistake::new("a table header is not opened", "begin it with [")
        }
        "key with no value" => Mistake::new("a key has no value", "write key = value"),
        "duplicate key" if line.starts_with('[') => Mistake::new(
            format!("there is a table {piece} already"),
            if piece == "signal" || piece == "station" {
                format!("write [[{piece}]], with two brackets, for each of several")
            } else {
                "write its keys into one table".to_owned()
            },
        ),
        "duplicate key" => Mistake::new(
            format!("the key {piece} stands twice in one table"),
            "keep one of them",
        ),
        "unclosed table" => Mistake::new("a table header is not closed", "end it with ]"),
        "unclosed array table" => Mistake::new("a table header is not closed", "end it with ]]"),
        "missing comma between array elements" => {
            Mistake::new("a list lacks a comma", "write a comma between its elements")
        }
        "missing comma between key-value pairs" => Mistake::new(
            "a table in braces lacks a comma",
            "write a comma between its keys",
        ),
        "unexpected key or value" | "unexpected content" => Mistake::new(
            "the line goes on after its end",
            "write one key = value on each line",
        ),
        "invalid unquoted key" if line.contains(':') && !line.contains('=') => {
            Mistake::new("this line is no key with a value", "write key = value")
        }
        "invalid unquoted key" => Mistake::new(
            format!("{piece} cannot stand in a key"),
            "keys have letters, digits, - and _",
        ),
        "invalid key-value pair" => {
            Mistake::new("this line is no key with a value", "write key = value")
        }
        "unexpected leading zero" => {
            Mistake::new("a number begins with 0", "write it without that")
        }
        // As in the path C:\\users.
        _ if line.contains('\\')
            && (message.contains("escape") || message.contains("unicode value")) =>
        {
            Mistake::new(
                "a backslash in double quotes begins an escape such as \\n",
                "write a path in single quotes, or with slashes",
            )
        }
        _ if message.starts_with("invalid basic string")
            || message.starts_with("invalid literal") =>
        {
            Mistake::new("a text is not closed", format!("end it with {expected}"))
        }
        _ if expected.is_empty() || expected == "nothing" => Mistake::new(
            message.replace(';', ","),
            "see toml.io for how TOML is written",
        ),
        _ => Mistake::new(
            message.replace(';', ","),
            format!("TOML expects {expected} here"),
        ),
    }
}
