//! Just enough of Rust's grammar to find names: comments and literals are dropped, words and punctuation
//! remain.

/// A word or a mark of punctuation, with its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Token<'a> {
    pub(crate) line: usize,
    pub(crate) text: &'a str,
}

/// The tokens of `source`; a literal becomes the single mark `"`, so that nothing joins across it.
pub(crate) fn tokens(source: &str) -> Vec<Token<'_>> {
    let mut found = Vec::new();
    let (mut rest, mut line) = (source, 1);
    while let Some(first) = rest.chars().next() {
        let (length, kind) = measure(rest, first);
        let text = &rest[..length];
        match kind {
            Kind::Nothing => {}
            Kind::Literal => found.push(Token { line, text: "\"" }),
            Kind::Token => found.push(Token { line, text }),
        }
        line += text.matches('\n').count();
        rest = &rest[length..];
    }
    found
}

enum Kind {
    /// White space and comments.
    Nothing,
    Literal,
    Token,
}

/// The length and the kind of the piece at the start of `rest`.
fn measure(rest: &str, first: char) -> (usize, Kind) {
    if first.is_whitespace() {
        return (first.len_utf8(), Kind::Nothing);
    }
    if rest.starts_with("//") {
        return (rest.find('\n').unwrap_or(rest.len()), Kind::Nothing);
    }
    if rest.starts_with("/*") {
        return (block_comment(rest), Kind::Nothing);
    }
    let prefix = rest.len() - rest.trim_start_matches(['b', 'c', 'r']).len();
    if prefix <= 2 && rest[prefix..].starts_with('"') && !rest[..prefix].contains('r') {
        return (prefix + quoted(&rest[prefix..], '"'), Kind::Literal);
    }
    if prefix <= 2
        && rest[..prefix].ends_with('r')
        && let Some(length) = raw_string(&rest[prefix..])
    {
        return (prefix + length, Kind::Literal);
    }
    if let Some(quote) = rest.strip_prefix('b').unwrap_or(rest).strip_prefix('\'') {
        let before = rest.len() - quote.len() - 1;
        // 'x' and '\n' are characters; 'x without a second quote is a lifetime.
        if quote.starts_with('\\') || quote.chars().nth(1) == Some('\'') {
            return (before + quoted(&rest[before..], '\''), Kind::Literal);
        }
        if before == 0 {
            return (1 + word(quote), Kind::Token);
        }
    }
    let length = match word(rest) {
        0 => first.len_utf8(),
        length => length,
    };
    (length, Kind::Token)
}

fn word(text: &str) -> usize {
    text.find(|c: char| !c.is_alphanumeric() && c != '_')
        .unwrap_or(text.len())
}

fn block_comment(text: &str) -> usize {
    let (mut depth, mut at) = (0, 0);
    while at < text.len() {
        let rest = &text.as_bytes()[at..];
        if rest.starts_with(b"/*") {
            (depth, at) = (depth + 1, at + 2);
        } else if rest.starts_with(b"*/") {
            (depth, at) = (depth - 1, at + 2);
            if depth == 0 {
                return at;
            }
        } else {
            at += 1;
        }
    }
    text.len()
}

/// Length of a literal in `quote`s, including escapes.
fn quoted(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        if !escaped && c == quote {
            return at + 1;
        }
        escaped = !escaped && c == '\\';
    }
    text.len()
}

/// Length of `#"…"#` with any number of `#`, if `text` starts with that.
fn raw_string(text: &str) -> Option<usize> {
    let hashes = text.len() - text.trim_start_matches('#').len();
    if !text[hashes..].starts_with('"') {
        return None;
    }
    let start = hashes + 1;
    let end = format!("\"{}", "#".repeat(hashes));
    let length = text[start..].find(&end).map(|at| start + at + end.len());
    Some(length.unwrap_or(text.len()))
}

/// True if `tokens` begin with `wanted`.
pub(crate) fn texts(tokens: &[Token<'_>], wanted: &[&str]) -> bool {
    tokens.len() >= wanted.len() && tokens.iter().zip(wanted).all(|(t, w)| t.text == *w)
}
