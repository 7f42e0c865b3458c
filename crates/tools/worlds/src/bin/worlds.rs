//! Simulated worlds from the command line.
//!
//! - `worlds SEED` repeats one world, with everything that its drivers log.
//! - `worlds FIRST SECONDS` runs fresh worlds from that seed on, and shrinks those that break a promise.
//! - `worlds all FIRST SECONDS PAGE` does so on all processors, and writes an HTML file with the pairs of features that
//!   have met and the findings.
//! - `worlds traces FIRST COUNT` prints one number for all that happens in COUNT worlds, the same on every machine.
//!
//! FIRST may be a seed with masks, such as `4711:3ff:ff`: the worlds then have no features beyond those of the masks.
//! The name of a neighbour before the arguments of the first two, as in `worlds board SEED`, runs that neighbour.

use std::num::NonZero;
use std::process::ExitCode;

use tickbus_base::time::{Clock, Monotonic, Nanos};
use tickbus_worlds::{Finding, Neighbour, Page, Plan, Run, Seed};

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

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let texts: Vec<&str> = arguments.iter().map(String::as_str).collect();
    if let Some((name, rest)) = texts.split_first()
        && let Ok(neighbour) = name.parse()
    {
        return of_neighbour(neighbour, rest);
    }
    match *texts {
        [seed] => match seed.parse() {
            Ok(seed) => one(seed),
            Err(why) => usage(&why),
        },
        [first, seconds] => match (first.parse(), seconds.parse::<u32>()) {
            (Ok(first), Ok(seconds)) => many(first, Nanos::from_secs(seconds.into())),
            (Err(why), _) => usage(&why),
            _ => usage("SECONDS is a whole number"),
        },
        ["all", first, seconds, page] => match (first.parse(), seconds.parse::<u32>()) {
            (Ok(first), Ok(seconds)) => all(first, Nanos::from_secs(seconds.into()), page),
            (Err(why), _) => usage(&why),
            _ => usage("SECONDS is a whole number"),
        },
        ["traces", first, count] => match (first.parse::<u64>(), count.parse::<u32>()) {
            (Ok(first), Ok(count)) => traces(first, count),
            _ => usage("FIRST and COUNT are whole numbers"),
        },
        _ => usage("one seed, or two numbers, are expected"),
    }
}

fn usage(why: &str) -> ExitCode {
    eprintln!(
        "worlds: {why}\nusage: worlds [board|lockstep] SEED\n       worlds [board|lockstep] FIRST SECONDS\n       worlds all FIRST SECONDS PAGE\n       worlds traces FIRST COUNT"
    );
    ExitCode::from(2)
}

fn one(seed: Seed) -> ExitCode {
    // This is the only logger of the process.
    let _ = log::set_logger(&Log);
    log::set_max_level(log::LevelFilter::Trace);
    let plan = Plan::draw(seed);
    println!("{plan:#?}");
    for end in 0..2 {
        println!("{}", plan.driver_cfg(end, "link"));
    }
    match plan.run() {
        Ok(()) => {
            println!("worlds: ok seed={seed}");
            ExitCode::SUCCESS
        }
        Err(broken) => {
            println!("worlds: failed seed={seed} {broken}");
            ExitCode::FAILURE
        }
    }
}

fn traces(first: u64, count: u32) -> ExitCode {
    let mut seed = Seed::from(first);
    // FNV-1a, which gives the same result on every machine.
    let mut hash = 0xCBF2_9CE4_8422_2325_u64;
    for _ in 0..count {
        for byte in Plan::draw(seed).trace().bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01B3);
        }
        seed = seed.next();
    }
    println!("worlds={count} first={first} traces={hash:016x}");
    ExitCode::SUCCESS
}

fn many(first: Seed, limit: Nanos) -> ExitCode {
    let clock = Monotonic::shared();
    let begun = clock.now();
    let run = Run::on_one(first, limit, &*clock, &print);
    last_line(&run, first, seconds_since(&*clock, begun), "");
    verdict(&run)
}

/// Runs worlds on all processors, and writes a page.
fn all(first: Seed, limit: Nanos, path: &str) -> ExitCode {
    let clock = Monotonic::shared();
    let processors = std::thread::available_parallelism().map_or(1, NonZero::get);
    let begun = clock.now();
    let run = Run::on_all(first, limit, processors, &*clock, &print);
    let seconds = seconds_since(&*clock, begun);
    let commit = std::env::var("TICKBUS_WORLDS_COMMIT").ok();
    let page = Page {
        run: &run,
        first: first.number,
        seconds,
        processors,
        commit: commit.as_deref(),
    };
    last_line(&run, first, seconds, &format!(" page={path}"));
    if let Err(why) = std::fs::write(path, page.html()) {
        eprintln!("worlds: {path} cannot be written: {why}");
        return ExitCode::FAILURE;
    }
    verdict(&run)
}

fn print(finding: &Finding) {
    println!("{finding}");
}

fn seconds_since(clock: &dyn Clock, begun: Nanos) -> f64 {
    (clock.now() - begun).to_duration().as_secs_f64()
}

fn last_line(run: &Run, first: Seed, seconds: f64, rest: &str) {
    #[expect(clippy::cast_precision_loss, reason = "a rate for people")]
    let rate = run.worlds as f64 / seconds;
    println!(
        "worlds={} failed={} first={} per_second={rate:.0} pairs={}{rest}",
        run.worlds,
        run.findings.len(),
        first.number,
        run.pairs.met()
    );
}

fn verdict(run: &Run) -> ExitCode {
    if run.findings.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

fn of_neighbour(neighbour: Neighbour, texts: &[&str]) -> ExitCode {
    match *texts {
        [seed] => match seed.parse() {
            Ok(seed) => one_of(neighbour, seed),
            Err(why) => usage(&why),
        },
        [first, seconds] => match (first.parse::<u64>(), seconds.parse::<u32>()) {
            (Ok(first), Ok(seconds)) => many_of(neighbour, first, Nanos::from_secs(seconds.into())),
            _ => usage("FIRST and SECONDS are whole numbers"),
        },
        _ => usage("one seed, or two numbers, are expected"),
    }
}

fn one_of(neighbour: Neighbour, seed: Seed) -> ExitCode {
    let mut trace = Vec::new();
    let outcome = neighbour.run(seed, &mut trace);
    for line in trace {
        println!("{line}");
    }
    match outcome {
        Ok(()) => {
            println!("{neighbour}: ok seed={seed}");
            ExitCode::SUCCESS
        }
        Err(broken) => {
            println!("{neighbour}: failed seed={seed} {broken}");
            ExitCode::FAILURE
        }
    }
}

fn many_of(neighbour: Neighbour, first: u64, limit: Nanos) -> ExitCode {
    let clock = Monotonic::shared();
    let begun = clock.now();
    let (mut runs, mut failed) = (0, 0);
    while clock.now() - begun < limit {
        let seed = Seed::from(first.wrapping_add(runs));
        runs += 1;
        if let Err(broken) = neighbour.run(seed, &mut Vec::new()) {
            failed += 1;
            let small = neighbour.shrunk(seed, broken.promise);
            println!("{broken}\n  seed {seed}; smaller:\n  worlds {neighbour} {small}");
        }
    }
    println!("{neighbour}: runs={runs} failed={failed} first={first}");
    if failed > 0 {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    }
}
