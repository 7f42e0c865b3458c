//! The glossary of docs/ARCHITECTURE.md names only what is public in the sources.

use super::source::{texts, tokens};

/// The names in the last column of the glossary's table that no source defines; `sources` are the texts of all.
pub(crate) fn unknown(text: &str, sources: &[String]) -> Vec<String> {
    let defined = definitions(sources);
    let table = text.split_once("## Glossary").map_or("", |(_, rest)| rest);
    let rows = table.lines().filter(|line| line.starts_with("| "));
    let cells = rows.filter_map(|row| row.trim_end_matches([' ', '|']).rsplit(" | ").next());
    let paths = cells.flat_map(|cell| cell.split('`').skip(1).step_by(2));
    paths
        .filter(|path| path.contains("::"))
        .filter(|path| {
            let mut names = path.rsplit("::");
            names.next().is_none_or(|name| !defined.contains(name))
        })
        .map(str::to_owned)
        .collect()
}

/// Every name that is defined for others: items, fields, and variants of enums.
fn definitions(sources: &[String]) -> std::collections::HashSet<String> {
    const KINDS: [&str; 8] = [
        "struct", "enum", "trait", "fn", "const", "type", "mod", "as",
    ];
    let mut found = std::collections::HashSet::new();
    for source in sources {
        let tokens = tokens(source);
        for (at, token) in tokens.iter().enumerate() {
            let next = &tokens[at + 1..];
            let is_item = KINDS.contains(&token.text) && !next.is_empty();
            if is_item {
                found.insert(next[0].text.to_owned());
            }
            let is_field = token.text == "pub" && next.len() > 1 && texts(&next[1..], &[":"]);
            if is_field {
                found.insert(next[0].text.to_owned());
            }
            // A variant stands behind `{` or `,` and begins with a capital.
            let is_behind = ["{", ","].contains(&token.text);
            if is_behind
                && next
                    .first()
                    .is_some_and(|n| n.text.starts_with(char::is_uppercase))
            {
                found.insert(next[0].text.to_owned());
            }
        }
    }
    found
}
