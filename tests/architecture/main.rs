//! Enforces the project's structure: unsafe code and reading the system's clocks are confined to certain files, the core
//! knows no bus, no file grows without limit, and docs/ARCHITECTURE.md shows the current crates.

mod circles;
mod glossary;
mod picture;
mod rules;
mod source;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use circles::circles;
use glossary::unknown;
use rules::{File, buses_of_core, mistakes};

/// All Rust sources below `directory`, in order.
fn sources(directory: &Path) -> Vec<PathBuf> {
    let entries =
        fs::read_dir(directory).unwrap_or_else(|e| panic!("{}: {e}", directory.display()));
    let mut found = Vec::new();
    for entry in entries {
        let path = entry.expect("the folder can be read").path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The sources of all crates, each by its path from the project's root.
fn all_sources() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files = crates(root)
        .into_iter()
        .flat_map(|folder| sources(&root.join(folder)));
    let read = |file: PathBuf| {
        let path = file.strip_prefix(root).expect("it is below the root");
        let path = path.to_str().expect("names are UTF-8").replace('\\', "/");
        (path, fs::read_to_string(&file).expect("sources are UTF-8"))
    };
    files.map(read).collect()
}

fn files(sources: &[(String, String)]) -> Vec<File<'_>> {
    let files = sources.iter().map(|(path, text)| File { path, text });
    files.collect()
}

/// The folders with the sources of a crate, from the project's root.
fn crates(root: &Path) -> Vec<String> {
    let mut found = vec!["src".to_owned(), "python/src".to_owned()];
    // A crate is a folder of a house; `crates/kinds` is one by itself.
    let mut open = vec!["crates".to_owned()];
    while let Some(folder) = open.pop() {
        let entries = fs::read_dir(root.join(&folder)).expect("the folder can be read");
        for entry in entries {
            let entry = entry.expect("readable");
            let below = format!("{folder}/{}", entry.file_name().to_str().expect("UTF-8"));
            if entry.path().join("Cargo.toml").exists() {
                found.push(format!("{below}/src"));
            } else if entry.path().is_dir() {
                open.push(below);
            }
        }
    }
    found.sort();
    found
}

/// The name of the package in a folder, without `tickbus-`: `crates/bus/s7` has `bus-s7`.
fn package(folder: &str) -> String {
    let below = folder.trim_start_matches("crates/").trim_end_matches('/');
    match below.split_once('/') {
        Some(("bus", name)) => format!("bus-{name}"),
        Some((_, name)) => name.to_owned(),
        None => below.to_owned(),
    }
}

#[test]
fn the_house_is_in_order() {
    let sources = all_sources();
    let files = files(&sources);
    assert!(files.len() > 40, "only {} sources found", files.len());
    let mut found: Vec<String> = files.iter().flat_map(|file| mistakes(*file)).collect();
    found.extend(circles(&files));
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn every_crate_has_its_row_in_the_table_of_rooms() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("docs/ARCHITECTURE.md")).expect("it is there");
    for folder in crates(root) {
        let row = format!("| `{}` |", folder.trim_end_matches("/src"));
        assert!(text.contains(&row), "docs/ARCHITECTURE.md has no row {row}");
    }
}

/// The manifests of all crates, by the names of their packages.
fn manifests() -> BTreeMap<String, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |folder: &String| {
        let folder = folder.trim_end_matches("src");
        let manifest = fs::read_to_string(root.join(folder).join("Cargo.toml"));
        let name = package(folder);
        let name = if name.is_empty() {
            "src".to_owned()
        } else {
            name
        };
        (name, manifest.expect("a crate has a manifest"))
    };
    crates(root).iter().map(read).collect()
}

#[test]
fn the_core_knows_no_bus() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    for folder in crates(root) {
        let file = format!("{}Cargo.toml", folder.trim_end_matches("src"));
        let manifest = fs::read_to_string(root.join(&file)).expect("a crate has a manifest");
        found.extend(buses_of_core(&file, &manifest));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
    let manifest = "[dependencies]\ntickbus-base.workspace = true\n[dev-dependencies]\n\
                    tickbus-bus-s7.workspace = true\n";
    assert_eq!(
        buses_of_core("crates/core/driver-cfg/Cargo.toml", manifest).len(),
        1
    );
    let elsewhere = buses_of_core("crates/tools/export/Cargo.toml", manifest);
    assert_eq!(elsewhere, Vec::<String>::new());
    let text =
        "use tickbus_fieldbus::Bus;\nuse tickbus_bus_s7 as s7;\nfn f() { tickbus_kinds::KINDS }";
    let found = [(2, "tickbus_bus_s7"), (3, "tickbus_kinds")];
    finds("crates/core/driver-cfg/src/config.rs", text, &found);
    finds("crates/tools/export/src/lib.rs", text, &[]);
}

#[test]
fn the_picture_of_the_rooms_is_that_of_their_manifests() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifests = manifests();
    let file = root.join("docs/ARCHITECTURE.md");
    let text = fs::read_to_string(&file).expect("it is there");
    let right = picture::redrawn(&text, &manifests);
    if std::env::var_os("TICKBUS_UPDATE").is_some() {
        fs::write(&file, &right).expect("it can be written");
    } else {
        assert!(
            text == right,
            "the picture in docs/ARCHITECTURE.md is out of date; TICKBUS_UPDATE=1 draws it anew"
        );
    }
}

#[test]
fn an_arrow_that_others_imply_is_not_drawn() {
    let manifest = |uses: &[&str]| {
        let uses = uses.iter().fold(String::new(), |lines, name| {
            lines + "tickbus-" + name + ".workspace = true\n"
        });
        format!(
            "[package]\n[dependencies]\nlog = 1\n{uses}[dev-dependencies]\ntickbus-top.workspace = true\n"
        )
    };
    let crates = [
        ("a", &[][..]),
        ("b", &["a"]),
        ("c", &["b", "a"]),
        ("top", &["a", "c", "elsewhere"]),
    ];
    let manifests = crates.map(|(name, uses)| (name.to_owned(), manifest(uses)));
    assert_eq!(
        picture::picture(&BTreeMap::from(manifests)),
        "```mermaid\ngraph TD\n    b --> a\n    c --> b\n    top --> c\n```\n"
    );
}

#[test]
fn the_glossary_names_what_there_is() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("docs/ARCHITECTURE.md")).expect("it is there");
    let mut sources = all_sources();
    // build.rs generates this enum from the table of status codes.
    let codes = sources
        .iter_mut()
        .find(|(path, _)| path == "crates/core/driver/src/status.rs");
    codes.expect("it is there").1 += "pub enum Code { Fresh, Unchanged, Stale }";
    let modules = circles::modules(&files(&sources));
    assert_eq!(unknown(&text, &modules), Vec::<String>::new());
    for (path, is_known) in [
        ("driver::Driver", true),
        ("driver::Driver::exchange", true),
        ("fieldbus::Port::log", true),
        ("fieldbus::modbus::mbap", true),
        ("driver::Driver::nothing", false),
        ("driver::Nobody", false),
        // Both names exist, but not there.
        ("image::Driver::exchange", false),
        ("driver::Driver::address", false),
        // A member of a neighbour in the same file.
        ("image::Arrival::cycles", false),
        ("nowhere::Driver", false),
    ] {
        let text = format!("## Glossary\n| a | b | `{path}` |\n");
        assert_eq!(unknown(&text, &modules).is_empty(), is_known, "{path}");
    }
}

/// Checks that exactly these lines of an imaginary file are reported, each with a word of the message.
#[track_caller]
fn finds(path: &str, text: &str, expected: &[(usize, &str)]) {
    let found = mistakes(File { path, text });
    assert_eq!(found.len(), expected.len(), "{path}: {found:#?}");
    for ((line, word), message) in expected.iter().zip(&found) {
        let place = format!("{path}:{line}: ");
        let fits = message.starts_with(&place) && message.contains(word);
        assert!(fits, "expected {place}…{word}…, found {message}");
    }
}

#[track_caller]
fn finds_circles(files: &[(&str, &str)], expected: &[&str]) {
    let files: Vec<File<'_>> = files
        .iter()
        .map(|&(path, text)| File { path, text })
        .collect();
    let found = circles(&files);
    assert_eq!(found.len(), expected.len(), "{found:#?}");
    for (found, words) in found.iter().zip(expected) {
        assert!(found.starts_with(words), "expected {words}…, found {found}");
    }
}

#[test]
fn modules_that_use_each_other_are_found() {
    let root = ("src/lib.rs", "mod a;\nmod b;\npub use a::A;\npub use b::B;");
    let b = ("src/b.rs", "use super::A;");
    finds_circles(&[root, ("src/a.rs", "fn f() {}"), b], &[]);
    for text in [
        "use super::B;",
        "use crate::{x, b::{B, C}};",
        "fn f() -> super::b::B {}",
        "use std::fmt; use crate::b as other;",
    ] {
        finds_circles(&[root, ("src/a.rs", text), b], &["a, b use each other: "]);
    }
    let tests = "fn f() {}\n#[cfg(test)]\nmod tests { use super::super::B; }";
    finds_circles(&[root, ("src/a.rs", tests), b], &[]);
    let deep = [
        ("src/lib.rs", "mod x;"),
        ("src/x/mod.rs", "mod a;\nmod b;\nmod c;\npub struct Own;"),
        ("src/x/a.rs", "use super::b::B; use super::Own;"),
        ("src/x/b/mod.rs", "use super::c::C;"),
        ("src/x/c.rs", "use crate::x::a::A;"),
    ];
    finds_circles(&deep, &["a, b, c use each other: src/x/a.rs:1 (a -> b), "]);
    finds_circles(&deep[..4], &[]);
}

#[test]
fn comments_and_literals_do_not_count() {
    let text = "/// See `crate::driver`. /* /* unsafe */\n\
                /* crate::driver /* unsafe */ crate::jni */\n\
                const A: &str = \"unsafe \\\" crate::driver\";\n\
                const B: &str = r#\"unsafe \" crate::driver\"#;\n\
                const C: [u8; 3] = [b'\"', b'\\'', b'u'];\n\
                fn f<'a>(c: char) -> &'a str { if c == '\"' { \"SystemTime\" } else { br\"\" } }\n\
                unsafe fn g() {}";
    finds("crates/core/base/src/time/mod.rs", text, &[(7, "unsafe")]);
}

#[test]
fn unsafe_code_away_from_home_is_found() {
    let text = "#![allow(unsafe_code)]\nfn f() { unsafe { g() } }";
    for home in [
        "src/jni.rs",
        "src/jni/shared.rs",
        "crates/core/base/src/os/linux.rs",
        "crates/core/image/src/triple.rs",
    ] {
        finds_no_unsafe(home, text);
    }
    finds("crates/core/image/src/ring.rs", text, &[(2, "unsafe code")]);
    finds("src/jnix/mod.rs", text, &[(2, "unsafe code")]);
}

#[track_caller]
fn finds_no_unsafe(path: &str, text: &str) {
    let found = mistakes(File { path, text });
    assert!(
        !found.iter().any(|found| found.contains("unsafe code")),
        "{found:#?}"
    );
}

#[test]
fn a_wall_clock_away_from_home_is_found() {
    let text = "use std::time::{Duration, Instant, SystemTime};\n\
                fn f() { Instant::now(); }\n\
                fn g() { std::thread::sleep(Duration::ZERO); }";
    let found = [(1, "SystemTime"), (2, "Instant::now"), (3, "thread::sleep")];
    finds("crates/core/driver/src/open.rs", text, &found);
    let text = "use opcua_types::DateTime;\n\
                fn f() { DateTime::now(); }\n\
                fn g() { chrono::Utc::now(); Self::now(); clock.now(); yield_now() }\n\
                fn h() { time::OffsetDateTime::now_utc(); thread::yield_now(); }";
    let found = [(2, "DateTime::now"), (3, "Utc::now"), (4, "now_utc")];
    finds("crates/bus/opcua/src/pki.rs", text, &found);
    finds("crates/core/base/src/time/clock.rs", text, &[]);
    finds("src/cli/mirror.rs", text, &[]);
}

#[test]
fn a_file_without_end_is_found() {
    finds("crates/core/base/src/time/nanos.rs", &"\n".repeat(700), &[]);
    finds(
        "crates/core/base/src/time/nanos.rs",
        &"\n".repeat(701),
        &[(701, "701 lines")],
    );
}
