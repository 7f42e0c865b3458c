//! The table of tags that Studio 5000 exports as CSV.

use std::collections::{HashMap, HashSet};
use std::fmt::Write as _;

use super::{cells, commented_point, kind_by_name, unknown};
use crate::cells::{Cell, Record};
use crate::device;
use crate::xml::in_folder;
use tickbus_base::toml_text::Collector;

/// The headings of Studio 5000's table of tags.
const HEADINGS: [&str; 6] = [
    "TYPE",
    "SCOPE",
    "NAME",
    "DESCRIPTION",
    "DATATYPE",
    "SPECIFIER",
];

/// The points in a table of tags that Studio 5000 exported as CSV: aliases of points, and points with a comment. `None`
/// for any other table.
pub(crate) fn table(records: &[Record], skipped: &Collector<'_>) -> Option<Vec<Record>> {
    let is_heading = |record: &Record| {
        let cells = record.iter().map(|cell| cell.text.as_str());
        record.len() >= HEADINGS.len() && cells.zip(HEADINGS).all(|(cell, heading)| cell == heading)
    };
    let first = 1 + records.iter().take(50).position(is_heading)?;
    let mut points = Vec::new();
    let mut seen = HashSet::new();
    // Aliases of structures, by their names: the target, its cell, and true if a point of it was found.
    let mut wholes: Vec<(String, &Cell, bool)> = Vec::new();
    let mut by_name = HashMap::new();
    // An alias is a better name than the comment of the point.
    for wanted in ["ALIAS", "COMMENT"] {
        for record in &records[first..] {
            let [of, scope, name, comment, kind, path] = HEADINGS_AT.map(|index| record.get(index));
            let (Some(of), Some(scope), Some(name), Some(path)) = (of, scope, name, path) else {
                continue;
            };
            if of.text != wanted {
                continue;
            }
            let called = match scope.text.as_str() {
                "" => name.text.clone(),
                program => format!("{program}.{}", name.text),
            };
            let comment = unescaped(comment.map_or("", |comment| comment.text.as_str()));
            let at = [name.at, path.at, path.at, path.at];
            if device::module_side(&path.text).is_none() {
                // The path of an alias' member begins with the name of the alias.
                let whole = by_name.get(&called.to_ascii_uppercase());
                if wanted == "COMMENT"
                    && let Some((target, _, has_points)) =
                        whole.and_then(|index: &usize| wholes.get_mut(*index))
                    && let Some((member, kind)) =
                        path.text.get(name.text.len()..).and_then(commented_point)
                    && seen.insert(format!("{target}{member}").to_ascii_uppercase())
                {
                    *has_points = true;
                    let texts = [&called, &*target].map(|whole| format!("{whole}{member}"));
                    let point = cells([&texts[0], &texts[1], kind, &comment], at);
                    points.push(in_folder(point, Some(&scope.text)));
                }
                continue;
            }
            let mut kind = kind.map_or("", |kind| kind.text.as_str());
            if kind.is_empty() {
                let attributes = record.get(HEADINGS.len());
                let is_float = attributes.is_some_and(|cell| cell.text.contains("RADIX := Float"));
                kind = kind_by_name(&path.text, is_float).unwrap_or_default();
            }
            if kind.is_empty() {
                by_name.insert(called.to_ascii_uppercase(), wholes.len());
                wholes.push((path.text.clone(), path, false));
                continue;
            }
            if !seen.insert(path.text.to_ascii_uppercase()) && wanted == "COMMENT" {
                continue;
            }
            let called = match wanted {
                "COMMENT" => path.text.as_str(),
                _ => &called,
            };
            let point = cells([called, &path.text, kind, &comment], at);
            points.push(in_folder(point, Some(&scope.text)));
        }
    }
    for (target, path, has_points) in wholes {
        unknown(skipped, path.at, &target, has_points, "table");
    }
    Some(points)
}

const HEADINGS_AT: [usize; HEADINGS.len()] = [0, 1, 2, 3, 4, 5];

/// A description without Studio 5000's escapes: `$N` is a line end, `$Q` a quotation mark, `$00E9` a character.
fn unescaped(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('$') {
        plain.push_str(before);
        let code = after
            .get(..4)
            .and_then(|code| u32::from_str_radix(code, 16).ok());
        if let Some(c) = code.and_then(char::from_u32) {
            plain.push(c);
            rest = &after[4..];
            continue;
        }
        let letter = after.chars().next();
        match letter {
            Some('N' | 'n' | 'R' | 'r' | 'L' | 'l' | 'T' | 't') => plain.push(' '),
            Some('Q' | 'q') => plain.push('"'),
            Some(c) => plain.push(c),
            None => {}
        }
        rest = &after[letter.map_or(0, char::len_utf8)..];
    }
    write!(plain, "{rest}").expect("a String takes all");
    plain.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_of_descriptions_are_read() {
        assert_eq!(unescaped("a$Nb $Qc$Q 5$$ $00E9$'"), "a b \"c\" 5$ é'");
        assert_eq!(unescaped("$"), "");
    }
}
