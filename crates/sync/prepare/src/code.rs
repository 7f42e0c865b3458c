//! The significant tokens of a source, and their text.

use super::lexer::{Comments, Kind, Token, reading, tokens};
use std::ops::Range;

/// A source, its tokens, and the significant ones: those that are neither blanks, comments nor pragmas. Ranges and
/// indices in the other modules count significant tokens.
#[derive(Debug)]
pub(crate) struct Code<'t> {
    pub(crate) text: &'t str,
    /// The offset of the text in its file.
    pub(crate) base: usize,
    pub(crate) all: Vec<Token>,
    pub(crate) tokens: Vec<Token>,
    /// The reading of comments within comments.
    pub(crate) comments: Comments,
    /// True if there are comments within comments, and both readings or none of them can be right.
    pub(crate) is_in_doubt: bool,
}

impl<'t> Code<'t> {
    pub(crate) fn new(text: &'t str) -> Self {
        Self::part(text, 0)
    }

    /// A part of a file, at this byte.
    pub(crate) fn part(text: &'t str, base: usize) -> Self {
        Self::with(text, base, None)
    }

    /// A part of a file, whose comments the compiler reads in this way.
    pub(crate) fn with(text: &'t str, base: usize, comments: Option<Comments>) -> Self {
        let (comments, is_in_doubt) =
            comments.map_or_else(|| reading(text), |comments| (comments, false));
        let all = tokens(text, comments);
        let has_meaning = |token: &&Token| !token.kind.is_trivia() && token.kind != Kind::Pragma;
        let tokens = all.iter().filter(has_meaning).copied().collect();
        Self {
            text,
            base,
            all,
            tokens,
            comments,
            is_in_doubt,
        }
    }

    /// The text of the token; empty after the last one.
    pub(crate) fn word(&self, at: usize) -> &'t str {
        let token = self.tokens.get(at);
        token.map_or("", |token| &self.text[token.range()])
    }

    /// Like [`word`](Self::word), in capitals: names and keywords ignore case.
    pub(crate) fn capitals(&self, at: usize) -> String {
        self.word(at).to_uppercase()
    }

    pub(crate) fn is(&self, at: usize, word: &str) -> bool {
        self.word(at).eq_ignore_ascii_case(word)
    }

    pub(crate) fn is_any(&self, at: usize, words: &[&str]) -> bool {
        words.iter().any(|word| self.is(at, word))
    }

    pub(crate) fn is_word(&self, at: usize) -> bool {
        self.kind(at) == Some(Kind::Word)
    }

    pub(crate) fn kind(&self, at: usize) -> Option<Kind> {
        self.tokens.get(at).map(|token| token.kind)
    }

    /// The byte offset of a token in the file; after the last one, the end of the part.
    pub(crate) fn start(&self, at: usize) -> usize {
        let token = self.tokens.get(at);
        self.base + token.map_or(self.text.len(), |token| token.start)
    }

    pub(crate) fn end(&self, at: usize) -> usize {
        let token = self.tokens.get(at);
        self.base + token.map_or(self.text.len(), |token| token.end)
    }

    /// The bytes in the file from the first to the last of these tokens, with the pragmas before and after them; `None`
    /// if there is neither a token nor a pragma.
    pub(crate) fn bytes(&self, range: &Range<usize>) -> Option<Range<usize>> {
        let before = range.start.checked_sub(1);
        let start = before.map_or(self.base, |last| self.end(last)) - self.base;
        let end = self.start(range.end) - self.base;
        let first = self.all.partition_point(|token| token.start < start);
        let behind = self
            .all
            .partition_point(|token| token.end <= end.max(start));
        let inner = self.all.get(first..behind)?;
        let mut inner = inner.iter().filter(|token| !token.kind.is_trivia());
        let first = inner.next()?;
        let last = inner.next_back().unwrap_or(first);
        Some(self.base + first.start..self.base + last.end)
    }

    /// The index of the token that closes the bracket at `at`, or that of `end`.
    pub(crate) fn closing(&self, at: usize, end: usize) -> usize {
        let mut depth = 0_usize;
        for at in at..end {
            match self.word(at) {
                "(" | "[" => depth += 1,
                ")" | "]" => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth == 0 {
                return at;
            }
        }
        end
    }

    /// The index of the token that opens the bracket closed at `at`; 0 if not found.
    pub(crate) fn opening(&self, at: usize) -> usize {
        let mut depth = 0_usize;
        let found = (0..=at).rev().find(|at| {
            match self.word(*at) {
                ")" | "]" => depth += 1,
                "(" | "[" => depth = depth.saturating_sub(1),
                _ => {}
            }
            depth == 0
        });
        found.unwrap_or(0)
    }

    /// The line end of this source.
    pub(crate) fn line_end(&self) -> &'static str {
        line_end(self.text)
    }
}

/// The line end that a text uses.
pub(crate) fn line_end(text: &str) -> &'static str {
    let first = text.find('\n').unwrap_or(0);
    if text[..first].ends_with('\r') {
        "\r\n"
    } else {
        "\n"
    }
}
