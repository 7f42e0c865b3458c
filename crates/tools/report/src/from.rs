//! A run from a recording.

use super::{Mark, MarkKind, Run, SignalKind};
use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;
use tickbus_record as record;
use tickbus_record::{Columns, Recording, RecordingError, Tick};

/// From this status of an exchange on, data are stale.
const STALE: i32 = 2;

/// The text of a [`MarkKind::Link`] from which on data are fresh.
pub const LIVE: &str = "live";

/// The destination of a column's values.
enum Target {
    /// The signal with this number; its slots hold this kind of value.
    Signal(usize, record::ValueKind),
    /// The edge count of the signal with this number.
    Edges(usize),
    /// The signal does not exist.
    Nowhere,
}

/// Reads a recording to its end. The error says why it cannot be read further; the run has everything before.
pub fn read(recording: &mut Recording, budget: usize) -> (Run, Option<RecordingError>) {
    let columns = recording.columns().clone();
    let mut run = Run::new(budget);
    let targets = targets(&columns, &mut run);
    let mut lines = Lines::new(&columns);
    let mut tick = Tick::new(&columns);
    let mut last: Vec<Slot> = Vec::new();
    let mut before: Option<(u64, Nanos, u64)> = None;
    let error = loop {
        match recording.next(&mut tick) {
            Ok(true) => {}
            Ok(false) => break None,
            Err(error) => break Some(error),
        }
        let now = tick.time;
        if let Some((number, time, dropped)) = before.replace((tick.number, now, tick.dropped)) {
            if tick.dropped > dropped {
                let count = tick.dropped - dropped;
                let ticks = if count == 1 { "tick was" } else { "ticks were" };
                mark(
                    &mut run,
                    time,
                    Some(now),
                    MarkKind::Gap,
                    format!("{count} {ticks} dropped"),
                );
            }
            if tick.number != number + 1 {
                run.skip();
            }
        }
        run.tick(now);
        lines.tick(&tick, &mut run);
        let is_first = last.is_empty();
        last.resize(tick.values.len(), Slot::default());
        let values = tick.values.iter().zip(&mut last);
        for (target, (slot, last)) in targets.iter().zip(values) {
            // Most values of a tick are those of the one before.
            if *slot == *last && !is_first && !matches!(target, Target::Edges(_)) {
                continue;
            }
            *last = *slot;
            match target {
                Target::Signal(signal, kind) => run.change(*signal, now, number(*kind, *slot)),
                Target::Edges(signal) => {
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "a whole number below 2^32"
                    )]
                    run.count_edges(*signal, slot.real() as u64);
                }
                Target::Nowhere => {}
            }
        }
    };
    let (_, end) = run.extent();
    if recording.is_cut() || error.is_some() {
        let why = error
            .as_ref()
            .map_or_else(|| recording.ending(), |error| error.mistake.what.clone());
        mark(
            &mut run,
            end,
            Some(end),
            MarkKind::Note,
            format!("the recording breaks off: {why}"),
        );
    }
    for (column, target) in columns.columns.iter().zip(&targets) {
        // A CSV file has no types: a signal that was only ever 0 or 1 counts as a bool.
        if let (None, Target::Signal(signal, _)) = (column.data_type, target) {
            run.call_bool_if_it_looks_like_one(*signal);
        }
    }
    (run, error)
}

fn mark(run: &mut Run, at: Nanos, until: Option<Nanos>, kind: MarkKind, text: String) {
    run.mark(Mark {
        at,
        until,
        kind,
        of: String::new(),
        text,
    });
}

fn targets(columns: &Columns, run: &mut Run) -> Vec<Target> {
    let mut places = std::collections::HashMap::new();
    let mut targets = Vec::with_capacity(columns.columns.len());
    for column in columns.columns.iter().filter(|column| !column.is_edges) {
        let kind = match column.kind {
            record::ValueKind::Bit => SignalKind::Bool,
            _ => SignalKind::Real,
        };
        let place = run.add_signal(
            &column.name,
            kind,
            column.unit.as_deref().unwrap_or_default(),
        );
        places.insert(&*column.name, place);
    }
    for column in &columns.columns {
        targets.push(match places.get(&*column.name) {
            Some(place) if column.is_edges => Target::Edges(*place),
            Some(place) => Target::Signal(*place, column.kind),
            None => Target::Nowhere,
        });
    }
    targets
}

#[expect(
    clippy::cast_precision_loss,
    reason = "a chart shows no more than a double has"
)]
fn number(kind: record::ValueKind, slot: Slot) -> f64 {
    match kind {
        record::ValueKind::Signed => slot.signed() as f64,
        record::ValueKind::Unsigned => slot.unsigned() as f64,
        _ => slot.real(),
    }
}

/// The freshness of each station's data over time.
struct Lines<'a> {
    stations: Vec<&'a str>,
    last: Vec<Option<i32>>,
}

impl<'a> Lines<'a> {
    fn new(columns: &'a Columns) -> Self {
        let stations: Vec<&str> = columns.stations.iter().map(|station| &**station).collect();
        // A single station needs no name.
        let stations = if stations.is_empty() {
            vec![""]
        } else {
            stations
        };
        Self {
            last: vec![None; stations.len()],
            stations,
        }
    }

    fn tick(&mut self, tick: &Tick, run: &mut Run) {
        let whole = [tick.status];
        let statuses = if tick.stations.is_empty() {
            &whole[..]
        } else {
            &tick.stations
        };
        for ((station, last), status) in self.stations.iter().zip(&mut self.last).zip(statuses) {
            // Fresh and unchanged alternate, depending on the phase of ticks and bus cycles.
            let status = if (0..STALE).contains(status) {
                0
            } else {
                *status
            };
            if last.replace(status) == Some(status) {
                continue;
            }
            let text = match status {
                0 => LIVE.to_owned(),
                STALE => "stale: nothing new for longer than max_age".to_owned(),
                code => format!("failed: status {code}"),
            };
            run.mark(Mark {
                at: tick.time,
                until: None,
                kind: MarkKind::Link,
                of: (*station).to_owned(),
                text,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::spans;
    use super::*;
    use tickbus_record::Format;

    fn read_csv(text: &str) -> (Run, Option<RecordingError>) {
        let text = std::io::Cursor::new(text.to_owned());
        let recording = Recording::read("run.csv", Format::Csv, Box::new(text), None);
        read(&mut recording.expect("it has a header"), 1000)
    }

    const CSV: &str = "bus.tick,bus.time_ns,bus.status,bus.dropped,lamp,height,lamp.edges\n\
        1,0,0,0,0,1.5,0\n2,1000000,1,0,1,1.5,1\n3,2000000,2,0,1,2.5,0\n7,6000000,0,3,0,2.5,2\n";

    #[test]
    fn a_recording_becomes_a_run() {
        let (run, error) = read_csv(CSV);
        assert_eq!(error, None);
        let names: Vec<_> = run
            .signals()
            .iter()
            .map(|s| (&*s.name, s.kind, s.changes().len(), s.edges()))
            .collect();
        assert_eq!(
            names,
            [
                ("lamp", SignalKind::Bool, 3, Some(3)),
                ("height", SignalKind::Real, 2, None)
            ]
        );
        assert_eq!(run.ticks(), 4);
        assert_eq!(run.extent(), (Nanos::ZERO, Nanos::from_millis(6)));
        let (spans, _, longest) = run.intervals().expect("several ticks");
        assert_eq!((spans.count(), longest), (2, Nanos::from_millis(1)));
        let texts: Vec<_> = run
            .marks()
            .iter()
            .map(|mark| (mark.at.0 / 1_000_000, mark.kind, &*mark.text))
            .collect();
        assert_eq!(
            texts,
            [
                (0, MarkKind::Link, "live"),
                (
                    2,
                    MarkKind::Link,
                    "stale: nothing new for longer than max_age"
                ),
                (2, MarkKind::Gap, "3 ticks were dropped"),
                (6, MarkKind::Link, "live"),
            ]
        );
        assert_eq!(spans::states(&run, MarkKind::Link, "").len(), 3);
    }

    #[test]
    fn what_came_before_the_damage_is_kept() {
        let (run, error) = read_csv(&CSV.replace("6000000", "six"));
        assert_eq!(error.and_then(|error| error.line), Some(5));
        assert_eq!(run.ticks(), 3);
        assert_eq!(
            run.marks().last().map(|mark| mark.kind),
            Some(MarkKind::Note)
        );
    }
}
