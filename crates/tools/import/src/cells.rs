//! Records and cells of a table, and their positions.

use tickbus_base::toml_text::Collector;

/// One cell: its text without quotation marks and surrounding blanks, and its offset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Cell {
    pub(super) text: String,
    pub(super) at: usize,
}

/// The cells of one line, or of several if a quoted cell contains line ends.
pub(super) type Record = Vec<Cell>;

/// The possible separators of cells.
const SEPARATORS: [char; 3] = [';', '\t', ','];

/// All records that are not empty; lines that start with `#` are comments.
pub(super) fn records(text: &str, wrong: &Collector<'_>) -> Vec<Record> {
    let mut at = 0;
    let mut separator = None;
    // Excel's statement of the separator.
    if let Some(stated) = text.strip_prefix("sep=") {
        separator = stated.chars().next().filter(|c| SEPARATORS.contains(c));
        at = text.find('\n').map_or(text.len(), |end| end + 1);
    }
    let separator = separator.unwrap_or_else(|| usual(&text[at..]));
    let mut records = Vec::new();
    while at < text.len() {
        if text[at..].starts_with('#') {
            at = text[at..].find('\n').map_or(text.len(), |end| at + end + 1);
            continue;
        }
        let (record, end) = record(text, at, separator, wrong);
        at = end;
        if record.iter().any(|cell| !cell.text.is_empty()) {
            records.push(record);
        }
    }
    records
}

/// The separator that is most frequent outside quotes; comments may contain commas. In a list of properties (`Level =
/// holding-register:21:UINT`) an equals sign precedes all of them.
fn usual(text: &str) -> char {
    let mut lines = text
        .lines()
        .take(1000)
        .filter(|line| !line.trim().is_empty() && !line.starts_with('#'))
        .peekable();
    let is_property = |line: &str| {
        let first = line.find(|c| c == '=' || c == '"' || SEPARATORS.contains(&c));
        first.is_some_and(|at| line[at..].starts_with('='))
    };
    if lines.peek().is_some() && lines.all(is_property) {
        return '=';
    }
    let mut counts = [0_usize; SEPARATORS.len()];
    let mut quoted = false;
    for character in text.chars().take(10_000) {
        match character {
            '"' => quoted = !quoted,
            _ if quoted => {}
            _ => {
                if let Some(which) = SEPARATORS.iter().position(|s| *s == character) {
                    counts[which] += 1;
                }
            }
        }
    }
    let most = counts.iter().max().copied().unwrap_or(0);
    // Semicolons and tabs rarely occur in text: two per line outweigh any number of commas.
    let lines = text
        .lines()
        .take(1000)
        .filter(|line| !line.trim().is_empty())
        .count();
    SEPARATORS
        .into_iter()
        .zip(counts)
        .find(|(separator, count)| {
            *count > 0 && (*count == most || *separator != ',' && *count >= lines)
        })
        .map_or(';', |(separator, _)| separator)
}

/// The record that begins at `start`, and the start of the next one.
fn record(text: &str, start: usize, separator: char, wrong: &Collector<'_>) -> (Record, usize) {
    let mut record = Vec::new();
    let mut at = start;
    let mut mistakes = Vec::new();
    let end = loop {
        let rest = &text[at..];
        let blanks = rest.len()
            - rest
                .trim_start_matches(|c| c == ' ' || (c == '\t' && separator != '\t'))
                .len();
        let begin = at + blanks;
        let (cell, end) = if text[begin..].starts_with('"') {
            quoted(text, begin, separator, &mut mistakes)
        } else {
            let rest = &text[begin..];
            let end = begin + rest.find([separator, '\n']).unwrap_or(rest.len());
            (text[begin..end].trim().to_owned(), end)
        };
        record.push(Cell {
            text: cell,
            at: begin,
        });
        match text[end..].chars().next() {
            Some(c) if c == separator => at = end + c.len_utf8(),
            Some(_) => break end + 1,
            None => break end,
        }
    };
    if !mistakes.is_empty()
        && let Some(found) = all_quoted(text, start, separator)
    {
        return found;
    }
    for (at, what, right) in mistakes {
        wrong.report(at, what, right);
    }
    (record, end)
}

/// The record of a line whose cells are all in quotes. TIA Portal's SDF does not double the quotation marks within
/// them, so only `","` separates cells.
fn all_quoted(text: &str, start: usize, separator: char) -> Option<(Record, usize)> {
    let end = text[start..]
        .find('\n')
        .map_or(text.len(), |end| start + end);
    let line = text[start..end]
        .trim_end()
        .strip_prefix('"')?
        .strip_suffix('"')?;
    let between = format!("\"{separator}\"");
    let mut at = start + 1;
    let cells = line.split(&between).map(|cell| {
        let cell_at = at;
        at += cell.len() + between.len();
        Cell {
            text: cell.trim().to_owned(),
            at: cell_at - 1,
        }
    });
    let record: Record = cells.collect();
    (record.len() > 1).then_some((record, text.len().min(end + 1)))
}

/// A mistake: its offset, the mistake itself, and the remedy.
type Found = (usize, &'static str, &'static str);

/// The quoted cell that begins at `start`, and the position of the separator or line end after it.
fn quoted(text: &str, start: usize, separator: char, wrong: &mut Vec<Found>) -> (String, usize) {
    let mut cell = String::new();
    let mut at = start + 1;
    loop {
        let Some(end) = text[at..].find('"') else {
            wrong.push((
                start,
                "a cell in quotes has no end",
                "close it with another \"",
            ));
            // If the quote is not closed, only the rest of the line can be meant.
            let line = text[start..]
                .find('\n')
                .map_or(text.len(), |end| start + end);
            return (text[start + 1..line].trim().to_owned(), line);
        };
        cell.push_str(&text[at..at + end]);
        at += end + 1;
        if !text[at..].starts_with('"') {
            break;
        }
        cell.push('"');
        at += 1;
    }
    let rest = &text[at..];
    let end = at + rest.find([separator, '\n']).unwrap_or(rest.len());
    if !text[at..end].trim().is_empty() {
        wrong.push((
            at,
            "something stands behind a cell in quotes",
            "write quotation marks within a cell twice: \"\"",
        ));
    }
    // Spreadsheets permit line breaks within cells; names and comments are one line.
    let cell = cell.split_whitespace().collect::<Vec<_>>().join(" ");
    (cell, end)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Vec<Vec<String>>, Option<String>) {
        let wrong = Collector::new("t", text);
        let records = records(text, &wrong);
        let texts = |record: Record| record.into_iter().map(|cell| cell.text).collect();
        (
            records.into_iter().map(texts).collect(),
            wrong.finish().map(|m| m.to_string()),
        )
    }

    #[test]
    fn separators_and_quotes_are_understood() {
        for text in [
            "a;%I0.0;\"x; \"\"y\"\"\"\r\n\r\n# no;line\r\n;;\r\nb ; %I0.1 ;z",
            "a,%I0.0,\"x; \"\"y\"\"\"\nb, %I0.1 ,z\n",
            "a\t%I0.0\t\"x; \"\"y\"\"\"\nb\t%I0.1\tz",
            "sep=;\r\na;%I0.0;\"x;\n\"\"y\"\"\"\nb;%I0.1;z",
        ] {
            let expected = vec![vec!["a", "%I0.0", "x; \"y\""], vec!["b", "%I0.1", "z"]];
            let (records, mistakes) = read(text);
            assert_eq!(records, expected, "{text}");
            assert_eq!(mistakes, None);
        }
    }

    #[test]
    fn commas_in_comments_separate_nothing() {
        let (records, _) = read("a;%I0.0;Bool;one, two, three, four, five, six\n");
        assert_eq!(records[0].len(), 4);
    }

    #[test]
    fn quotation_marks_that_tia_portal_does_not_double_are_text() {
        let (records, mistakes) = read(
            "\"a\",\"%I0.0\",\"Bool\",\"(\"0\" - one layer; \"1\" - two)\",\"True\"\r\n\
             \"b\",\"%I0.1\",\"Bool\",\"the \"left\"\",\"True\"\r\n\"c\",\"%I0.2\",\"Bool\",\"a \"\"b\"\"\",\"\"\n",
        );
        assert_eq!(mistakes, None);
        let comments: Vec<&str> = records.iter().map(|record| record[3].as_str()).collect();
        assert_eq!(
            comments,
            [
                "(\"0\" - one layer; \"1\" - two)",
                "the \"left\"",
                "a \"b\""
            ]
        );
        assert!(
            records.iter().all(|record| record.len() == 5),
            "{records:?}"
        );
    }

    #[test]
    fn quotes_without_end_are_told_and_cost_one_line() {
        let (records, mistakes) = read("a;\"%I0.0;x\nb;%I0.1;y\n");
        assert_eq!(
            mistakes.as_deref(),
            Some("t:1:3: a cell in quotes has no end; close it with another \"")
        );
        assert_eq!(records.len(), 2);
        let (_, mistakes) = read("\"a\"b;%I0.0\n");
        assert!(
            mistakes
                .unwrap()
                .starts_with("t:1:4: something stands behind a cell in quotes")
        );
    }
}
