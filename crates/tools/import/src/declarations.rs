//! Variables declared in Structured Text, with an address: `Start AT %IX0.0 : BOOL;`.

use super::cells::{Cell, Record};

/// The most elements of an array.
const ELEMENTS: i64 = 10_000;

/// True if `text` has declarations: a line that ends a block of variables.
pub(super) fn has_any(text: &str) -> bool {
    text.lines().any(|line| {
        let line = line.trim().trim_end_matches(';');
        line.eq_ignore_ascii_case("END_VAR")
    })
}

/// True if `text` is a whole project in the standard's notation, as OpenPLC and Beremiz compile it.
pub(super) fn has_configuration(text: &str) -> bool {
    let mut words = text.split_whitespace();
    words.any(|word| word.eq_ignore_ascii_case("END_CONFIGURATION"))
}

/// The variables with an address in `text[from..to]`: name, address, type, comment.
pub(super) fn read(text: &str, from: usize, to: usize) -> Vec<Record> {
    let (code, comments) = without_comments(&text[from..to]);
    let mut records = Vec::new();
    let mut next = 0;
    while let Some(percent) = code[next..].find('%').map(|at| next + at) {
        next = percent + 1;
        let Some((name, name_at)) = name_before(&code[..percent]) else {
            continue;
        };
        let length = code[percent + 1..]
            .find(|c: char| !(c.is_ascii_alphanumeric() || c == '.' || c == '*'))
            .unwrap_or(code.len() - percent - 1);
        let address = &code[percent..percent + 1 + length];
        let rest = &code[percent + 1 + length..];
        let Some(kind) = rest.trim_start().strip_prefix(':') else {
            continue;
        };
        let kind_start = code.len() - kind.len();
        let end = kind.find(';').unwrap_or(kind.len());
        let kind = kind[..end].split(":=").next().unwrap_or_default();
        let kind_at = kind_start + kind.len() - kind.trim_start().len();
        next = kind_start + end;
        let line_end = code[next..].find('\n').map_or(code.len(), |end| next + end);
        let comment = comments
            .iter()
            .find(|(start, _)| (name_at..line_end).contains(start))
            .map_or("", |(_, words)| words.as_str());
        let cell = |text: &str, at: usize| Cell {
            text: text.to_owned(),
            at: from + at,
        };
        let kind = kind.split_whitespace().collect::<Vec<_>>().join(" ");
        // The elements of an array at a fixed place do not always have the address's size.
        let elements = if address.ends_with('*') {
            elements(&kind)
        } else {
            None
        };
        let (indices, of) = elements.unwrap_or_else(|| (vec![String::new()], kind.clone()));
        for index in indices {
            records.push(vec![
                cell(&format!("{name}{index}"), name_at),
                cell(address, percent),
                cell(&of, kind_at),
                cell(comment, name_at),
            ]);
        }
    }
    records
}

/// The indices of an array's elements, and their type.
fn elements(kind: &str) -> Option<(Vec<String>, String)> {
    let upper = kind.to_ascii_uppercase();
    let rest = upper
        .strip_prefix("ARRAY")?
        .trim_start()
        .strip_prefix('[')?;
    let (range, rest) = rest.split_once(']')?;
    let of = rest.trim_start().strip_prefix("OF ")?.trim();
    let (first, last) = range.split_once("..")?;
    let (first, last): (i64, i64) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
    let is_short = last
        .checked_sub(first)
        .is_some_and(|length| (0..ELEMENTS).contains(&length));
    is_short.then(|| {
        let indices = (first..=last).map(|index| format!("[{index}]"));
        (indices.collect(), of.to_owned())
    })
}

/// The name in front of `AT`, and its offset.
fn name_before(code: &str) -> Option<(&str, usize)> {
    let code = code.trim_end();
    let before = code.get(..code.len().checked_sub(2)?)?;
    let is_at = code[before.len()..].eq_ignore_ascii_case("AT");
    let name = before.trim_end();
    if !is_at || name.len() == before.len() {
        return None;
    }
    let start = name
        .rfind(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.'))
        .map_or(0, |at| {
            at + name[at..].chars().next().map_or(1, char::len_utf8)
        });
    (start < name.len()).then_some((&name[start..], start))
}

/// `text` with blanks instead of comments, strings and pragmas, and the comments with their offsets.
fn without_comments(text: &str) -> (String, Vec<(usize, String)>) {
    let mut code = String::with_capacity(text.len());
    let mut comments = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let rest = &text[at..];
        let end_of = |close: &str, open: usize| {
            rest[open..]
                .find(close)
                .map_or(rest.len(), |end| open + end + close.len())
        };
        let length = match rest.as_bytes() {
            [b'(', b'*', ..] => end_of("*)", 2),
            [b'/', b'*', ..] => end_of("*/", 2),
            [b'/', b'/', ..] => rest.find('\n').unwrap_or(rest.len()),
            [b'{', ..] => end_of("}", 1),
            [quote @ (b'\'' | b'"'), ..] => end_of(if *quote == b'"' { "\"" } else { "'" }, 1),
            _ => 0,
        };
        if length == 0 {
            let c = rest.chars().next().unwrap_or(' ');
            code.push(c);
            at += c.len_utf8();
            continue;
        }
        let skipped = &rest[..length];
        if skipped.starts_with(['(', '/']) {
            let words = skipped
                .trim_matches(|c: char| matches!(c, '(' | ')' | '*' | '/') || c.is_whitespace());
            comments.push((at, words.split_whitespace().collect::<Vec<_>>().join(" ")));
        }
        code.extend(
            skipped
                .bytes()
                .map(|byte| if byte == b'\n' { '\n' } else { ' ' }),
        );
        at += length;
    }
    (code, comments)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn declared(text: &str) -> Vec<String> {
        let records = read(text, 0, text.len()).into_iter();
        let texts = records.map(|record| {
            let cells: Vec<String> = record.into_iter().map(|cell| cell.text).collect();
            cells.join("|")
        });
        texts.collect()
    }

    #[test]
    fn variables_with_an_address_are_found_among_others() {
        let text = "PROGRAM Main\nVAR\n\t(* a AT %I0.0 : BOOL; *)\n\tstep : INT;\n\tstart AT%I* : BOOL; // the\u{e9} button\n\
                    \tlevel AT %IW2: INT := 5; {attribute 'x AT %I*'}\n\tmotor\n\t AT %QX0.1 : BOOL;\nEND_VAR\nx := '%';\n";
        assert_eq!(
            declared(text),
            [
                "start|%I*|BOOL|the\u{e9} button",
                "level|%IW2|INT|",
                "motor|%QX0.1|BOOL|"
            ]
        );
        assert!(has_any(text) && !has_configuration(text));
    }

    #[test]
    fn arrays_without_a_place_are_their_elements() {
        assert_eq!(
            declared("lamp AT %Q* : ARRAY[0..1] OF BOOL;"),
            ["lamp[0]|%Q*|BOOL|", "lamp[1]|%Q*|BOOL|"]
        );
        assert_eq!(
            declared("lamp AT %Q* : ARRAY[0..99999999] OF BOOL;").len(),
            1,
            "too many"
        );
    }

    #[test]
    fn broken_text_ends() {
        for text in [
            "(*",
            "'",
            "AT %",
            "x AT %I",
            "% : ;",
            "é AT %I* :",
            "//",
            "x AT %I* : ARRAY[1..",
            "{",
        ] {
            assert!(declared(text).len() < 2, "{text}");
        }
    }
}
