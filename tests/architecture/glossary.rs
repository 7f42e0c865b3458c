//! The glossary of docs/ARCHITECTURE.md names what there is, by its path in the crate `tickbus`.

use std::collections::{BTreeMap, HashSet};

use super::circles::{Module, Path, resolve};
use super::source::{texts, tokens};

/// The paths in the last column of the glossary's table that lead nowhere.
pub(crate) fn unknown(text: &str, modules: &BTreeMap<Path, Module<'_>>) -> Vec<String> {
    let table = text.split_once("## Glossary").map_or("", |(_, rest)| rest);
    let rows = table.lines().filter(|line| line.starts_with("| "));
    let cells = rows.filter_map(|row| row.trim_end_matches([' ', '|']).rsplit(" | ").next());
    let paths = cells.flat_map(|cell| cell.split('`').skip(1).step_by(2));
    paths
        .filter(|path| path.contains("::"))
        .filter(|path| {
            let names = format!("tickbus::{path}");
            !leads_somewhere(modules, &names.split("::").map(str::to_owned).collect())
        })
        .map(str::to_owned)
        .collect()
}

/// Whether a path leads to a module, to something that a module defines, or to a member of that.
fn leads_somewhere(modules: &BTreeMap<Path, Module<'_>>, path: &Path) -> bool {
    let (at, rest) = resolve(modules, path);
    let Some(module) = modules.get(&at) else {
        return false;
    };
    let is_here = |name: &String| definitions(module.file.text).contains(name.as_str());
    let is_found = match &*rest {
        [] => true,
        [name] => is_here(name),
        // Its `impl` may stand in another file of the crate.
        [of, member] => {
            let mut own = modules.iter().filter(|(path, _)| path[0] == at[0]);
            is_here(of) && own.any(|(_, module)| has_member(module.file.text, of, member))
        }
        _ => false,
    };
    // Or to what the module exports from another one as a whole.
    is_found
        || module.imports.get("*").is_some_and(|all| {
            let path = [&all[..all.len() - 1], &rest].concat();
            leads_somewhere(modules, &path)
        })
}

/// Whether a file with the definition or an `impl` of `of` defines `member`.
fn has_member(text: &str, of: &str, member: &str) -> bool {
    let tokens = tokens(text);
    let begins = |word: &str| ["struct", "enum", "trait", "impl", ">"].contains(&word);
    let mut pairs = tokens.windows(2);
    pairs.any(|pair| begins(pair[0].text) && pair[1].text == of)
        && definitions(text).contains(member)
}

/// Every name that a file defines: items, public fields, and variants of enums.
fn definitions(text: &str) -> HashSet<&str> {
    const KINDS: [&str; 7] = ["struct", "enum", "trait", "fn", "const", "type", "mod"];
    let mut found = HashSet::new();
    let tokens = tokens(text);
    for (at, token) in tokens.iter().enumerate() {
        let next = &tokens[at + 1..];
        let Some(name) = next.first().map(|name| name.text) else {
            break;
        };
        let is_item = KINDS.contains(&token.text);
        let is_field = token.text == "pub" && texts(&next[1..], &[":"]);
        // A variant stands behind `{`, `,` or an attribute, and begins with a capital.
        let is_variant =
            ["{", ",", "]"].contains(&token.text) && name.starts_with(char::is_uppercase);
        if is_item || is_field || is_variant {
            found.insert(name);
        }
    }
    found
}
