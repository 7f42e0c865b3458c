//! Cycles within a crate: the compiler prevents cycles among crates, but not among the modules of one.

use std::collections::{BTreeMap, BTreeSet};

use super::package;
use super::rules::File;
use super::source::{Token, texts, tokens};

/// The names of a path, from the crate's own name on.
pub(crate) type Path = Vec<String>;

/// The references of one file to others.
pub(crate) struct Module<'a> {
    /// Imported names, and the paths that they stand for.
    pub(crate) imports: BTreeMap<String, Path>,
    /// Every path in it, with its line.
    uses: Vec<(usize, Path)>,
    pub(crate) file: File<'a>,
}

/// The references from one module to its sibling, with their positions.
type Ties = BTreeMap<(Path, String), BTreeMap<String, String>>;

/// The modules in these files of all crates, except those of tests.
pub(crate) fn modules<'a>(files: &[File<'a>]) -> BTreeMap<Path, Module<'a>> {
    let paths = files.iter().map(|file| (module(file.path), *file));
    let own = paths.filter(|(path, _)| !path.iter().any(|name| name == "tests"));
    own.map(|(path, file)| (path.clone(), read(file, &path)))
        .collect()
}

/// The cycles among the modules of each crate, one per line.
///
/// Modules with the same parent are compared with each other: a module's use of its parent, or a parent's use of its
/// children, is no cycle. Tests and macros do not count.
pub(crate) fn circles(files: &[File<'_>]) -> Vec<String> {
    let modules = modules(files);
    let mut ties = Ties::new();
    for (from, module) in &modules {
        for (line, path) in &module.uses {
            let (to, _) = resolve(&modules, path);
            // The compiler checks references between crates.
            if to.first() != from.first() {
                continue;
            }
            let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            if let (Some(a), Some(b)) = (from.get(shared), to.get(shared)) {
                let key = (from[..shared].to_vec(), a.clone());
                let place = format!("{}:{line}", module.file.path);
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

/// The module of a file: `crates/core/a/src/b/c.rs` and `crates/core/a/src/b/c/mod.rs` are `tickbus_a::b::c`.
fn module(file: &str) -> Path {
    let (folder, inner) = file.split_once("src/").unwrap_or(("", file));
    let name = format!("tickbus_{}", package(folder).replace('-', "_"));
    let mut path = vec![name.trim_end_matches('_').to_owned()];
    path.extend(inner.trim_end_matches(".rs").split('/').map(str::to_owned));
    if ["mod", "lib"].contains(&path.last().map_or("", String::as_str)) {
        path.pop();
    }
    path
}

fn read<'a>(file: File<'a>, module: &Path) -> Module<'a> {
    let all = tokens(file.text);
    let tokens = without_tests(&all);
    let mut read = Module {
        imports: BTreeMap::new(),
        uses: Vec::new(),
        file,
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

/// The tokens before the first inline module of tests, which is at the end of a file here.
fn without_tests<'a, 't>(tokens: &'a [Token<'t>]) -> &'a [Token<'t>] {
    let is_tests = |at: &usize| {
        texts(&tokens[*at..], &["mod", "tests", "{"]) || texts(&tokens[*at..], &["mod", "loom_"])
    };
    let end = (0..tokens.len()).find(is_tests).unwrap_or(tokens.len());
    &tokens[..end]
}

/// Reads a tree of `use` from `at`: its leaves with their names. Returns where the tree ends.
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
    // Nothing follows the last comma of a group.
    if path.len() > before.len() {
        leaves.push((line, path, None));
    }
    at
}

/// A path with the name of its crate. A path that begins with another name is relative, or in a foreign crate: then it
/// leads to no module.
fn absolute(path: &[String], module: &Path) -> Path {
    let mut base = module.clone();
    let mut rest = path;
    match path.first().map(String::as_str) {
        Some("crate") => {
            base.truncate(1);
            rest = &path[1..];
        }
        Some(name) if name.starts_with("tickbus_") => return path.to_vec(),
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

/// The module that contains the last name of `path`, following imports, and the part of the path within that module.
pub(crate) fn resolve(modules: &BTreeMap<Path, Module<'_>>, path: &Path) -> (Path, Path) {
    let mut path = path.clone();
    for _ in 0..8 {
        let deepest = (0..=path.len())
            .rev()
            .find(|length| modules.contains_key(&path[..*length]));
        let Some(length) = deepest else {
            break;
        };
        let imports = &modules[&path[..length]].imports;
        let import = path.get(length).and_then(|name| imports.get(name));
        match import {
            Some(target) if *target != path => {
                let mut next = target.clone();
                next.extend_from_slice(&path[length + 1..]);
                path = next;
            }
            _ => {
                let rest = path.split_off(length);
                return (path, rest);
            }
        }
    }
    (Vec::new(), path)
}

/// The cycles among the children of `parent`, each reported once, with a position for each of its references.
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
