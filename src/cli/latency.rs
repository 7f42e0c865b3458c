//! `tickbus latency`: how late this computer wakes a thread, and which cycle it can keep.

use std::fmt::Write as _;
use std::thread;

use serde_json::{Value, json};

use super::host::span;
use super::json::{Format, print_document};
use super::{Outcome, print};
use tickbus_base::RealTime;
use tickbus_base::os::wake_on_time;
use tickbus_base::time::{Clock, Monotonic, Nanos, Stop, TimeHistogram};

/// Measure how late this computer wakes a bus thread, without and with the real-time class.
///
/// Both measurements take as long as --seconds says, one after the other. Run it beside the load that the computer will have:
/// an idle computer keeps any cycle. The result names the shortest sensible cycle: five times as long as the lateness that
/// only one wake-up in 10,000 exceeds, and no shorter than the worst. docs/real-time.md tells what to do about a long one.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// How long each of the two measurements takes.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=3600))]
    seconds: u16,

    /// The time from one wake-up to the next.
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = span)]
    interval: Nanos,

    /// The priority in the real-time class.
    #[arg(long, value_name = "1-99", default_value_t = 50, value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: u8,

    /// The only processor for the second measurement.
    #[arg(long, value_name = "N")]
    cpu: Option<u16>,

    /// Lock the memory of the process for the second measurement.
    #[arg(long)]
    lock_memory: bool,

    #[command(flatten)]
    format: Format,
}

/// How often the shortest sensible cycle is as long as the lateness that one wake-up in 10,000 exceeds.
const MARGIN: i64 = 5;

/// One measurement.
struct Run {
    real_time: Option<RealTime>,
    lateness: TimeHistogram,
    refused: Vec<String>,
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let real_time = RealTime {
        priority: Some(arguments.priority),
        cpu: arguments.cpu,
        lock_memory: arguments.lock_memory,
        required: false,
    };
    let lasts = Nanos::from_secs(arguments.seconds.into());
    if arguments.interval > lasts {
        let why = "latency: --interval is longer than --seconds: no wake-up would be measured";
        return arguments.format.fail("latency", why, Outcome::Usage);
    }
    let mut runs = Vec::new();
    for real_time in [None, Some(real_time)] {
        let interval = arguments.interval;
        // Each on a new thread, which has the usual class.
        let run = thread::spawn(move || measure(real_time, interval, lasts)).join();
        runs.extend(run);
    }
    let outcome = if arguments.format.is_json() {
        let list: Vec<Value> = runs.iter().map(document).collect();
        let interval = arguments.interval.0;
        print_document("latency", json!({ "interval_ns": interval, "runs": list }))
    } else {
        print("latency", &table(&runs, arguments))
    };
    for refusal in runs.iter().flat_map(|run| &run.refused) {
        eprintln!("latency: {refusal}");
    }
    outcome
}

/// Wakes up every `interval` for as long as `lasts`, and notes how late.
fn measure(real_time: Option<RealTime>, interval: Nanos, lasts: Nanos) -> Run {
    wake_on_time();
    let refused = real_time.map(RealTime::apply);
    let (clock, stop) = (Monotonic::shared(), Stop::new());
    let mut lateness = TimeHistogram::new();
    let begin = clock.now();
    let mut deadline = begin + interval;
    while deadline - begin <= lasts {
        clock.wait_until(deadline, &stop);
        let now = clock.now();
        lateness.record(now - deadline);
        // Wake-ups that were slept through are not made up for.
        let missed = (now - deadline).0 / interval.0;
        deadline += interval.times(missed + 1);
    }
    Run {
        real_time,
        lateness,
        refused: refused.unwrap_or_default(),
    }
}

/// The shortest sensible cycle: the next of 1, 2 and 5 with its zeros, from 100 µs on.
fn shortest_cycle(lateness: &TimeHistogram) -> Nanos {
    let rare = lateness.quantile(0.9999).times(MARGIN);
    let least = rare.max(lateness.longest());
    let mut decade = Nanos::from_micros(100);
    loop {
        for step in [1, 2, 5] {
            let cycle = decade.times(step);
            if cycle >= least {
                return cycle;
            }
        }
        decade = decade.times(10);
    }
}

fn name(run: &Run) -> String {
    let Some(real_time) = run.real_time else {
        return "usual class".to_owned();
    };
    let refused = if run.refused.is_empty() {
        ""
    } else {
        " (refused)"
    };
    format!("{real_time}{refused}")
}

/// The figures of a measurement: median, p99, p99.99, worst.
fn figures(run: &Run) -> [Nanos; 4] {
    let of = |share| run.lateness.quantile(share);
    [of(0.5), of(0.99), of(0.9999), run.lateness.longest()]
}

fn document(run: &Run) -> Value {
    let [median, p99, rare, worst] = figures(run);
    json!({
        "real_time": run.real_time.map(|real_time| real_time.to_string()),
        "refused": run.refused,
        "wake_ups": run.lateness.count(),
        "p50_ns": median.0,
        "p99_ns": p99.0,
        "p99_99_ns": rare.0,
        "worst_ns": worst.0,
        "cycle_ns": shortest_cycle(&run.lateness).0,
    })
}

fn table(runs: &[Run], arguments: &Arguments) -> String {
    let title = format!("late, in us, every {}", arguments.interval);
    let mut text = format!(
        "{title:44}{:>10}{:>10}{:>10}{:>10}{:>12}\n",
        "median", "p99", "p99.99", "worst", "cycle"
    );
    // Writing to a String cannot fail.
    for run in runs {
        let (name, cycle) = (name(run), shortest_cycle(&run.lateness).to_string());
        let [median, p99, rare, worst] = figures(run).map(Nanos::as_micros);
        let _ = writeln!(
            text,
            "{name:44}{median:>10.1}{p99:>10.1}{rare:>10.1}{worst:>10.1}{cycle:>12}"
        );
    }
    text.push_str(
        "cycle: the shortest sensible one, 5 x p99.99 and no less than the worst\nlatency: ok",
    );
    let ends = ["", "_real_time"].iter().zip(runs);
    for (end, run) in ends.filter(|(_, run)| run.refused.is_empty()) {
        let _ = write!(text, " cycle{end}={}", shortest_cycle(&run.lateness));
    }
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn late(usual: i64, worst: i64) -> TimeHistogram {
        let mut lateness = TimeHistogram::new();
        lateness.record_times(Nanos::from_micros(usual), 99_999);
        lateness.record(Nanos::from_micros(worst));
        lateness
    }

    #[test]
    fn the_cycle_is_five_times_the_rare_lateness_and_no_less_than_the_worst() {
        let cycle = |usual, worst| shortest_cycle(&late(usual, worst));
        assert_eq!(cycle(1, 2), Nanos::from_micros(100));
        assert_eq!(cycle(60, 90), Nanos::from_micros(500));
        assert_eq!(cycle(250, 260), Nanos::from_millis(2));
        assert_eq!(cycle(60, 4_000), Nanos::from_millis(5), "the worst counts");
    }

    #[test]
    fn a_measurement_wakes_up_as_often_as_the_time_has_intervals_at_most() {
        let run = measure(None, Nanos::from_millis(1), Nanos::from_millis(20));
        assert!(
            (1..=20).contains(&run.lateness.count()),
            "{}",
            run.lateness.count()
        );
        assert!(run.refused.is_empty());
    }

    #[test]
    fn no_cycle_is_named_for_settings_that_the_system_refuses() {
        let arguments = Arguments {
            seconds: 1,
            interval: Nanos::from_secs(3600),
            priority: 50,
            cpu: None,
            lock_memory: false,
            format: Format::default(),
        };
        assert_eq!(run(&arguments), Outcome::Usage, "longer than it lasts");
        let runs = [false, true].map(|refused| Run {
            real_time: refused.then(RealTime::default),
            lateness: late(60, 90),
            refused: vec!["no".to_owned(); usize::from(refused)],
        });
        let text = table(&runs, &arguments);
        assert!(text.contains(" (refused) "), "{text}");
        assert!(text.ends_with("\nlatency: ok cycle=500us\n"), "{text}");
    }
}
