//! Recording: its cost to the tick, and the speed of a replay.
//!
//! The rig's 16 latched bits in each direction. Ticks are timed in batches, alternately with and without a
//! recorder, with a pause after each batch in which the recorder writes; the results are medians over the
//! batches. Then a stepped run of a million ticks, with some changes in each, is recorded and replayed.
//! Prints one `rust NAME VALUE` per line on stdout.
#![allow(missing_docs, reason = "a bench")]

mod signals;

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::{Monotonic, Nanos};

/// The extent of the measurement.
struct Extent {
    batches: usize,
    ticks: i64,
}

/// Ticks timed together; far fewer than the ring holds.
const BATCH: i64 = 256;

fn main() {
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let extent = if measured {
        Extent {
            batches: 2_000,
            ticks: 1_000_000,
        }
    } else {
        Extent {
            batches: 2,
            ticks: 1_000,
        }
    };
    let folder = tempfile::tempdir().expect("a folder");
    for mode in ["free", "stepped"] {
        tick(&extent, folder.path(), mode);
    }
    for format in ["vcd", "csv"] {
        replay(&extent, folder.path(), format);
    }
}

fn open(folder: &Path, fieldbus: &str, record: &str) -> Driver {
    let mut text = format!(
        "[driver]\nid = 1\nname = \"bench\"\n[fieldbus]\nkind = \"loopback\"\n{fieldbus}\n"
    );
    if !record.is_empty() {
        let _ = write!(text, "[record]\nfile = \"{record}\"\n");
    }
    text += &signals::latched_bits();
    let path = folder.join("driver.cfg");
    let config = Config::parse(path.to_str().expect("UTF-8"), &text, &tickbus::KINDS)
        .unwrap_or_else(|why| panic!("{why}"));
    let clock = Monotonic::shared();
    Driver::open(config, Arc::clone(&clock) as _).unwrap_or_else(|why| panic!("{why}"))
}

/// A driver with its slots and its time.
struct Run {
    driver: Driver,
    slots: Vec<Slot>,
    time: Nanos,
}

impl Run {
    fn new(driver: Driver) -> Self {
        let slots = driver.initial_slots();
        Self {
            driver,
            slots,
            time: Nanos::ZERO,
        }
    }

    /// One tick in which one of the sixteen values changes.
    fn tick(&mut self) {
        self.time += Nanos::from_millis(1);
        let bit = 16 + usize::try_from(self.time.0 / 1_000_000 % 16).expect("small");
        self.slots[bit] = Slot::from_real(1.0 - self.slots[bit].real());
        black_box(self.driver.exchange(self.time, &mut self.slots));
    }

    fn statistic(&self, key: &str) -> u64 {
        let text = self.driver.statistics();
        let found = text.lines().find_map(|line| line.strip_prefix(key));
        found
            .and_then(|value| value.strip_prefix('=')?.parse().ok())
            .expect("a count")
    }
}

fn tick(extent: &Extent, folder: &Path, mode: &str) {
    let bus = format!("program = \"mirror\"\nscan = \"1ms\"\ncycle = \"1ms\"\nmode = \"{mode}\"");
    let mut runs = ["", "run.vcd"].map(|record| Run::new(open(folder, &bus, record)));
    let mut spans = [const { Vec::<f64>::new() }; 2];
    for _ in 0..extent.batches {
        for (run, spans) in runs.iter_mut().zip(&mut spans) {
            let begun = Instant::now();
            for _ in 0..BATCH {
                run.tick();
            }
            let nanos = begun.elapsed().as_nanos();
            #[expect(clippy::cast_precision_loss, reason = "below a second")]
            spans.push(nanos as f64 / BATCH as f64);
            // The recorder polls its ring every 5 ms.
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    let [off, on] = spans.map(|mut spans| {
        spans.sort_by(f64::total_cmp);
        spans[spans.len() / 2]
    });
    println!("rust record.{mode}.off_ns {off:.1}");
    println!("rust record.{mode}.on_ns {on:.1}");
    println!(
        "rust record.{mode}.dropped {}",
        runs[1].statistic("record.dropped")
    );
}

fn replay(extent: &Extent, folder: &Path, format: &str) {
    let file = format!("long.{format}");
    let bus = "program = \"mirror\"\nscan = \"1ms\"\nmode = \"stepped\"";
    let mut run = Run::new(open(folder, bus, &file));
    let begun = Instant::now();
    for _ in 0..extent.ticks {
        run.tick();
    }
    run.driver.close();
    println!(
        "rust record.{format}.write_s {:.2}",
        begun.elapsed().as_secs_f64()
    );
    let bytes = std::fs::metadata(folder.join(&file))
        .expect("the recording")
        .len();
    println!("rust record.{format}.mib {}", bytes >> 20);
    let mut run = Run::new(open(folder, &format!("replay = \"{file}\""), ""));
    let begun = Instant::now();
    let mut early = None;
    for tick in 0..extent.ticks {
        run.tick();
        if tick == extent.ticks / 10 {
            early = resident();
        }
    }
    println!(
        "rust replay.{format}.s {:.2}",
        begun.elapsed().as_secs_f64()
    );
    let growth = resident()
        .zip(early)
        .map_or(-1, |(late, early)| late - early);
    println!("rust replay.{format}.growth_kib {growth}");
    println!(
        "rust replay.{format}.differences {}",
        run.statistic("replay.differences")
    );
    assert_eq!(run.statistic("replay.ticks"), extent.ticks.unsigned_abs());
}

/// Memory of this process in KiB, if the system tells.
fn resident() -> Option<i64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().trim_end_matches(" kB").parse().ok()
}
