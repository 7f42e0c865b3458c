//! The glossary of docs/ARCHITECTURE.md names items that exist, by their paths in the crate `tickbus`.

use std::collections::{BTreeMap, HashSet};

use super::circles::{Module, Path, resolve};
use super::source::{Token, texts, tokens};

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

/// True if a path leads to a module, to an item that a module defines, or to a member of such an item.
fn leads_somewhere(modules: &BTreeMap<Path, Module<'_>>, path: &Path) -> bool {
    let (at, rest) = resolve(modules, path);
    let Some(module) = modules.get(&at) else {
        return false;
    };
    let is_here = |name: &String| definitions(module.file.text).contains(name.as_str());
    let is_found = match &*rest {
        [] => true,
        [name] => is_here(name),
        // The item's `impl` may be in another file of the crate.
        [of, member] => {
            let mut own = modules.iter().filter(|(path, _)| path[0] == at[0]);
            is_here(of) && own.any(|(_, module)| has_member(module.file.text, of, member))
        }
        _ => false,
    };
    // Or to a wildcard import from another module.
    is_found
        || module.imports.get("*").is_some_and(|all| {
            let path = [&all[..all.len() - 1], &rest].concat();
            leads_somewhere(modules, &path)
        })
}

/// True if the definition of `of` or an `impl` of it in this file has `member`.
fn has_member(text: &str, of: &str, member: &str) -> bool {
    let tokens = tokens(text);
    let begins = |word: &str| ["struct", "enum", "trait", "impl", ">", "for"].contains(&word);
    let mut found = (1..tokens.len())
        .filter(|&at| begins(tokens[at - 1].text) && tokens[at].text == of)
        .map(|at| braces(&tokens[at..]));
    found.any(|body| names(body).contains(member))
}

/// The tokens in the first pair of braces.
fn braces<'a, 'b>(tokens: &'b [Token<'a>]) -> &'b [Token<'a>] {
    let begin = tokens.iter().position(|token| token.text == "{");
    let tokens = &tokens[begin.unwrap_or(tokens.len())..];
    let mut depth = 0;
    let end = tokens.iter().position(|token| {
        depth += i32::from(token.text == "{") - i32::from(token.text == "}");
        depth == 0
    });
    &tokens[..end.unwrap_or(tokens.len())]
}

/// Every name that a file defines: items, public fields, and variants of enums.
fn definitions(text: &str) -> HashSet<&str> {
    names(&tokens(text))
}

fn names<'a>(tokens: &[Token<'a>]) -> HashSet<&'a str> {
    const KINDS: [&str; 7] = ["struct", "enum", "trait", "fn", "const", "type", "mod"];
    let mut found = HashSet::new();
    for (at, token) in tokens.iter().enumerate() {
        let next = &tokens[at + 1..];
        let Some(name) = next.first().map(|name| name.text) else {
            break;
        };
        let is_item = KINDS.contains(&token.text);
        let is_field = token.text == "pub" && texts(&next[1..], &[":"]);
        // A variant follows `{`, `,` or an attribute, and begins with a capital.
        let is_variant =
            ["{", ",", "]"].contains(&token.text) && name.starts_with(char::is_uppercase);
        if is_item || is_field || is_variant {
            found.insert(name);
        }
    }
    found
}
