//! Runs worlds: `worlds SEED` one of them, `worlds SEED COUNT` so many from that seed on.

use std::time::Instant;

use tickbus_worlds::Plan;

/// Prints what the drivers log.
struct Log;

impl log::Log for Log {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &log::Record<'_>) {
        println!("{} {}", record.level(), record.args());
    }

    fn flush(&self) {}
}

fn main() {
    let numbers: Vec<u64> = std::env::args()
        .skip(1)
        .map(|text| text.parse().expect("a number"))
        .collect();
    let first = numbers.first().copied().unwrap_or(0);
    let count = numbers.get(1).copied().unwrap_or(1);
    let begun = Instant::now();
    let mut failed = 0;
    for seed in first..first + count {
        let plan = Plan::draw(seed);
        if count == 1 {
            let _ = log::set_logger(&Log);
            log::set_max_level(log::LevelFilter::Trace);
            println!("{plan:#?}\n{}", plan.driver_cfg(0, "link"));
        }
        if let Err(broken) = plan.run() {
            failed += 1;
            println!("seed {seed}: {:?}: {broken}", plan.features());
        }
    }
    let span = begun.elapsed().as_secs_f64();
    println!("worlds={count} failed={failed} seconds={span:.2}");
}
