//! The tick while another thread continually reads the statistics, with 4,000 BOOLs and a hosted program.
//!
//! Both access the driver as Java's threads do: the tick retries at once, the reader copies what it needs,
//! releases the driver, and only then formats the text. Rounds alternate between quiet and watched; p99.9 and
//! the maximum are medians over the rounds. Prints one `rust NAME VALUE` per line.
#![allow(missing_docs, reason = "a bench")]

use std::fmt::Write as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use tickbus::driver::Driver;
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::{Clock, Monotonic, Nanos, Pace, Stop, TimeHistogram};

/// The time between two ticks.
const TICK: Nanos = Nanos::from_micros(100);
const BITS: usize = 2_000;

fn main() {
    // `cargo bench` passes this; `cargo test` only checks that the bench runs.
    let measured = std::env::args().any(|argument| argument == "--bench");
    let (rounds, span) = if measured {
        (7, Duration::from_secs(2))
    } else {
        (1, Duration::from_millis(20))
    };
    let driver = Driver::open(config(), Monotonic::shared()).expect("opens");
    let mut slots = driver.initial_slots();
    let driver = Mutex::new(driver);
    let mut phases = [Phase::new("quiet"), Phase::new("watched")];
    let texts = AtomicU64::new(0);
    for _ in 0..rounds {
        for (phase, watched) in phases.iter_mut().zip([false, true]) {
            let over = AtomicBool::new(false);
            let ticks = std::thread::scope(|scope| {
                if watched {
                    scope.spawn(|| watch(&driver, &texts, &over));
                }
                let ticks = tick(&driver, &mut slots, span);
                over.store(true, Ordering::Relaxed);
                ticks
            });
            phase.tails.push(ticks.quantile(0.999).as_micros());
            phase.most.push(ticks.longest().as_micros());
        }
    }
    let tails = phases.each_mut().map(|phase| median(&mut phase.tails));
    for (phase, tail) in phases.iter_mut().zip(tails) {
        println!("rust {}.tick_p999_us {tail:.1}", phase.name);
        println!(
            "rust {}.tick_max_us {:.1}",
            phase.name,
            median(&mut phase.most)
        );
    }
    println!("rust watched.ratio {:.2}", tails[1] / tails[0]);
    println!("rust watched.texts {}", texts.load(Ordering::Relaxed));
}

struct Phase {
    name: &'static str,
    /// p99.9 and maximum of each round, in microseconds.
    tails: Vec<f64>,
    most: Vec<f64>,
}

impl Phase {
    fn new(name: &'static str) -> Self {
        Self {
            name,
            tails: Vec::new(),
            most: Vec::new(),
        }
    }
}

fn config() -> Config {
    let mut text = "[driver]\nid = 1\nname = \"watched\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                    scan = \"10ms\"\ncycle = \"1ms\"\n"
        .to_owned();
    for area in ['Q', 'I'] {
        for bit in 0..BITS {
            let (byte, bit) = (bit / 8, bit % 8);
            let _ = write!(
                text,
                "[[signal]]\nname = \"{area} {byte}.{bit}\"\naddress = \"%{area}X{byte}.{bit}\"\n"
            );
        }
    }
    Config::parse("driver.cfg", &text, &tickbus::KINDS).unwrap_or_else(|why| panic!("{why}"))
}

/// Reads the statistics continually.
fn watch(driver: &Mutex<Driver>, texts: &AtomicU64, over: &AtomicBool) {
    while !over.load(Ordering::Relaxed) {
        let snapshot = driver.lock().expect("no panic").snapshot();
        std::hint::black_box(snapshot.to_string());
        texts.fetch_add(1, Ordering::Relaxed);
    }
}

/// Ticks at a fixed interval for `span`; returns how long each exchange took, including the wait for the
/// driver.
fn tick(driver: &Mutex<Driver>, slots: &mut [Slot], span: Duration) -> TimeHistogram {
    let clock = Monotonic::shared();
    let (begin, stop) = (Instant::now(), Stop::new());
    let mut pace = Pace::new(clock.now(), TICK);
    let mut spans = TimeHistogram::new();
    while begin.elapsed() < span {
        if pace.take(clock.now()) {
            let begin = clock.now();
            let mut driver = loop {
                match driver.try_lock() {
                    Ok(driver) => break driver,
                    Err(_) => std::hint::spin_loop(),
                }
            };
            driver.exchange(None, slots);
            drop(driver);
            spans.record(clock.now() - begin);
        }
        clock.wait_until(pace.due(), &stop);
    }
    spans
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
