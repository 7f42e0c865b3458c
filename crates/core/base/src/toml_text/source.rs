//! Reading TOML text: every syntax error once, and a tree of the readable rest.

use std::borrow::Cow;
use std::fs::File;
use std::io::{Error, ErrorKind, Read as _};
use std::path::Path;

use toml::de::DeTable;

use super::syntax::{Kind, faults, line_around};
use super::{Collector, Mistakes, Table};

/// Longer texts are refused unread: no configuration is this large.
const LONGEST: usize = 16 << 20;

/// How many times a text is repaired and parsed again before the rest is given up.
const ROUNDS: usize = 40;

/// The text of the file at `path`.
///
/// # Errors
///
/// When the file cannot be read or is not UTF-8.
pub fn load_text(path: &Path) -> Result<String, Mistakes> {
    let file = path.display().to_string();
    let refused = |what: String, right: &str| Mistakes::of_file(&file, what, right);
    if path.is_dir() {
        let right = "name the configuration file in it, such as driver.cfg";
        return Err(refused("this is a directory".to_owned(), right));
    }
    let unreadable = |error: Error| match error.kind() {
        ErrorKind::NotFound => refused(
            "there is no such file".to_owned(),
            "check the path and the name",
        ),
        ErrorKind::PermissionDenied => refused(
            "this file may not be read".to_owned(),
            "check its permissions",
        ),
        _ => refused(
            format!("this file cannot be read: {error}"),
            "check the path and the disk",
        ),
    };
    // A pipe would block, and a device may be endless: both are refused before they are opened.
    if !std::fs::metadata(path).map_err(unreadable)?.is_file() {
        return Err(refused(
            "this is no regular file".to_owned(),
            "name a file on a disk; a pipe or a device cannot be a configuration",
        ));
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(LONGEST as u64 + 1).read_to_end(&mut bytes))
        .map_err(unreadable)?;
    if bytes.len() > LONGEST {
        return Err(refused(
            format!("this file is longer than {} MiB", LONGEST >> 20),
            "name a configuration; none is this long",
        ));
    }
    String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        let bytes = error.into_bytes();
        // The text before the bad byte is enough to locate it.
        let before = String::from_utf8_lossy(&bytes[..at]);
        let collector = Collector::new(&file, &before);
        collector.report(
            at,
            format!("the byte 0x{:02X} is no UTF-8 text", bytes[at]),
            "save the file as UTF-8",
        );
        collector.finish().expect("one mistake was reported")
    })
}

/// Reads the whole `text` of `file`: what `read` makes of its root table.
///
/// # Errors
///
/// Every mistake in the text.
///
/// # Panics
///
/// When `read` returns `None` without having reported a mistake.
pub fn parse_text<T>(
    file: &str,
    text: &str,
    read: impl FnOnce(Table<'_>) -> Option<T>,
) -> Result<T, Mistakes> {
    let mut collector = Collector::new(file, text);
    let read = read_text(&mut collector, text, read);
    match collector.finish() {
        Some(mistakes) => Err(mistakes),
        None => Ok(read.expect("what is not read has a mistake")),
    }
}

/// Reads `text` and hands its root table to `read`.
///
/// Syntax errors are reported to `collector`, one per line, and their lines are left out: `read` sees the
/// rest. If a table header is broken, the keys below it cannot be assigned to a table; then `read` is not
/// called and the answer is `None`.
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

/// The text with its broken lines blanked, each of them reported; every byte keeps its offset.
fn repaired<'t>(collector: &mut Collector<'t>, text: &'t str) -> Option<Cow<'t, str>> {
    let mut text = Cow::Borrowed(text);
    // Removing the line that opens an unterminated value exposes the lines below it, and their syntax errors
    // are real. After any other line is removed, only errors that the parser finds in the whole tree, such as
    // a duplicate key, are real; a new grammar error would be a consequence of the repair.
    let mut trusted = true;
    for _ in 0..ROUNDS {
        let faults = faults(&text);
        if faults.is_empty() {
            return Some(text);
        }
        let mut after = text.clone().into_owned();
        let mut readable = true;
        for fault in &faults {
            let line = line_around(&text, fault.at);
            let real = trusted || fault.kind != Kind::Grammar;
            readable &= real && !fault.header && !text[line.clone()].trim().is_empty();
            if real {
                collector.collect(fault.at, fault.mistake.clone());
            }
            collector.break_line(fault.at);
            after.replace_range(line.clone(), &" ".repeat(line.len()));
        }
        if !readable {
            return None;
        }
        trusted = faults.iter().any(|fault| fault.kind == Kind::Endless);
        text = Cow::Owned(after);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a text; returns its mistakes and the remaining top-level keys.
    fn read(text: &str) -> (Vec<String>, Option<Vec<String>>) {
        let mut collector = Collector::new("f", text);
        let keys = read_text(&mut collector, text, |root| {
            Some(
                root.all()
                    .map(|(key, _)| key.to_owned())
                    .collect::<Vec<_>>(),
            )
        });
        let mistakes = collector.finish().map(|mistakes| mistakes.to_string());
        (
            mistakes
                .iter()
                .flat_map(|text| text.lines())
                .map(str::to_owned)
                .collect(),
            keys,
        )
    }

    #[test]
    fn files_without_an_end_and_long_ones_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let long = folder.path().join("long.cfg");
        File::create(&long)
            .and_then(|file| file.set_len(LONGEST as u64 + 1))
            .expect("a long file");
        let told = load_text(&long).expect_err("too long").to_string();
        assert!(told.contains("longer than 16 MiB"), "{told}");
        #[cfg(unix)]
        {
            let told = load_text(Path::new("/dev/zero")).expect_err("a device");
            assert!(told.to_string().contains("no regular file"), "{told}");
        }
    }

    #[test]
    fn broken_lines_are_told_and_the_others_read() {
        let (mistakes, keys) = read("a = 1\nb 2\nc = x\nd = 4\nd = 5\n");
        assert_eq!(
            mistakes,
            [
                "f:2:3: a key has no value; write key = value",
                "f:3:5: x is not a value; a text stands in quotes, a comment begins with #",
                "f:5:1: the key d stands twice in one table; keep one of them",
            ]
        );
        assert_eq!(keys.unwrap(), ["a", "d"]);
    }

    #[test]
    fn what_is_never_closed_is_told_where_it_begins() {
        for (open, what) in [
            ("[1, 2", "this list is never closed; end it with ]"),
            ("[[1, 2]", "this list is never closed; end it with ]"),
            ("{ x = 1", "this table is never closed; end it with }"),
            ("{ x = [1, 2]", "this table is never closed; end it with }"),
            (
                "\"\"\"x",
                "this text is never closed; end it with the three quotes that begin it",
            ),
        ] {
            let (mistakes, keys) = read(&format!("a = 1\nb = {open}\n\n[[c]]\nd = 2\n[e]\n"));
            assert_eq!(mistakes, [format!("f:2:5: {what}")], "{open}");
            assert_eq!(keys.unwrap(), ["a", "c", "e"], "{open}");
        }
    }

    #[test]
    fn a_broken_header_ends_the_reading_but_not_the_telling() {
        let (mistakes, keys) = read("[a\nx = 1\n[b]\nx = \n");
        assert_eq!(
            mistakes,
            [
                "f:1:3: a table header is not closed; end it with ]",
                "f:4:5: a value is missing; write key = value",
            ]
        );
        assert_eq!(keys, None);
    }

    #[test]
    fn deep_nesting_is_refused() {
        let (mistakes, _) = read(&format!("a = {}\n", "[".repeat(100_000)));
        assert_eq!(mistakes.len(), 1, "{mistakes:?}");
        assert!(mistakes[0].contains("too deep"), "{mistakes:?}");
    }
}
