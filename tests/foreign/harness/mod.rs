//! A harness for tests in which the other end is third-party software.
//!
//! If such a program is not installed, its test is skipped and reported by name and reason, which Rust's
//! harness cannot do at run time. A test target that uses this one sets `harness = false` in Cargo.toml.
//! `make test` installs the programs (`tools/peers`).
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

pub mod iec2c;
pub mod machine;
#[path = "../../peers/pcap.rs"]
pub mod pcap;
pub mod recorder;
pub mod session;

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::process::{Command, ExitCode, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The program at the other end is not installed; the text says which one, and how to get it.
#[derive(Debug)]
pub struct Absent(pub String);

/// A test panics when it fails.
pub type Test = fn() -> Result<(), Absent>;

/// The number of tests that run at once: they mostly wait for their peers.
const AT_ONCE: usize = 5;

/// Runs the tests selected on the command line. Each group has a name, and its tests theirs.
pub fn main(groups: &[(&str, &[(&str, Test)])]) -> ExitCode {
    let named = |(group, tests): &(&str, &[(&str, Test)])| {
        let name = |(name, test): &(&str, Test)| (format!("{group}::{name}"), *test);
        tests.iter().map(name).collect::<Vec<_>>()
    };
    let tests: Vec<_> = groups.iter().flat_map(named).collect();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.iter().any(|argument| argument == "--list") {
        for (name, _) in &tests {
            println!("{name}: test");
        }
        println!("\n{} tests, 0 benchmarks", tests.len());
        return ExitCode::SUCCESS;
    }
    let filters: Vec<_> = arguments
        .iter()
        .filter(|one| !one.starts_with('-'))
        .collect();
    let is_asked = |name: &str| {
        filters.is_empty() || filters.iter().any(|filter| name.contains(filter.as_str()))
    };
    let asked: Vec<_> = tests.iter().filter(|(name, _)| is_asked(name)).collect();
    println!("\nrunning {} tests", asked.len());
    let counts = [const { AtomicUsize::new(0) }; 3];
    let next = AtomicUsize::new(0);
    let work = || {
        while let Some((name, test)) = asked.get(next.fetch_add(1, Ordering::Relaxed)) {
            let (count, verdict) = match catch_unwind(AssertUnwindSafe(test)) {
                Ok(Ok(())) => (0, "ok".to_owned()),
                Ok(Err(Absent(why))) => (2, format!("ignored, {why}")),
                Err(panic) => (1, format!("FAILED\n{}", words(&*panic))),
            };
            counts[count].fetch_add(1, Ordering::Relaxed);
            println!("test {name} ... {verdict}");
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(work);
        }
    });
    let [passed, failed, ignored] = counts.map(AtomicUsize::into_inner);
    let verdict = if failed == 0 { "ok" } else { "FAILED" };
    println!(
        "\ntest result: {verdict}. {passed} passed; {failed} failed; {ignored} ignored; 0 measured; {} \
         filtered out\n",
        tests.len() - asked.len()
    );
    ExitCode::from(u8::from(failed > 0))
}

fn words(panic: &(dyn Any + Send)) -> &str {
    let owned = panic.downcast_ref::<String>().map(String::as_str);
    owned
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("it panicked")
}

/// A Python with all of `modules`: from the environment `name` under target/peers, or the system's.
pub fn python_with(name: &str, modules: &[&str]) -> Result<Command, Absent> {
    let own =
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("target/peers/{name}/bin/python"));
    // Not imported, which takes some of them seconds.
    let find = "import sys, importlib.util as u; sys.exit(not all(map(u.find_spec, sys.argv[1:])))";
    for python in [own, PathBuf::from("python3")] {
        let tried = Command::new(&python)
            .args(["-c", find])
            .args(modules)
            .stderr(Stdio::null())
            .status();
        if tried.is_ok_and(|status| status.success()) {
            return Ok(Command::new(python));
        }
    }
    Err(Absent(format!(
        "no Python has {}; run tools/peers",
        modules.join(" and ")
    )))
}

/// A command from the Debian package `package`.
pub fn command(name: &str, package: &str) -> Result<Command, Absent> {
    command_with(name, "--version", package)
}

/// A command from the Debian package `package` that only prints something when it gets `argument`.
pub fn command_with(name: &str, argument: &str, package: &str) -> Result<Command, Absent> {
    let found = Command::new(name)
        .arg(argument)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    match found {
        Ok(_) => Ok(Command::new(name)),
        Err(_) => Err(Absent(format!(
            "there is no {name} (apt-get install {package})"
        ))),
    }
}

/// The text after `before` in its line of a file of this repository: the version of a program at the other end.
pub fn stated(file: &str, before: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(file);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|why| panic!("{file}: {why}"));
    let found = text.lines().find_map(|line| line.split_once(before));
    let (_, rest) = found.unwrap_or_else(|| panic!("no {before} in {file}"));
    let end = rest.find(['"', '<']).unwrap_or(rest.len());
    rest[..end].trim().to_owned()
}
