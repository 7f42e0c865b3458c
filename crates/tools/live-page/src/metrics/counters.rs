//! The statistics that only rise, as Prometheus' counters.

/// A counter: its family, and the labels that its key has.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Counter {
    pub(super) name: String,
    pub(super) help: &'static str,
    pub(super) labels: Vec<(&'static str, String)>,
}

/// How a key of docs/statistics.md becomes a counter: the key, the family without `tickbus_`, its label, and its help.
/// Of a key that ends with a dot, the rest is the label's value.
type Rule = (
    &'static str,
    &'static str,
    Option<(&'static str, &'static str)>,
    &'static str,
);

const EXCHANGES: &str = "Exchanges by the status of their data.";
const OCTETS: &str = "Octets of the protocol on the line.";
const FRAMES: &str = "Frames on the line.";
const DATA: &str = "Octets of process data on the line.";
const SWALLOWED: &str = "Changes that came and went before the other side took a frame.";
const CLIENTS: &str = "Clients by what became of them.";

#[rustfmt::skip]
const RULES: [Rule; 33] = [
    ("ticks", "ticks", None, "Exchanges, and ticks begun with receive."),
    ("fresh", "exchanges", Some(("status", "fresh")), EXCHANGES),
    ("unchanged", "exchanges", Some(("status", "unchanged")), EXCHANGES),
    ("stale", "exchanges", Some(("status", "stale")), EXCHANGES),
    ("failed", "exchanges", Some(("status", "failed")), EXCHANGES),
    ("bus_cycles", "bus_cycles", None, "Whole bus cycles that have arrived."),
    ("events_lost", "events_lost", None, "Events that did not fit into the ring."),
    ("saturated", "values_saturated", None, "Values beyond their type, sent as its nearest end."),
    ("not_a_number", "values_not_a_number", None, "NaN values, sent as the fail-safe value."),
    ("link.", "line_entered", Some(("state", "")), "How often the line has entered each state."),
    ("cause.", "line_causes", Some(("cause", "")), "How often each cause was given."),
    ("swallowed_inputs", "swallowed_changes", Some(("direction", "input")), SWALLOWED),
    ("swallowed_outputs", "swallowed_changes", Some(("direction", "output")), SWALLOWED),
    ("swallowed.", "signal_swallowed_changes", Some(("signal", "")), SWALLOWED),
    ("line.octets_in", "line_octets", Some(("direction", "in")), OCTETS),
    ("line.octets_out", "line_octets", Some(("direction", "out")), OCTETS),
    ("line.frames_in", "line_frames", Some(("direction", "in")), FRAMES),
    ("line.frames_out", "line_frames", Some(("direction", "out")), FRAMES),
    ("line.data_in", "line_data_octets", Some(("direction", "in")), DATA),
    ("line.data_out", "line_data_octets", Some(("direction", "out")), DATA),
    ("clients.accepted", "clients", Some(("event", "accepted")), CLIENTS),
    ("clients.dropped", "clients", Some(("event", "dropped")), CLIENTS),
    ("clients.not_accepted", "clients", Some(("event", "not_accepted")), CLIENTS),
    ("clients.turned_away", "clients", Some(("event", "turned_away")), CLIENTS),
    ("fault.begun", "faults_begun", None, "How often injected faults have begun."),
    ("log.untold", "log_untold", None, "Messages about the line that the log did not get."),
    ("log.dropped", "log_dropped", None, "Messages of the process that were dropped."),
    ("record.ticks", "recorded_ticks", None, "Ticks that were recorded."),
    ("record.dropped", "recorded_ticks_dropped", None, "Ticks that were left out of the recording."),
    ("plc.scans", "plc_scans", None, "Scans of the program."),
    ("plc.stale", "plc_stale_scans", None, "Scans that found the data stale."),
    ("plc.rises.", "plc_rises", Some(("signal", "")), "Rising edges, as the program saw or made them."),
    ("run.steps", "run_steps", None, "Steps of the run on virtual time."),
];

/// The counter of a key, if it only rises.
pub(super) fn of(key: &str) -> Option<Counter> {
    if matches!(key, "cause.code") {
        return None;
    }
    RULES.iter().find_map(|rule| by_rule(rule, key))
}

fn by_rule((pattern, family, label, help): &Rule, key: &str) -> Option<Counter> {
    let mut labels = Vec::new();
    let mut of = "tickbus";
    if let Some(rest) = key.strip_prefix("station.") {
        let name = rest.strip_suffix(pattern)?.strip_suffix('.')?;
        labels.push(("station", plain(name)));
        of = "tickbus_station";
    } else if pattern.ends_with('.') {
        let rest = key.strip_prefix(pattern)?;
        labels.extend(label.map(|(name, _)| (name, plain(rest))));
    } else if key != *pattern {
        return None;
    }
    if !pattern.ends_with('.') {
        labels.extend(label.map(|(name, value)| (name, value.to_owned())));
    }
    Some(Counter {
        name: format!("{of}_{family}_total"),
        help,
        labels,
    })
}

/// A key, or a name within one, as it was before it was made fit for a line `key=value`.
pub(super) fn plain(key: &str) -> String {
    let mut plain = String::new();
    let mut rest = key.chars();
    while let Some(c) = rest.next() {
        plain.extend(if c == '\\' { rest.next() } else { Some(c) });
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(key: &str) -> Option<(String, Vec<(&'static str, String)>)> {
        of(key).map(|counter| (counter.name, counter.labels))
    }

    #[test]
    fn a_count_that_rises_is_a_counter_with_its_labels() {
        let exchanges = ("status", "stale".to_owned());
        let name = |name: &str| name.to_owned();
        assert_eq!(
            found("stale"),
            Some((name("tickbus_exchanges_total"), vec![exchanges]))
        );
        assert_eq!(
            found("swallowed.a \\= b.c"),
            Some((
                name("tickbus_signal_swallowed_changes_total"),
                vec![("signal", name("a = b.c"))]
            ))
        );
        assert_eq!(
            found("station.North.1.line.octets_out"),
            Some((
                name("tickbus_station_line_octets_total"),
                vec![("station", name("North.1")), ("direction", name("out"))]
            ))
        );
    }

    #[test]
    fn what_falls_again_is_none() {
        for key in [
            "cause.code",
            "state.code",
            "line.octets_out_per_s",
            "station.A.age_ms",
            "replies",
        ] {
            assert_eq!(found(key), None, "{key}");
        }
    }
}
