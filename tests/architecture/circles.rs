//! Circles inside a crate: the compiler keeps crates apart, but lets the modules of one use each other in a ring.

use std::collections::{BTreeMap, BTreeSet};

use super::rules::File;
use super::source::{Token, texts, tokens};

/// The names of a path, from the crate's root.
type Path = Vec<String>;

/// What one file says of others.
struct Module {
    /// Names that it imports, and what they stand for.
    imports: BTreeMap<String, Path>,
    /// Every path in it, with its line.
    uses: Vec<(usize, Path)>,
    file: String,
}

/// A tie from one module to its sibling: where it is.
type Ties = BTreeMap<(Path, String), BTreeMap<String, String>>;

/// The circles among the modules of one crate, each as a line; `root` is the folder of its `lib.rs`.
///
/// Modules of one parent are compared with each other: what a module uses of its parent, or a parent of its
/// children, is no circle. Tests do not count, and neither do macros.
pub(crate) fn circles(root: &str, files: &[File<'_>]) -> Vec<String> {
    let mut modules = BTreeMap::new();
    for file in files {
        let Some(inner) = file.path.strip_prefix(root) else {
            continue;
        };
        let path = module(inner);
        if !path.iter().any(|name| name == "tests") {
            modules.insert(path.clone(), read(file, &path));
        }
    }
    let mut ties = Ties::new();
    for (from, module) in &modules {
        for (line, path) in &module.uses {
            let to = resolve(&modules, path);
            let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            if let (Some(a), Some(b)) = (from.get(shared), to.get(shared)) {
                let key = (from[..shared].to_vec(), a.clone());
                let place = format!("{}:{line}", module.file);
                ties.entry(key)
                    .or_default()
                    .entry(b.clone())
                    .or_insert(place);
            }
        }
    }
    let parents: BTreeSet<&Path> = ties.keys().map(|(parent, _)| parent).collect();
    let mut found = Vec::new();
    for parent in parents {
        found.extend(rings(&ties, parent));
    }
    found
}

/// The module that a file is: `a/b.rs` and `a/b/mod.rs` are `a::b`.
fn module(inner: &str) -> Path {
    let inner = inner.trim_start_matches('/').trim_end_matches(".rs");
    let mut path: Path = inner.split('/').map(str::to_owned).collect();
    if ["mod", "lib", "main"].contains(&path.last().map_or("", String::as_str)) {
        path.pop();
    }
    path
}

fn read(file: &File<'_>, module: &Path) -> Module {
    let all = tokens(file.text);
    let tokens = without_tests(&all);
    let mut read = Module {
        imports: BTreeMap::new(),
        uses: Vec::new(),
        file: file.path.to_owned(),
    };
    let mut at = 0;
    while at < tokens.len() {
        // `use<'a>` in a type is no import.
        if tokens[at].text == "use" && !texts(&tokens[at + 1..], &["<"]) {
            let mut leaves = Vec::new();
            at = tree(tokens, at + 1, &[], &mut leaves);
            for (line, path, alias) in leaves {
                let path = absolute(&path, module);
                let name = alias.or_else(|| path.last().cloned());
                if let Some(name) = name {
                    read.imports.insert(name, path.clone());
                }
                read.uses.push((line, path));
            }
        } else if ["crate", "super"].contains(&tokens[at].text)
            && texts(&tokens[at + 1..], &[":", ":"])
        {
            let line = tokens[at].line;
            let mut path = vec![tokens[at].text.to_owned()];
            at += 1;
            while texts(&tokens[at..], &[":", ":"]) && at + 2 < tokens.len() {
                path.push(tokens[at + 2].text.to_owned());
                at += 3;
            }
            read.uses.push((line, absolute(&path, module)));
        } else {
            at += 1;
        }
    }
    read
}

/// The tokens before the first inline module of tests, which stands at the end of a file here.
fn without_tests<'a, 't>(tokens: &'a [Token<'t>]) -> &'a [Token<'t>] {
    let is_tests = |at: &usize| {
        texts(&tokens[*at..], &["mod", "tests", "{"]) || texts(&tokens[*at..], &["mod", "loom_"])
    };
    let end = (0..tokens.len()).find(is_tests).unwrap_or(tokens.len());
    &tokens[..end]
}

/// Reads a tree of `use` from `at`: its leaves with the names they are given. The answer is where it ends.
fn tree(
    tokens: &[Token<'_>],
    mut at: usize,
    before: &[String],
    leaves: &mut Vec<(usize, Path, Option<String>)>,
) -> usize {
    let mut path = before.to_vec();
    let line = tokens.get(at).map_or(0, |token| token.line);
    while let Some(token) = tokens.get(at) {
        match token.text {
            "{" => {
                at += 1;
                loop {
                    at = tree(tokens, at, &path, leaves);
                    if tokens.get(at).is_none_or(|token| token.text != ",") {
                        return at + 1;
                    }
                    at += 1;
                }
            }
            ";" | "," | "}" => break,
            "as" => {
                let alias = tokens.get(at + 1).map(|token| token.text.to_owned());
                leaves.push((line, path, alias));
                return at + 2;
            }
            ":" => {}
            "self" if !path.is_empty() => {}
            name => path.push(name.to_owned()),
        }
        at += 1;
    }
    // Behind the last comma of a group nothing stands.
    if path.len() > before.len() {
        leaves.push((line, path, None));
    }
    at
}

/// A path as seen from the crate's root. One that begins with another name is relative, or of another crate: then
/// it leads to no module.
fn absolute(path: &[String], module: &Path) -> Path {
    let mut base = module.clone();
    let mut rest = path;
    match path.first().map(String::as_str) {
        Some("crate") => return path[1..].to_vec(),
        Some("self") => rest = &path[1..],
        _ => {
            while rest.first().is_some_and(|name| name == "super") {
                base.pop();
                rest = &rest[1..];
            }
        }
    }
    base.extend_from_slice(rest);
    base
}

/// The module in which the last name of `path` is, imports followed.
fn resolve(modules: &BTreeMap<Path, Module>, path: &Path) -> Path {
    let mut path = path.clone();
    for _ in 0..8 {
        let deepest = (0..=path.len())
            .rev()
            .find(|length| modules.contains_key(&path[..*length]));
        let Some(length) = deepest else {
            return Vec::new();
        };
        let import = path
            .get(length)
            .and_then(|name| modules[&path[..length]].imports.get(name));
        match import {
            Some(target) if *target != path => {
                let mut next = target.clone();
                next.extend_from_slice(&path[length + 1..]);
                path = next;
            }
            _ => {
                path.truncate(length);
                return path;
            }
        }
    }
    Vec::new()
}

/// The rings among the children of `parent`, each told once, with a place for each of its ties.
fn rings(ties: &Ties, parent: &Path) -> Vec<String> {
    let of = |name: &str| ties.get(&(parent.clone(), name.to_owned()));
    let reaches = |from: &str| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![from.to_owned()]);
        while let Some(name) = open.pop() {
            for next in of(&name).into_iter().flat_map(BTreeMap::keys) {
                if seen.insert(next.clone()) {
                    open.push(next.clone());
                }
            }
        }
        seen
    };
    let names = ties
        .keys()
        .filter(|(p, _)| p == parent)
        .map(|(_, name)| name);
    let reached: BTreeMap<&String, BTreeSet<String>> =
        names.map(|name| (name, reaches(name))).collect();
    let mut found = BTreeSet::new();
    for (name, seen) in reached.iter().filter(|(name, seen)| seen.contains(**name)) {
        let ring: BTreeSet<&str> = (reached.iter())
            .filter(|(other, back)| seen.contains(**other) && back.contains(*name))
            .map(|(other, _)| other.as_str())
            .collect();
        let mut places = Vec::new();
        for from in &ring {
            for (to, place) in of(from).into_iter().flatten() {
                if ring.contains(to.as_str()) {
                    places.push(format!("{place} ({from} -> {to})"));
                }
            }
        }
        let ring: Vec<&str> = ring.into_iter().collect();
        found.insert(format!(
            "{} use each other: {}; move what both need into a file below them",
            ring.join(", "),
            places.join(", ")
        ));
    }
    found.into_iter().collect()
}
