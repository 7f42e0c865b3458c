//! The line of a driver, as JSON.

use std::collections::BTreeMap;

use serde::Serialize;
use tickbus_base::statistics::{Statistics, Value};
use tickbus_base::time::Nanos;
use tickbus_driver::{LineEnd, StationView, Watch};
use tickbus_fieldbus::{Cause, Link, LinkState, is_stale};

use crate::events::{self, Event, whole_millis};
use crate::value::Number;

/// The suffixes of a distribution's keys.
const PARTS: [&str; 7] = [
    ".p50_us",
    ".p90_us",
    ".p99_us",
    ".max_us",
    ".mean_us",
    ".min_us",
    ".stdev_us",
];

/// Edges of single signals as a hosted program saw them: one key per signal.
const RISES: &str = "plc.rises.";

/// Keys whose values appear elsewhere in the answer.
const TOLD: [&str; 6] = [
    "state",
    "state.code",
    "state.for_s",
    "cause",
    "cause.code",
    "reason",
];

/// A line in full.
#[derive(Serialize)]
pub(crate) struct Line<'a> {
    pub(crate) id: i32,
    pub(crate) name: &'a str,
    pub(crate) state: &'static str,
    pub(crate) cause: &'static str,
    pub(crate) reason: &'a str,
    pub(crate) since_ms: i64,
    pub(crate) status: String,
    pub(crate) tick: u64,
    pub(crate) silence_ms: Option<i64>,
    /// The first rows, as title and text.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) facts: Vec<(&'static str, String)>,
    pub(crate) stations: Vec<Station<'a>>,
    /// `server` if the peer connects to this end, `client` if this end connects; `None` if that is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) end: Option<&'static str>,
    /// The host and port where it connects or listens.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) address: Option<String>,
    /// True if the line has come up with its present settings.
    pub(crate) has_run: bool,
    /// The time until the bus is tried again after a failure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) next_ms: Option<i64>,
    /// The last events, the oldest first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) events: Vec<Event>,
    pub(crate) faults: Vec<Fault<'a>>,
    /// The faults that the simulation's model has declared.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) model_faults: Vec<&'a str>,
    pub(crate) counters: BTreeMap<&'a str, Number>,
    pub(crate) times: BTreeMap<&'a str, BTreeMap<&'a str, Number>>,
    pub(crate) texts: BTreeMap<&'a str, String>,
}

impl<'a> Line<'a> {
    /// A line without further details so far.
    pub(crate) fn new(
        id: i32,
        name: &'a str,
        state: LinkState,
        cause: Cause,
        status: &str,
    ) -> Self {
        Self {
            id,
            name,
            state: state.name(),
            cause: cause.name(),
            reason: "",
            since_ms: 0,
            status: status.to_ascii_lowercase(),
            tick: 0,
            silence_ms: None,
            facts: Vec::new(),
            stations: Vec::new(),
            end: None,
            address: None,
            has_run: state == LinkState::Running,
            next_ms: None,
            events: Vec::new(),
            faults: Vec::new(),
            model_faults: Vec::new(),
            counters: BTreeMap::new(),
            times: BTreeMap::new(),
            texts: BTreeMap::new(),
        }
    }

    /// The line as JSON.
    pub(crate) fn text(&self) -> String {
        serde_json::to_string(self).expect("texts and numbers")
    }
}

/// A station of a line, or a client of a run.
#[derive(Serialize)]
pub(crate) struct Station<'a> {
    pub(crate) name: &'a str,
    pub(crate) state: String,
    pub(crate) reason: String,
    pub(crate) age_ms: Option<f64>,
    pub(crate) stale: bool,
    pub(crate) cycles: u64,
}

impl<'a> Station<'a> {
    /// A station with only a name.
    pub(crate) fn new(name: &'a str) -> Self {
        Self {
            name,
            state: String::new(),
            reason: String::new(),
            age_ms: None,
            stale: false,
            cycles: 0,
        }
    }
}

/// A fault that was injected.
#[derive(Serialize)]
pub(crate) struct Fault<'a> {
    id: u32,
    name: &'a str,
    kind: &'static str,
    phase: &'static str,
    what: &'a str,
    begun: u64,
}

/// The current age of a station's data, from a copy that was made `silence` ago.
pub(crate) fn age_now(station: &StationView, silence: Nanos) -> Nanos {
    match (station.age, silence) {
        (Nanos::MAX, _) => Nanos::MAX,
        // Before the first tick nothing was received.
        (age, Nanos::MAX) => age,
        (age, silence) => age + silence,
    }
}

/// True if the data of a station are stale by now.
pub(crate) fn is_stale_now(station: &StationView, silence: Nanos, max_age: Nanos) -> bool {
    is_stale(age_now(station, silence), max_age, station.is_valid)
}

/// In milliseconds, to the microsecond; `None` for never.
pub(crate) fn millis(span: Nanos) -> Option<f64> {
    (span != Nanos::MAX).then(|| span.as_micros().round() / 1e3)
}

/// The line of a driver as JSON; with these events of faults beside its own.
pub(crate) fn json(
    id: i32,
    watch: &Watch,
    link: &Link,
    statistics: &Statistics,
    fault_events: Vec<Event>,
) -> String {
    let config = watch.config();
    let (now, silence) = (watch.clock().now(), watch.silence());
    let (faults, model_faults) = (watch.faults(), watch.model_faults());
    let (stations, status, tick) = watch.view(|view| {
        let sections = config.table.stations.iter().zip(&view.stations);
        let stations = sections.map(|(section, station)| {
            let age = age_now(station, silence);
            let max_age = watch.max_age();
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
        (stations.collect(), view.code.name(), view.tick)
    });
    let mut line = Line {
        reason: &link.reason,
        since_ms: whole_millis(now - link.since),
        tick,
        silence_ms: (silence != Nanos::MAX).then_some(silence.0 / 1_000_000),
        stations,
        end: watch.line_end().map(|end| match end {
            LineEnd::Server => "server",
            LineEnd::Client => "client",
        }),
        address: address_of(watch, statistics),
        has_run: watch.has_run(),
        next_ms: watch.next_attempt().map(|next| whole_millis(next - now)),
        events: events::last([events::of_line(watch, now), fault_events].concat()),
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
        model_faults: model_faults.iter().map(String::as_str).collect(),
        ..Line::new(id, &config.name, link.state, link.cause, status)
    };
    sort(statistics, &mut line);
    line.text()
}

/// Where the line connects or listens: as the bus tells it, with the port that the system chose, or as configured.
fn address_of(watch: &Watch, statistics: &Statistics) -> Option<String> {
    let told = statistics.iter().find(|(key, _)| *key == "address");
    if let Some((_, Value::Text(address))) = told {
        return Some(address.clone());
    }
    watch.address()
}

/// True for the keys of a single fault, of which a long run has ever more.
pub(crate) fn is_of_one_fault(key: &str) -> bool {
    let rest = key.strip_prefix("fault.");
    rest.is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
}

/// Sorts statistics into counters, distributions and texts.
pub(crate) fn sort<'a>(statistics: &'a Statistics, line: &mut Line<'a>) {
    for (key, value) in statistics.iter() {
        let number = match value {
            _ if TOLD.contains(&key) || key.starts_with(RISES) => continue,
            #[expect(clippy::cast_precision_loss, reason = "scripts have no more digits")]
            Value::Count(count) => Number::Real(*count as f64),
            Value::Number(number, _) => Number::Real(*number),
            // Faults appear separately.
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
        } else if !is_of_one_fault(key) {
            line.counters.insert(key, number);
        }
    }
    // The count precedes the rest of a distribution.
    for (name, times) in &mut line.times {
        if let Some(count) = line.counters.remove(&*format!("{name}.count")) {
            times.insert("count", count);
        }
    }
}
