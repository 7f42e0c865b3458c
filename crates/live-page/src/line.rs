//! The line of a driver, as JSON.

use std::collections::BTreeMap;

use serde::Serialize;
use tickbus_base::statistics::{Statistics, Value};
use tickbus_base::time::Nanos;
use tickbus_driver::{StationView, Watch};
use tickbus_fieldbus::{Link, is_stale};

use crate::value::Number;

/// What stands behind a distribution's name in its keys.
const PARTS: [&str; 7] = [
    ".p50_us",
    ".p90_us",
    ".p99_us",
    ".max_us",
    ".mean_us",
    ".min_us",
    ".stdev_us",
];

/// Edges of single signals as a hosted program saw them: as many as there are signals.
const RISES: &str = "plc.rises.";

/// What stands elsewhere in the answer.
const TOLD: [&str; 6] = [
    "state",
    "state.code",
    "state.for_s",
    "cause",
    "cause.code",
    "reason",
];

#[derive(Serialize)]
struct Line<'a> {
    id: i32,
    name: &'a str,
    state: &'static str,
    cause: &'static str,
    reason: &'a str,
    since_ms: i64,
    status: String,
    tick: u64,
    silence_ms: Option<i64>,
    stations: Vec<Station<'a>>,
    faults: Vec<Fault<'a>>,
    counters: BTreeMap<&'a str, Number>,
    times: BTreeMap<&'a str, BTreeMap<&'a str, Number>>,
    texts: BTreeMap<&'a str, String>,
}

#[derive(Serialize)]
struct Station<'a> {
    name: &'a str,
    state: String,
    reason: String,
    age_ms: Option<f64>,
    stale: bool,
    cycles: u64,
}

#[derive(Serialize)]
struct Fault<'a> {
    id: u32,
    name: &'a str,
    kind: &'static str,
    phase: &'static str,
    what: &'a str,
    begun: u64,
}

/// How old the data of a station are now, of a copy that was made a while ago.
pub(crate) fn age_now(station: &StationView, silence: Nanos) -> Nanos {
    match (station.age, silence) {
        (Nanos::MAX, _) => Nanos::MAX,
        // Before the first tick nothing was received, either.
        (age, Nanos::MAX) => age,
        (age, silence) => age + silence,
    }
}

/// In milliseconds, to the microsecond; `None` for never.
pub(crate) fn millis(span: Nanos) -> Option<f64> {
    (span != Nanos::MAX).then(|| span.as_micros().round() / 1e3)
}

pub(crate) fn json(id: i32, watch: &Watch, link: &Link, statistics: &Statistics) -> String {
    let config = watch.config();
    let (now, silence) = (watch.clock().now(), watch.silence());
    let faults = watch.faults();
    let (stations, status, tick) = watch.view(|view| {
        let sections = config.table.stations.iter().zip(&view.stations);
        let stations = sections.map(|(section, station)| {
            let age = age_now(station, silence);
            let max_age = config.timing.max_age;
            let stale = is_stale(age, max_age, station.is_valid);
            let reason = match (age, stale) {
                (_, false) => String::new(),
                (Nanos::MAX, _) => "nothing has come from it yet".to_owned(),
                (age, _) if age > max_age => {
                    let age = age.rounded();
                    format!("nothing has come from it for {age}; the limit is max_age = {max_age}")
                }
                _ => format!("its data do not count: {}", link.reason),
            };
            Station {
                name: &section.name,
                state: station.status.name().to_ascii_lowercase(),
                reason,
                age_ms: millis(age),
                stale,
                cycles: station.cycles,
            }
        });
        let status = view.code.name().to_ascii_lowercase();
        (stations.collect(), status, view.tick)
    });
    let mut line = Line {
        id,
        name: &config.name,
        state: link.state.name(),
        cause: link.cause.name(),
        reason: &link.reason,
        since_ms: (now - link.since).0.max(0) / 1_000_000,
        status,
        tick,
        silence_ms: (silence != Nanos::MAX).then_some(silence.0 / 1_000_000),
        stations,
        faults: faults
            .iter()
            .map(|fault| Fault {
                id: fault.id,
                name: &fault.name,
                kind: fault.kind,
                phase: fault.phase.name(),
                what: &fault.what,
                begun: fault.begun,
            })
            .collect(),
        counters: BTreeMap::new(),
        times: BTreeMap::new(),
        texts: BTreeMap::new(),
    };
    sort(statistics, &mut line);
    serde_json::to_string(&line).expect("texts and numbers")
}

/// Sorts statistics into counters, distributions and texts.
fn sort<'a>(statistics: &'a Statistics, line: &mut Line<'a>) {
    for (key, value) in statistics.iter() {
        let number = match value {
            _ if TOLD.contains(&key) || key.starts_with(RISES) => continue,
            #[expect(clippy::cast_precision_loss, reason = "scripts have no more digits")]
            Value::Count(count) => Number::Real(*count as f64),
            Value::Number(number, _) => Number::Real(*number),
            // Faults stand by themselves.
            _ if key.starts_with("fault.") => continue,
            Value::Time(time) => {
                line.texts.insert(key, time.to_string());
                continue;
            }
            Value::Text(text) => {
                line.texts.insert(key, text.clone());
                continue;
            }
        };
        let distribution = PARTS
            .iter()
            .find_map(|part| Some((key.strip_suffix(part)?, &part[1..])));
        if let Some((name, part)) = distribution {
            line.times.entry(name).or_default().insert(part, number);
        } else if !key.starts_with("fault.") || !key[6..].starts_with(|c: char| c.is_ascii_digit())
        {
            line.counters.insert(key, number);
        }
    }
    // How many there are stands before the rest of a distribution.
    for (name, times) in &mut line.times {
        if let Some(count) = line.counters.remove(&*format!("{name}.count")) {
            times.insert("count", count);
        }
    }
}
