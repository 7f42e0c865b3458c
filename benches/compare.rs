//! `tickbus compare`: two recordings of an hour at 1 kHz with 200 signals, from their files to the result.
//!
//! 180 signals are BOOLs that change every two seconds, 20 are numbers that change every ten ticks. The simulated recording
//! is late by 7 ms, with jitter. Prints one `rust NAME VALUE` per line on stdout.
#![allow(missing_docs, reason = "a bench")]

#[allow(dead_code, reason = "the tests use all of it")]
#[path = "../tests/browser/samples.rs"]
mod samples;

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::time::Instant;

use samples::Random;
use tickbus::compare::{Options, Side, compare};
use tickbus::report::DEFAULT_BUDGET;

const BOOLS: usize = 180;
const NUMBERS: usize = 20;

fn main() {
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let ticks = if measured { 3_600_000 } else { 20_000 };
    let folder = tempfile::tempdir().expect("there is room for recordings");
    let [real, simulated] = [("real.vcd", 0), ("simulated.vcd", 7)].map(|(name, late)| {
        let path = folder.path().join(name);
        write(&path, ticks, late).expect("there is room for a recording");
        path
    });
    let begun = Instant::now();
    let load = |path: &Path| Side::load(path, None, DEFAULT_BUDGET).expect("it is a recording");
    let (real, simulated) = std::thread::scope(|scope| {
        let other = scope.spawn(|| load(&simulated));
        (load(&real), other.join().expect("it reads"))
    });
    let loaded = begun.elapsed();
    let begun = Instant::now();
    let found = compare(&real, &simulated, &Options::default()).expect("they fit");
    println!("rust compare.load_s {:.2}", loaded.as_secs_f64());
    println!(
        "rust compare.compare_s {:.2}",
        begun.elapsed().as_secs_f64()
    );
    println!("rust compare.likeness {:.4}", found.likeness);
    assert_eq!(found.signals.len(), BOOLS + NUMBERS);
    assert!(found.likeness > 0.9);
}

/// Writes a recording whose events are `late` by about this many ticks.
fn write(path: &Path, ticks: u64, late: u64) -> std::io::Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    writeln!(
        out,
        "$comment tickbus recording 1 $end\n$comment tick t $end\n$comment dropped d $end\n$comment status s $end"
    )?;
    for number in 0..BOOLS {
        let (byte, bit) = (number / 8, number % 8);
        writeln!(
            out,
            "$comment signal b{number} %IX{byte}.{bit} BOOL \"Bool {number}\" $end"
        )?;
    }
    for number in 0..NUMBERS {
        let byte = 100 + 4 * number;
        writeln!(
            out,
            "$comment signal n{number} %ID{byte} REAL \"Number {number}\" unit=\"mm\" $end"
        )?;
    }
    writeln!(out, "$timescale 1 ns $end\n$enddefinitions $end")?;
    let mut random = Random(late);
    // When each BOOL changes next.
    let mut next: Vec<u64> = (0..BOOLS as u64)
        .map(|number| 500 + number * 11 + late)
        .collect();
    let mut level = [false; BOOLS];
    for tick in 1..=ticks {
        writeln!(out, "#{}", tick * 1_000_000)?;
        if tick == 1 {
            writeln!(out, "b0 d\nb0 s")?;
            for number in 0..BOOLS {
                writeln!(out, "0b{number}")?;
            }
        }
        for (number, (next, level)) in next.iter_mut().zip(&mut level).enumerate() {
            if *next == tick {
                *level = !*level;
                writeln!(out, "{}b{number}", u8::from(*level))?;
                // Every recording has the same mean times; only the jitter differs.
                let round = (tick + 1000 - late) / 2000 + 1;
                *next = round * 2000 + 500 + (number as u64 * 11) % 1000 + late + random.below(4);
            }
        }
        if tick % 10 == 1 {
            for number in 0..NUMBERS {
                #[expect(clippy::cast_precision_loss, reason = "small numbers")]
                let phase = tick.saturating_sub(late) as f64 * 0.001 + number as f64;
                writeln!(out, "r{:.4} n{number}", phase.sin() * 100.0)?;
            }
        }
        writeln!(out, "b{tick:b} t")?;
    }
    writeln!(out, "$comment end \"ticks={ticks} dropped=0\" $end")?;
    out.flush()
}
