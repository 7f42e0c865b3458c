//! Structured Text as tokens that keep every byte: concatenated, their texts are the source.

use std::ops::Range;

/// The kind of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Blanks and line ends.
    Space,
    /// `(* *)`, `/* */`, or `//` to the end of the line.
    Comment,
    /// `{ }`: a message to one compiler.
    Pragma,
    /// A keyword or a name.
    Word,
    /// `%IX0.0`.
    Address,
    /// A number, or a literal with a type, such as `T#5s`.
    Literal,
    /// `'text'` or `"text"`.
    Text,
    /// `:=`, `=>`, `..`, or a single character.
    Symbol,
    /// A comment, pragma or text without an end.
    Endless,
}

impl Kind {
    /// True if the program would be the same without the token.
    pub(crate) fn is_trivia(self) -> bool {
        matches!(self, Self::Space | Self::Comment)
    }
}

/// A piece of the source, with byte offsets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Token {
    pub(crate) kind: Kind,
    pub(crate) start: usize,
    pub(crate) end: usize,
}

impl Token {
    pub(crate) fn range(self) -> Range<usize> {
        self.start..self.end
    }
}

const BYTE_ORDER_MARK: &[u8] = "\u{FEFF}".as_bytes();

/// The end of a comment that has the begin of another one in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comments {
    /// At the first `*)`, as in `iec2c` without options.
    Flat,
    /// At the `*)` of its own, as in `iec2c -n`.
    Nested,
}

/// The reading of a source's comments under which it can be a program, and true if that is in doubt: a `(*` without its
/// own `*)` makes a source endless in one reading, and one with it leaves a stray `*)` in the other.
pub(crate) fn reading(source: &str) -> (Comments, bool) {
    let flat = tokens(source, Comments::Flat);
    let holds_another = |token: &Token| {
        let text = &source[token.range()];
        token.kind == Kind::Comment && text.starts_with("(*") && text[2..].contains("(*")
    };
    if !flat.iter().any(holds_another) {
        return (Comments::Flat, false);
    }
    let nested = tokens(source, Comments::Nested);
    match [&flat, &nested].map(|tokens| is_sound(source, tokens)) {
        [true, false] => (Comments::Flat, false),
        [false, true] => (Comments::Nested, false),
        _ => (Comments::Flat, true),
    }
}

/// True if every comment has its end, and there is no end without a comment.
fn is_sound(source: &str, tokens: &[Token]) -> bool {
    let is_end = |pair: &[Token]| {
        let text = &source[pair[0].start..pair[1].end];
        pair.iter().all(|token| token.kind == Kind::Symbol) && text == "*)"
    };
    tokens.iter().all(|token| token.kind != Kind::Endless) && !tokens.windows(2).any(is_end)
}

/// The tokens of a whole source.
pub(crate) fn tokens(source: &str, comments: Comments) -> Vec<Token> {
    let bytes = source.as_bytes();
    let mut found = Vec::new();
    let mut start = 0;
    while start < bytes.len() {
        let (kind, length) = first(&bytes[start..], comments);
        let end = start + length;
        found.push(Token { kind, start, end });
        start = end;
    }
    found
}

/// The first token of a text that is not empty, and its length.
fn first(text: &[u8], comments: Comments) -> (Kind, usize) {
    let second = text.get(1).copied().unwrap_or_default();
    match text[0] {
        _ if text.starts_with(BYTE_ORDER_MARK) => (Kind::Space, BYTE_ORDER_MARK.len()),
        byte if is_space(byte) => (Kind::Space, run(text, is_space)),
        b'(' if second == b'*' && comments == Comments::Nested => nested(text),
        b'(' if second == b'*' => until(text, 2, b"*)", Kind::Comment),
        b'/' if second == b'*' => until(text, 2, b"*/", Kind::Comment),
        b'/' if second == b'/' => (
            Kind::Comment,
            run(text, |byte| byte != b'\n' && byte != b'\r'),
        ),
        b'{' => until(text, 1, b"}", Kind::Pragma),
        quote @ (b'\'' | b'"') => quoted(text, quote),
        b'%' if second.is_ascii_alphabetic() => {
            let rest = run(&text[1..], |byte| {
                is_name(byte) || byte == b'.' || byte == b'*'
            });
            (Kind::Address, 1 + rest)
        }
        byte if byte.is_ascii_digit() => (Kind::Literal, number(text)),
        byte if is_name(byte) => {
            let length = run(text, is_name);
            if text.get(length) == Some(&b'#') {
                typed(text, length)
            } else {
                (Kind::Word, length)
            }
        }
        b':' | b'=' | b'.' if matches!(&text[..text.len().min(2)], b":=" | b"=>" | b"..") => {
            (Kind::Symbol, 2)
        }
        _ => (Kind::Symbol, 1),
    }
}

fn is_space(byte: u8) -> bool {
    byte.is_ascii_whitespace() || byte == 0x0B
}

/// Letters beyond ASCII count as parts of names, since some editors allow them.
fn is_name(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte >= 0x80
}

fn run(text: &[u8], is_in: impl Fn(u8) -> bool) -> usize {
    let end = text.iter().position(|byte| !is_in(*byte));
    end.unwrap_or(text.len())
}

fn until(text: &[u8], begin: usize, end: &[u8], kind: Kind) -> (Kind, usize) {
    let rest = &text[begin..];
    match rest.windows(end.len()).position(|window| window == end) {
        Some(at) => (kind, begin + at + end.len()),
        None => (Kind::Endless, text.len()),
    }
}

/// A comment with the comments in it.
fn nested(text: &[u8]) -> (Kind, usize) {
    let (mut at, mut depth) = (0, 0_usize);
    while at + 1 < text.len() {
        match &text[at..at + 2] {
            b"(*" => depth += 1,
            b"*)" => depth -= 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
        if depth == 0 {
            return (Kind::Comment, at);
        }
    }
    (Kind::Endless, text.len())
}

/// A text in quotes, in which `$` escapes the next character.
fn quoted(text: &[u8], quote: u8) -> (Kind, usize) {
    let mut at = 1;
    while at < text.len() {
        match text[at] {
            // The character after a $ may have several bytes: its first one is enough, as none of them is a quote.
            b'$' => at += 2,
            b'\n' | b'\r' => return (Kind::Endless, at),
            byte if byte == quote => return (Kind::Text, at + 1),
            _ => at += 1,
        }
    }
    (Kind::Endless, text.len())
}

/// `12`, `1_000`, `1.5`, `16#FF`; not the dots of `1..5`.
fn number(text: &[u8]) -> usize {
    let mut at = run(text, |byte| is_name(byte) || byte == b'#');
    if text.get(at) == Some(&b'.') && text.get(at + 1).is_some_and(u8::is_ascii_digit) {
        at += 1;
        at += run(&text[at..], is_name);
    }
    at
}

/// A literal whose type has `length` bytes, followed by `#`.
fn typed(text: &[u8], length: usize) -> (Kind, usize) {
    let is_date = ["D", "DATE", "DT", "TOD", "LD", "LDT", "LTOD"]
        .iter()
        .chain(&["DATE_AND_TIME", "TIME_OF_DAY", "LDATE", "LDATE_AND_TIME"])
        .any(|name| text[..length].eq_ignore_ascii_case(name.as_bytes()));
    let mut at = length + 1;
    if matches!(text.get(at), Some(b'-' | b'+')) {
        at += 1;
    }
    at += run(&text[at..], |byte| {
        is_name(byte) || byte == b'#' || (is_date && matches!(byte, b'-' | b':'))
    });
    // A fraction, as in T#1.5s and REAL#1.5; but no second dot.
    if text.get(at) == Some(&b'.') && text.get(at + 1).is_some_and(u8::is_ascii_digit) {
        at += 1;
        at += run(&text[at..], is_name);
    }
    (Kind::Literal, at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(source: &str) -> Vec<(Kind, &str)> {
        tokens(source, Comments::Flat)
            .into_iter()
            .filter(|token| token.kind != Kind::Space)
            .map(|token| (token.kind, &source[token.range()]))
            .collect()
    }

    #[test]
    fn each_kind_is_read_to_its_end() {
        use Kind::{Address, Comment, Literal, Pragma, Symbol, Text, Word};
        assert_eq!(
            read("x_1 := T#1.5s;(* a ' *)'it$'s (*'{p}%IX0.1// to the end\r\nI..5"),
            [
                (Word, "x_1"),
                (Symbol, ":="),
                (Literal, "T#1.5s"),
                (Symbol, ";"),
                (Comment, "(* a ' *)"),
                (Text, "'it$'s (*'"),
                (Pragma, "{p}"),
                (Address, "%IX0.1"),
                (Comment, "// to the end"),
                (Word, "I"),
                (Symbol, ".."),
                (Literal, "5"),
            ]
        );
        assert_eq!(
            read("1..5 16#FF DT#1970-01-01-00:00:00.5 T#-1d_2h INT#-5 Größe /* */ 1.5E3"),
            [
                (Literal, "1"),
                (Symbol, ".."),
                (Literal, "5"),
                (Literal, "16#FF"),
                (Literal, "DT#1970-01-01-00:00:00.5"),
                (Literal, "T#-1d_2h"),
                (Literal, "INT#-5"),
                (Word, "Größe"),
                (Comment, "/* */"),
                (Literal, "1.5E3"),
            ]
        );
    }

    #[test]
    fn what_has_no_end_is_seen() {
        for source in ["(* ", "'a\n'", "\"", "{", "/* *", "(*)", "'$"] {
            assert_eq!(
                tokens(source, Comments::Flat)[0].kind,
                Kind::Endless,
                "{source}"
            );
        }
    }

    #[test]
    fn comments_within_comments_are_read_so_that_the_source_is_sound() {
        use Comments::{Flat, Nested};
        for (source, right) in [
            ("(* a *) x (* b *)", (Flat, false)),
            ("(* a (* b *) x := 1;", (Flat, false)),
            ("(* a (* b *) c *) x := 1;", (Nested, false)),
            ("(* a (* b *) x := 1; // *)", (Flat, true)),
            ("(* a (* b *) c", (Flat, false)),
            ("(* a // (* b *) '(*' {p *) }", (Flat, false)),
            ("s := '(* a (* b'; x := 2 *(3);", (Flat, false)),
            ("(* (* *) *) *)", (Flat, true)),
        ] {
            assert_eq!(reading(source), right, "{source}");
        }
    }

    proptest! {
        #[test]
        fn the_tokens_are_the_source(source in "(\\PC|[(*)'\"$#%{}/\r\n.:=TD19ä]){0,60}") {
            for comments in [Comments::Flat, Comments::Nested] {
                let mut end = 0;
                for token in tokens(&source, comments) {
                    prop_assert!(token.start == end && token.end > end);
                    prop_assert!(source.is_char_boundary(token.end.min(source.len())));
                    end = token.end;
                }
                prop_assert_eq!(end, source.len());
            }
        }
    }
}
