//! The neighbours of the drivers against their models: seeds that once broke a promise, and fresh ones.
#![allow(missing_docs, reason = "tests")]

use tickbus_base::time::{Clock as _, Monotonic, Nanos};
use tickbus_worlds::{Neighbour, Seed};

/// The time for fresh seeds of each neighbour, in seconds, unless `TICKBUS_WORLDS_SECONDS` says otherwise.
const SECONDS: u32 = 3;

#[track_caller]
fn passes(neighbour: Neighbour, seed: Seed) {
    if let Err(broken) = neighbour.run(seed, &mut Vec::new()) {
        let small = neighbour.shrunk(seed, broken.promise);
        panic!(
            "{broken}\nin the {neighbour} {seed}; smaller: cargo run --release -p tickbus-worlds -- {neighbour} {small}\nOnce \
             mended, add it to crates/tools/worlds/neighbours.txt."
        );
    }
}

#[test]
fn what_was_broken_once_is_whole() {
    let mut count = 0;
    for line in include_str!("../neighbours.txt").lines() {
        if let Some((neighbour, seed)) = line.split_once(' ').filter(|_| !line.starts_with('#')) {
            passes(
                neighbour.parse().expect("a neighbour"),
                seed.parse().expect("a seed"),
            );
            count += 1;
        }
    }
    assert!(count > 0, "the corpus is empty");
}

#[test]
fn the_same_seed_is_the_same_run() {
    for neighbour in Neighbour::ALL {
        for seed in 0..20_u64 {
            let mut traces = [Vec::new(), Vec::new()];
            for trace in &mut traces {
                assert_eq!(
                    neighbour.run(seed.into(), trace),
                    Ok(()),
                    "{neighbour} {seed}"
                );
            }
            assert!(
                traces[0].len() > 5,
                "nothing happens in the {neighbour} {seed}"
            );
            assert_eq!(traces[0], traces[1], "{neighbour} {seed}");
        }
    }
}

#[test]
fn fresh_ones_keep_all_promises() {
    let seconds = std::env::var("TICKBUS_WORLDS_SECONDS");
    let seconds = seconds.map_or(SECONDS, |text| text.parse().expect("whole seconds"));
    let clock = Monotonic::shared();
    for neighbour in Neighbour::ALL {
        // Every run takes other seeds, and prints the first.
        let first = u64::from(std::process::id()) << 32;
        println!("{neighbour} from {first} on");
        let begun = clock.now();
        let mut seed = first;
        while clock.now() - begun < Nanos::from_secs(seconds.into()) {
            passes(neighbour, seed.into());
            seed += 1;
        }
        println!("{} times", seed - first);
        assert!(seed > first, "no {neighbour} was drawn");
    }
}
