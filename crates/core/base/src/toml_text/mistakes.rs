//! Mistakes in configuration text: collected, placed, and shown all at once.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt;

use crate::Mistake;

/// A mistake, and where it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlacedMistake {
    /// Line and column, both from 1; columns count characters. `None` if the file as a whole is wrong, for instance if
    /// it does not exist.
    pub place: Option<(usize, usize)>,
    /// The mistake.
    pub mistake: Mistake,
}

/// All mistakes of one file, in line order; at least one.
///
/// The text has one line for each: `file:line:column: what; what would be right`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistakes {
    file: String,
    list: Vec<PlacedMistake>,
}

impl Mistakes {
    /// The single mistake of a file that is wrong as a whole.
    pub fn of_file(file: &str, what: impl Into<String>, right: impl Into<String>) -> Self {
        Self::of(file, Mistake::new(what, right))
    }

    /// Like [`of_file`](Self::of_file), for an existing mistake.
    pub fn of(file: &str, mistake: Mistake) -> Self {
        let place = None;
        Self::of_list(file, vec![PlacedMistake { place, mistake }])
    }

    /// These mistakes of `file`, in the order given. The list must not be empty.
    pub fn of_list(file: &str, list: Vec<PlacedMistake>) -> Self {
        debug_assert!(!list.is_empty(), "the list is empty");
        Self {
            file: file.to_owned(),
            list,
        }
    }

    /// The name of the file.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// All mistakes, in line order.
    pub fn iter(&self) -> std::slice::Iter<'_, PlacedMistake> {
        self.list.iter()
    }

    /// The number of mistakes.
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.list.len()
    }
}

impl<'a> IntoIterator for &'a Mistakes {
    type Item = &'a PlacedMistake;
    type IntoIter = std::slice::Iter<'a, PlacedMistake>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, PlacedMistake { place, mistake }) in self.list.iter().enumerate() {
            if index > 0 {
                f.write_str("\n")?;
            }
            f.write_str(&self.file)?;
            if let Some((line, column)) = place {
                write!(f, ":{line}:{column}")?;
            }
            write!(f, ": {mistake}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Mistakes {}

/// A mistake whose line and column are not yet counted.
#[derive(Debug)]
struct Found {
    at: usize,
    mistake: Mistake,
}

/// Collects the mistakes of one text while it is being read.
#[derive(Debug)]
pub struct Collector<'t> {
    file: String,
    text: &'t str,
    line_starts: Vec<usize>,
    broken_lines: BTreeSet<usize>,
    found: RefCell<Vec<Found>>,
}

impl<'t> Collector<'t> {
    /// A collector for `text`, which came from `file`.
    pub fn new(file: &str, text: &'t str) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        let line_starts = std::iter::once(0)
            .chain(ends.map(|(at, _)| at + 1))
            .collect();
        Self {
            file: file.to_owned(),
            text,
            line_starts,
            broken_lines: BTreeSet::new(),
            found: RefCell::default(),
        }
    }

    /// The file's name.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The text.
    pub(super) fn text(&self) -> &'t str {
        self.text
    }

    /// Records a mistake at byte offset `at` of the text.
    pub fn report(&self, at: usize, what: impl Into<String>, right: impl Into<String>) {
        self.collect(at, Mistake::new(what, right));
    }

    /// Like [`report`](Self::report), for an existing mistake.
    pub fn collect(&self, at: usize, mistake: Mistake) {
        self.found.borrow_mut().push(Found { at, mistake });
    }

    /// The line, from 1, of byte offset `at`.
    pub fn line(&self, at: usize) -> usize {
        self.line_starts.partition_point(|start| *start <= at)
    }

    /// Line and column, both from 1, of byte offset `at`.
    pub fn place(&self, at: usize) -> (usize, usize) {
        let line = self.line(at);
        let before = &self.text[self.line_starts[line - 1]..at.min(self.text.len())];
        (line, before.chars().count() + 1)
    }

    /// Marks the line at byte offset `at` as left out because of a syntax error.
    pub(super) fn break_line(&mut self, at: usize) {
        self.broken_lines.insert(self.line(at));
    }

    /// True if any line was left out. A key that seems to be missing may have been in that line.
    pub fn is_broken(&self) -> bool {
        !self.broken_lines.is_empty()
    }

    /// True if no line is left out between byte offset `at` and the next table header.
    pub(super) fn is_whole_from(&self, at: usize) -> bool {
        let first = self.line(at);
        let header = |line: usize| {
            self.text[self.line_starts[line]..]
                .trim_start()
                .starts_with('[')
        };
        let broken = self.broken_lines.range(first..).next();
        broken.is_none_or(|broken| (first..*broken).any(header))
    }

    /// True if nothing was reported.
    pub fn is_empty(&self) -> bool {
        self.found.borrow().is_empty()
    }

    /// All mistakes in line order, without duplicates; `None` when there are no mistakes.
    pub fn finish(self) -> Option<Mistakes> {
        let mut found = self.found.take();
        found.sort_by_key(|found| found.at);
        let mut list = Vec::with_capacity(found.len());
        // Continue from the previous mistake: a long line with many mistakes must not be counted from its start each
        // time.
        let (mut line, mut column, mut counted) = (0, 0, 0);
        for Found { at, mistake } in found {
            let at = at.min(self.text.len());
            if self.line(at) != line {
                line = self.line(at);
                (column, counted) = (1, self.line_starts[line - 1]);
            }
            let rest = self.text[counted..].char_indices();
            column += rest.take_while(|(offset, _)| counted + offset < at).count();
            counted = counted.max(at);
            list.push(PlacedMistake {
                place: Some((line, column)),
                mistake,
            });
        }
        list.dedup();
        (!list.is_empty()).then_some(Mistakes {
            file: self.file,
            list,
        })
    }
}

/// Text from a file as messages quote it: shortened, and without control characters.
pub fn shown(text: &str) -> String {
    const LONGEST: usize = 40;
    let mut shown: String = text.chars().take(LONGEST).flat_map(escaped).collect();
    if text.chars().nth(LONGEST).is_some() {
        shown.push('…');
    }
    shown
}

/// A text with its control characters escaped, at its full length.
pub fn printable(text: &str) -> String {
    text.chars().flat_map(escaped).collect()
}

/// True if a character has no visible form: a control character, or one that reverses the direction of the text around
/// it, so that a name reads as another.
pub fn is_unprintable(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn escaped(c: char) -> impl Iterator<Item = char> {
    let escape = is_unprintable(c).then(|| c.escape_default());
    let plain = (!is_unprintable(c)).then_some(c);
    escape.into_iter().flatten().chain(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mistakes_come_in_line_order_and_once() {
        let text = "erste\r\nzwölf = 1\n";
        let collector = Collector::new("a.cfg", text);
        collector.report(text.find('=').unwrap(), "second", "b");
        collector.report(0, "first", "a");
        collector.report(text.find('=').unwrap(), "second", "b");
        collector.report(text.len(), "end", "c");
        let mistakes = collector.finish().expect("mistakes");
        assert_eq!(
            mistakes.to_string(),
            "a.cfg:1:1: first; a\na.cfg:2:7: second; b\na.cfg:3:1: end; c"
        );
        assert_eq!(Collector::new("a.cfg", text).finish(), None);
    }

    #[test]
    fn a_file_as_a_whole_has_no_line() {
        assert_eq!(
            Mistakes::of_file("a.cfg", "x", "y").to_string(),
            "a.cfg: x; y"
        );
    }

    #[test]
    fn shown_text_is_short_and_printable() {
        assert_eq!(shown("a\tb\u{1b}"), "a\\tb\\u{1b}");
        assert_eq!(shown("\u{202e}gnp.exe"), "\\u{202e}gnp.exe");
        assert_eq!(shown(&"é".repeat(41)), format!("{}…", "é".repeat(40)));
    }
}
