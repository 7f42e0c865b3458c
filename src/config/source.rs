//! Reading TOML text: every syntax error once, and a tree of what can still be read.

use std::borrow::Cow;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{Collector, Table, shown};

/// Texts longer than this are no configuration.
const LONGEST: usize = 16 << 20;

/// How often a text is repaired before the rest of it is left unread.
const ROUNDS: usize = 40;

/// Reads `text` and hands its root table to `read`.
///
/// Syntax errors are reported to `collector`, one for each line, and the lines that have them are
/// left out: `read` sees what remains. It is not called, and the answer is `None`, when a broken
/// table header leaves unsure to which table the lines below it belong.
pub fn read_text<'t, T>(
    collector: &mut Collector<'t>,
    text: &'t str,
    read: impl FnOnce(Table<'_>) -> Option<T>,
) -> Option<T> {
    if text.len() > LONGEST {
        collector.report(
            0,
            format!("the text is {} MiB long", text.len() >> 20),
            format!("a configuration has at most {} MiB", LONGEST >> 20),
        );
        return None;
    }
    let text = repaired(collector, text)?;
    let (root, _) = DeTable::parse_recoverable(&text);
    read(Table::root(collector, root.get_ref()))
}

/// The text without its broken lines, each of them reported; every byte keeps its offset.
fn repaired<'t>(collector: &mut Collector<'t>, text: &'t str) -> Option<Cow<'t, str>> {
    let mut text = Cow::Borrowed(text);
    // Taking out the line that opens an endless value brings the lines below it to light, and with
    // them errors that are real. Taking out any other line brings to light what only the tree knows,
    // such as doubled keys; a new error of syntax is then a consequence of the repair.
    let mut trusted = true;
    for _ in 0..ROUNDS {
        let faults = faults(&text);
        if faults.is_empty() {
            return Some(text);
        }
        let mut after = text.clone().into_owned();
        let endless = faults.iter().any(|fault| fault.kind == Kind::Endless);
        let mut readable = true;
        for fault in &faults {
            let trusted = trusted || fault.kind != Kind::Syntax;
            if trusted {
                collector.report(fault.at, fault.what.clone(), fault.right.clone());
            }
            let line = line_around(&text, fault.at);
            let content = text[line.clone()].trim();
            readable &= trusted && !content.is_empty() && !content.starts_with('[');
            collector.break_line(fault.at);
            after.replace_range(line.clone(), &" ".repeat(line.len()));
        }
        if !readable {
            return None;
        }
        trusted = endless;
        text = Cow::Owned(after);
    }
    None
}

/// The line around byte offset `at`, without its line end.
fn line_around(text: &str, at: usize) -> std::ops::Range<usize> {
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

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// The grammar is broken.
    Syntax,
    /// A list, table or text never ends, and swallows what follows.
    Endless,
    /// Every line reads well, but not together.
    Structure,
}

#[derive(Debug)]
struct Fault {
    at: usize,
    kind: Kind,
    what: String,
    right: String,
}

/// The syntax errors of a text in order, the first of each line.
fn faults(text: &str) -> Vec<Fault> {
    let (root, errors) = DeTable::parse_recoverable(text);
    let mut faults: Vec<Fault> = errors.iter().map(|error| translate(error, text)).collect();
    faults.sort_by_key(|fault| fault.at);
    if let Some(endless) = errors
        .iter()
        .find_map(|error| endless(error, text, root.get_ref()))
    {
        faults.retain(|fault| fault.at < endless.at);
        faults.push(endless);
    }
    faults.dedup_by_key(|fault| line_around(text, fault.at).start);
    faults
}

/// The value that never ends, if that is what the error is about.
fn endless(error: &toml::de::Error, text: &str, root: &DeTable<'_>) -> Option<Fault> {
    let message = error.message();
    let (what, right) = if message.starts_with("unclosed array,") {
        ("this list is never closed", "end it with ]")
    } else if message.starts_with("unclosed inline table,") {
        ("this table is never closed", "end it with }")
    } else if message.starts_with("invalid multi-line") {
        (
            "this text is never closed",
            "end it with the same three quotes that begin it",
        )
    } else {
        return None;
    };
    let end = error.span()?.start;
    let at = around(root, end)?;
    // Of several that are open the outermost is shown, and that may be of the other kind.
    let (what, right) = match text.get(at..=at)? {
        "[" => ("this list is never closed", "end it with ]"),
        "{" => ("this table is never closed", "end it with }"),
        _ => (what, right),
    };
    Some(Fault {
        at,
        kind: Kind::Endless,
        what: what.to_owned(),
        right: right.to_owned(),
    })
}

/// Where the outermost value that reaches to `end` begins.
fn around(table: &DeTable<'_>, end: usize) -> Option<usize> {
    table.iter().find_map(|(_, value)| around_value(value, end))
}

fn around_value(value: &Spanned<DeValue<'_>>, end: usize) -> Option<usize> {
    let span = value.span();
    let covers = span.start < end && end <= span.end;
    match value.get_ref() {
        DeValue::Table(_) | DeValue::Array(_) | DeValue::String(_) if covers => Some(span.start),
        // The span of a table with a header, and of a list of those, is that of the header alone.
        DeValue::Table(table) => around(table, end),
        DeValue::Array(list) => list.iter().find_map(|element| around_value(element, end)),
        _ => None,
    }
}

/// A parser's message in this project's words: what is wrong, what would be right.
fn translate(error: &toml::de::Error, text: &str) -> Fault {
    let span = error.span().unwrap_or(0..0);
    let at = span.start.min(text.len());
    let piece = shown(text.get(span).unwrap_or("").trim());
    let line = text[line_around(text, at)].trim();
    let (message, expected) = error
        .message()
        .split_once(", expected ")
        .unwrap_or((error.message(), ""));
    let kind = match message {
        "duplicate key" => Kind::Structure,
        _ if message.starts_with("cannot extend") => Kind::Structure,
        _ => Kind::Syntax,
    };
    let (what, right) = match message {
        "string values must be quoted" if piece.is_empty() => (
            "a value is missing".to_owned(),
            "write key = value".to_owned(),
        ),
        "string values must be quoted" => (
            format!("{piece} is not a value"),
            "a text stands in quotes, a comment begins with #".to_owned(),
        ),
        "key with no value" if line.ends_with(']') => (
            "a table header is not opened".to_owned(),
            "begin it with [".to_owned(),
        ),
        "key with no value" => (
            "a key has no value".to_owned(),
            "write key = value".to_owned(),
        ),
        "duplicate key" if line.starts_with('[') => (
            format!("the table {piece} is there already"),
            if piece == "signal" || piece == "station" {
                format!("write [[{piece}]], with two brackets, for each of several")
            } else {
                "write its keys into one table".to_owned()
            },
        ),
        "duplicate key" => (
            format!("the key {piece} stands twice in one table"),
            "keep one of them".to_owned(),
        ),
        "unclosed table" | "unclosed array table" => (
            "a table header is not closed".to_owned(),
            format!("end it with {}", closing(line)),
        ),
        _ if message.starts_with("invalid basic string")
            || message.starts_with("invalid literal") =>
        {
            (
                "a text is not closed".to_owned(),
                format!("end it with {expected}"),
            )
        }
        _ if expected.is_empty() || expected == "nothing" => (
            message.to_owned(),
            "remove it, or see the rules of TOML at toml.io".to_owned(),
        ),
        _ => (message.to_owned(), format!("TOML expects {expected} here")),
    };
    Fault {
        at,
        kind,
        what,
        right,
    }
}

fn closing(line: &str) -> &'static str {
    if line.starts_with("[[") { "]]" } else { "]" }
}
