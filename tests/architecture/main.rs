//! Enforces the project's structure: rooms use only rooms above them, unsafe code and reading the system's
//! clocks are confined to certain files, and no file grows without limit.

mod rules;
mod source;

use std::fs;
use std::path::{Path, PathBuf};

use rules::{File, LEVELS, mistakes};

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

#[test]
fn the_house_is_in_order() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let sources = sources(&root.join("src"));
    assert!(sources.len() > 40, "only {} sources found", sources.len());
    let mut found = Vec::new();
    for source in sources {
        let text = fs::read_to_string(&source).expect("sources are UTF-8");
        let path = source.strip_prefix(root).expect("it is below the root");
        let path = path.to_str().expect("names are UTF-8").replace('\\', "/");
        let (path, text) = (&*path, &*text);
        found.extend(mistakes(File { path, text }));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn the_table_of_rooms_in_the_crate_docs_has_the_same_order() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("src/lib.rs")).expect("the crate has a root");
    let rows = text.lines().filter_map(|line| line.strip_prefix("//! | "));
    let cells = rows.filter_map(|row| row.split(" |").next());
    let rooms: Vec<&str> = cells
        .map(|cell| cell.trim_matches(['[', ']', '`']))
        .filter(|room| *room != "room")
        .collect();
    let levels: Vec<&str> = LEVELS
        .iter()
        .flat_map(|level| level.iter().copied())
        .collect();
    assert_eq!(rooms, levels);
}

/// Checks that exactly these lines of an imaginary file are complained about, each with a word of the
/// complaint.
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

#[test]
fn a_room_that_looks_down_is_found() {
    let up = "use crate::time::Nanos;\nuse crate::{config, signal::Plan};\n";
    finds("src/image/ring.rs", up, &[]);
    let down = [(1, "image uses plc")];
    finds("src/image/ring.rs", "use crate::plc::Scan;", &down);
    finds("src/image/mod.rs", "fn f() { crate::plc::f() }", &down);
    finds("src/image.rs", "use crate::{time, plc::{Scan, a}};", &down);
    finds(
        "src/jni/device.rs",
        "use crate::cli;",
        &[(1, "jni uses cli")],
    );
    finds(
        "src/time/nanos.rs",
        "use crate::Frame;",
        &[(1, "uses Frame")],
    );
    finds("src/attic/mod.rs", "", &[(1, "\"attic\" has no place")]);
    finds("src/lib.rs", "pub use crate::cli::run;", &[]);
}

#[test]
fn the_way_round_by_super_is_found_too() {
    let text = "use super::super::plc::Scan;\nuse super::Frame;";
    finds("src/image/ring.rs", text, &[(1, "image uses plc")]);
    finds("src/image/mod.rs", "use super::{time, plc};", &[(1, "plc")]);
    let text = "mod tests {\n use super::super::Frame;\n use super::super::super::driver::Code;\n}\n\
                use super::super::driver;";
    let found = [(3, "image uses driver"), (5, "image uses driver")];
    finds("src/image/ring.rs", text, &found);
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
    finds("src/time/mod.rs", text, &[(7, "unsafe")]);
}

#[test]
fn unsafe_code_away_from_home_is_found() {
    let text = "#![allow(unsafe_code)]\nfn f() { unsafe { g() } }";
    for home in [
        "src/jni.rs",
        "src/jni/shared.rs",
        "src/os/linux.rs",
        "src/image/triple.rs",
    ] {
        finds_no_unsafe(home, text);
    }
    finds("src/image/ring.rs", text, &[(2, "unsafe code")]);
    finds(
        "src/jnix/mod.rs",
        text,
        &[(1, "no place"), (2, "unsafe code")],
    );
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
    finds("src/driver/open.rs", text, &found);
    let text = "use opcua_types::DateTime;\n\
                fn f() { DateTime::now(); }\n\
                fn g() { chrono::Utc::now(); Self::now(); clock.now(); yield_now() }\n\
                fn h() { time::OffsetDateTime::now_utc(); thread::yield_now(); }";
    let found = [(2, "DateTime::now"), (3, "Utc::now"), (4, "now_utc")];
    finds("src/fieldbus/opcua/pki.rs", text, &found);
    finds("src/time/clock.rs", text, &[]);
    finds("src/cli/mirror.rs", text, &[]);
}

#[test]
fn a_file_without_end_is_found() {
    finds("src/time/nanos.rs", &"\n".repeat(700), &[]);
    finds(
        "src/time/nanos.rs",
        &"\n".repeat(701),
        &[(701, "701 lines")],
    );
}
