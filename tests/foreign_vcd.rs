//! Recordings under the eyes of readers that others wrote.
//!
//! It has its own main function: where the readers are not installed the test is skipped, and says so by name
//! and reason, which the harness of Rust cannot do at run time. `make test` installs them.
#![allow(missing_docs, reason = "a test")]

use std::path::Path;
use std::process::{Command, ExitCode};

use tickbus::driver::{Config, Driver};
use tickbus::signal::{Area, Slot};
use tickbus::time::{Manual, Nanos};

const NAME: &str = "readers_that_others_wrote_read_the_same_from_vcd_and_csv";

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/read_vcd.py");

const PYTHON: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/target/venv/bin/python");

/// What the script says with its exit code when a reader is not there.
const MISSING: i32 = 77;

/// Beside the rig's signals: one of each other kind, with names that VCD does not allow.
const MORE: &str = r#"
[[signal]]
name    = "2 Förderband, \"links\""
address = "%ID8"
type    = "REAL"

[[signal]]
name    = "signed"
address = "%IL16"
type    = "LINT"

[[signal]]
name    = "unsigned"
address = "%IL24"
"#;

fn main() -> ExitCode {
    // Asked for by name, or by none: what the harness of Rust would do.
    let asked: Vec<String> = std::env::args().skip(1).collect();
    let names = asked.iter().filter(|argument| !argument.starts_with('-'));
    if asked.iter().any(|argument| argument == "--list") {
        println!("{NAME}: test");
        return ExitCode::SUCCESS;
    }
    if !names.clone().all(|name| NAME.contains(name.as_str())) {
        return ExitCode::SUCCESS;
    }
    println!("\nrunning 1 test");
    let outcome = run();
    let (verdict, counts) = match &outcome {
        Ok(None) => ("ok".to_owned(), "ok. 1 passed; 0 failed; 0 ignored"),
        Ok(Some(why)) => (
            format!("ignored, {why}"),
            "ok. 0 passed; 0 failed; 1 ignored",
        ),
        Err(why) => (
            format!("FAILED\n{why}"),
            "FAILED. 0 passed; 1 failed; 0 ignored",
        ),
    };
    println!("test {NAME} ... {verdict}\n\ntest result: {counts}; 0 measured; 0 filtered out\n");
    ExitCode::from(u8::from(outcome.is_err()))
}

/// Records the same run twice, and has both files read; why it was skipped, if it was.
fn run() -> Result<Option<String>, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    record(folder.path(), "run.vcd");
    record(folder.path(), "run.csv");
    let python = if Path::new(PYTHON).exists() {
        PYTHON
    } else {
        "python3"
    };
    let output = Command::new(python)
        .arg(SCRIPT)
        .args([folder.path().join("run.vcd"), folder.path().join("run.csv")])
        .output();
    let Ok(output) = output else {
        return Ok(Some("there is no python3".to_owned()));
    };
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    let (told, complaint) = (text(&output.stdout), text(&output.stderr));
    match output.status.code() {
        Some(0) if told.contains("read_vcd: ok ticks=500 variables=") => Ok(None),
        Some(MISSING) => Ok(Some(told)),
        _ => Err(format!("{told}\n{complaint}")),
    }
}

fn record(folder: &Path, file: &str) {
    let rig = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/driver.cfg"))
        .expect("the rig's driver.cfg");
    let signals = &rig[rig.find("[[signal]]").expect("signals")..];
    let text = format!(
        "[driver]\nid = 1\nname = \"Test rig\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"rig\"\n\
         mode = \"stepped\"\n[record]\nfile = \"{file}\"\n{signals}{MORE}"
    );
    let path = folder.join("driver.cfg");
    let config = Config::parse(path.to_str().expect("UTF-8"), &text)
        .unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let mut driver = Driver::open(config, Manual::new()).expect("opens");
    let mut slots = driver.initial_slots();
    let table = driver.config().table.clone();
    let mut random = 1_u64;
    for tick in 1..=500 {
        for (slot, signal) in slots.iter_mut().zip(&table.signals) {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            if signal.area == Area::Input && random >> 61 == 0 {
                *slot = match signal.name.as_str() {
                    "signed" | "unsigned" => Slot(random),
                    "2 Förderband, \"links\"" => Slot::from_real(1.0 / f64::from(tick - 250)),
                    _ if random.is_multiple_of(50) => Slot::from_real(f64::NAN),
                    _ => Slot::from_real(f64::from(u8::from(random & 1024 != 0))),
                };
            }
        }
        driver.exchange(Nanos::from_millis(i64::from(2 * tick)), &mut slots);
    }
    driver.close();
}
