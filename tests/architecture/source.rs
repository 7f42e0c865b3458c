//! Just enough of Rust's grammar to find names: comments and literals are dropped, words and punctuation
//! remain.

/// A word or a mark of punctuation, with its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Token<'a> {
    pub(crate) line: usize,
    pub(crate) text: &'a str,
}

/// A path that starts at the crate's root, as far as its first name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RootPath {
    pub(crate) line: usize,
    pub(crate) name: String,
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

/// Length of a literal in `quote`s, escapes and all.
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

/// Every path in `tokens` that starts at the crate's root: by `crate::`, or by enough `super::` to get there
/// from `module` (the file's own module path).
pub(crate) fn root_paths(tokens: &[Token<'_>], module: &[&str]) -> Vec<RootPath> {
    let mut found = Vec::new();
    // The brace depth at which each enclosing inline module began.
    let (mut inline, mut depth): (Vec<usize>, usize) = (Vec::new(), 0);
    for (at, token) in tokens.iter().enumerate() {
        match token.text {
            "{" => {
                if at >= 2 && tokens[at - 2].text == "mod" {
                    inline.push(depth);
                }
                depth += 1;
            }
            "}" => {
                depth = depth.saturating_sub(1);
                if inline.last() == Some(&depth) {
                    inline.pop();
                }
            }
            "crate" => first_names(&tokens[at + 1..], &mut found),
            "super" if !follows(tokens, at, &["super", ":", ":"]) => {
                let mut supers = 1;
                let mut next = at + 1;
                while texts(&tokens[next..], &[":", ":", "super"]) {
                    (supers, next) = (supers + 1, next + 3);
                }
                if supers == module.len() + inline.len() {
                    first_names(&tokens[next..], &mut found);
                }
            }
            _ => {}
        }
    }
    found
}

/// Whether the tokens before `at` are `wanted`.
fn follows(tokens: &[Token<'_>], at: usize, wanted: &[&str]) -> bool {
    at >= wanted.len() && texts(&tokens[at - wanted.len()..], wanted)
}

/// Whether `tokens` begin with `wanted`.
pub(crate) fn texts(tokens: &[Token<'_>], wanted: &[&str]) -> bool {
    tokens.len() >= wanted.len() && tokens.iter().zip(wanted).all(|(t, w)| t.text == *w)
}

/// The names right behind `::`, one or a group in braces.
fn first_names(tokens: &[Token<'_>], found: &mut Vec<RootPath>) {
    if !texts(tokens, &[":", ":"]) {
        return;
    }
    let mut add = |token: &Token<'_>| {
        found.push(RootPath {
            line: token.line,
            name: token.text.to_owned(),
        });
    };
    match &tokens[2..] {
        [open, group @ ..] if open.text == "{" => {
            let (mut depth, mut wanted) = (1, true);
            for token in group {
                match token.text {
                    "{" => depth += 1,
                    "}" => depth -= 1,
                    "," if depth == 1 => wanted = true,
                    _ if wanted => {
                        add(token);
                        wanted = false;
                    }
                    _ => {}
                }
                if depth == 0 {
                    break;
                }
            }
        }
        [name, ..] => add(name),
        [] => {}
    }
}
