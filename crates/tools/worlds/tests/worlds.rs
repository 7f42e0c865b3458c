//! Worlds that once broke a promise, and fresh ones.
#![allow(missing_docs, reason = "tests")]

use std::path::Path;
use std::process::Command;

use tickbus_base::time::{Clock as _, Monotonic, Nanos};
use tickbus_base::toml_text::{Collector, read_text};
use tickbus_worlds::{Pairs, Plan, Seed};

/// The time for fresh worlds, in seconds, unless `TICKBUS_WORLDS_SECONDS` says otherwise.
const SECONDS: u32 = 30;

#[track_caller]
fn passes(seed: Seed) {
    if let Err(broken) = Plan::draw(seed).run() {
        let small = seed.shrunk(broken.promise);
        panic!(
            "{broken}\nin the world {seed}; smaller: cargo run --release -p tickbus-worlds -- {small}\nOnce mended, add it to \
             crates/tools/worlds/corpus.txt."
        );
    }
}

#[test]
fn what_was_broken_once_is_whole() {
    let mut count = 0;
    for line in include_str!("../corpus.txt").lines() {
        if !line.starts_with('#') {
            passes(line.parse().expect("a seed"));
            count += 1;
        }
    }
    assert!(count > 0, "the corpus has no world");
}

#[test]
fn the_same_seed_is_the_same_world() {
    for seed in 0..20_u64 {
        let plan = Plan::draw(seed);
        let first = plan.trace();
        assert!(!first.is_empty(), "nothing happens in the world {seed}");
        assert_eq!(first, plan.trace(), "the world {seed}");
    }
}

/// Nothing of the computer shows in a world: not where the system puts its memory, which differs from process to
/// process, nor the seeds of hash tables, nor the environment. The test keeps no number, since each change of the
/// product would change it; `worlds traces` prints it, for other machines to compare.
#[test]
fn another_process_has_the_same_worlds() {
    let traces = |setting: &mut dyn FnMut(&mut Command)| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_worlds"));
        command.args(["traces", "4711", "200"]).env_clear();
        setting(&mut command);
        let output = command.output().expect("worlds runs");
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).expect("text")
    };
    let first = traces(&mut |_| {});
    assert!(
        first.starts_with("worlds=200 first=4711 traces="),
        "{first}"
    );
    let folder = std::env::temp_dir();
    let other = traces(&mut |command| {
        // A long environment moves the stack.
        command
            .env("LANG", "tr_TR.UTF-8")
            .env("TZ", "Asia/Kathmandu");
        command
            .env("TICKBUS_LOG", "debug")
            .env("LONG", "x".repeat(100_000));
        command.current_dir(&folder);
    });
    assert_eq!(first, other);
}

/// `tools/mutants` puts the mutants into the code; this test only checks that they fit.
#[test]
fn every_mutant_fits_the_code() {
    let list = include_str!("../mutants/mutants.toml");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..");
    let mut collector = Collector::new("mutants.toml", list);
    let mutants = read_text(&mut collector, list, |mut root| {
        let tables = root.take("mutant")?.tables("[[mutant]]");
        let mutants = tables.into_iter().map(|mut table| {
            let mut text = |key| Some(table.take(key)?.text("write a text")?.to_owned());
            Some((text("name")?, text("file")?, text("old")?, text("new")?))
        });
        mutants.collect::<Option<Vec<_>>>()
    });
    let mutants = mutants.expect("a list of mutants");
    assert!(mutants.len() >= 20, "{} mutants", mutants.len());
    for (name, file, old, new) in mutants {
        let code = std::fs::read_to_string(root.join(&file)).expect("a file of the code");
        assert_eq!(
            code.matches(&old).count(),
            1,
            "{name}: change \"old\" as {file} has changed"
        );
        assert!(new.contains("MUTANT"), "{name}");
    }
}

#[test]
fn fresh_worlds_keep_all_promises() {
    let seconds = std::env::var("TICKBUS_WORLDS_SECONDS");
    let seconds = seconds.map_or(SECONDS, |text| text.parse().expect("whole seconds"));
    let clock = Monotonic::shared();
    // Every run takes other seeds, and prints the first.
    let first = u64::from(std::process::id()) << 32;
    println!("worlds from {first} on");
    let begun = clock.now();
    let (mut seed, mut worlds, mut pairs) = (Seed::from(first), 0, Pairs::default());
    while clock.now() - begun < Nanos::from_secs(seconds.into()) {
        pairs.add(&Plan::draw(seed));
        passes(seed);
        (seed, worlds) = (seed.next(), worlds + 1);
    }
    println!("{worlds} worlds, {} pairs of features", pairs.met());
    assert!(worlds > 0, "no world was drawn");
}
