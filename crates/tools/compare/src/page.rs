//! The comparison for people: its tables, and both runs in one chart.

use std::collections::BTreeSet;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::short_number;
use tickbus_report::{Cell, Mark, MarkKind, MoreTable, Run};

use super::compared::{Compared, Outcome, SignalResult};
use super::edges::{BoolResult, Edge};
use super::side::Side;
use super::steps::Steps;

/// Added to the names of simulated signals.
const SIMULATED: &str = " · simulated";

/// How much of the chart a link shows before and after an edge, in windows.
const AROUND: i64 = 2;

/// Both runs in one, for the chart: each compared signal, and below it its simulated twin, moved by `moved`; first the
/// signals that change. At most `budget` changes are kept.
pub fn both(
    real: &Side,
    simulated: &Side,
    compared: &Compared,
    moved: Nanos,
    budget: usize,
) -> Run {
    let mut run = Run::new(budget);
    let mut add = |side: &Side, name: &str, suffix: &str, moved: Nanos| {
        let Some(place) = side.run.signal(name) else {
            return;
        };
        let signal = &side.run.signals()[place];
        let name = format!("{name}{suffix}");
        let number = run.add_signal(&name, signal.kind, &signal.unit);
        for change in signal.changes() {
            run.change(number, change.at + moved, change.value);
        }
        // The last value lasts to the end of its recording.
        let (_, end) = side.run.extent();
        if let Some(last) = signal.changes().last() {
            run.change(number, end + moved, last.value);
        }
    };
    let steps = compared.steps.iter().map(|steps| &steps.signal);
    let mut signals: Vec<&SignalResult> = compared.signals.iter().collect();
    signals.sort_by_key(|signal| signal.likeness.is_none());
    let names = steps.chain(signals.into_iter().map(|signal| &signal.name));
    let mut seen = BTreeSet::new();
    for name in names.filter(|name| seen.insert(*name)) {
        add(real, name, "", Nanos::ZERO);
        add(simulated, name, SIMULATED, moved);
    }
    for (side, moved) in [(real, Nanos::ZERO), (simulated, moved)] {
        let spans: BTreeSet<_> = side.unknown.iter().flatten().collect();
        let gaps = spans.into_iter().map(|(from, until)| Mark {
            at: *from,
            until: Some(*until),
            kind: MarkKind::Gap,
            of: side.name.clone(),
            text: "stale, or dropped".to_owned(),
        });
        let marks = side.run.marks().iter();
        let notes = marks.filter(|mark| mark.kind == MarkKind::Note).cloned();
        for mark in gaps.chain(notes) {
            run.mark(Mark {
                at: mark.at + moved,
                until: mark.until.map(|until| until + moved),
                ..mark
            });
        }
    }
    run
}

/// The tables, with at most `most` missing and extra edges; on a page their times lead into the chart.
pub fn tables(compared: &Compared, most: usize) -> Vec<MoreTable> {
    let mut all = vec![
        edges(compared),
        unmatched(compared, most),
        numbers(compared),
    ];
    all.extend(compared.steps.as_ref().map(steps));
    all.retain(|table| !table.rows.is_empty());
    all
}

/// A table with these headings, which bars separate.
fn table(heading: &str, caption: String, headings: &str, rows: Vec<Vec<Cell>>) -> MoreTable {
    MoreTable {
        heading: heading.to_owned(),
        caption,
        headings: headings.split('|').map(str::to_owned).collect(),
        rows,
    }
}

/// A number with four digits that count.
pub fn short(value: f64) -> String {
    short_number(format!("{value:.3e}").parse().unwrap_or(value))
}

fn figure(value: &impl ToString) -> Cell {
    Cell::Number(value.to_string())
}

fn time(time: Option<Nanos>) -> Cell {
    time.map_or_else(|| figure(&"-"), |time| figure(&time.rounded()))
}

fn bools(compared: &Compared) -> impl Iterator<Item = (&SignalResult, f64, &BoolResult)> {
    let signals = compared.signals.iter();
    signals.filter_map(|signal| match &signal.outcome {
        Outcome::Bool(found) => Some((signal, signal.likeness?, found)),
        Outcome::Number(_) => None,
    })
}

/// A time, which leads to its surroundings in the chart.
fn around(at: Nanos, window: Nanos) -> Cell {
    let reach = window.times(AROUND);
    Cell::Chart(at - reach, at + reach, at.rounded().to_string())
}

fn edges(compared: &Compared) -> MoreTable {
    let mut rows = Vec::new();
    for (signal, likeness, found) in bools(compared) {
        for rises in [true, false] {
            let of_way = |edges: &[Edge]| edges.iter().filter(|edge| edge.rises == rises).count();
            let differences = found.differences(rises);
            let worst = differences.map(|found| found.worst);
            rows.push(vec![
                Cell::Text(signal.name.clone()),
                Cell::Text(direction(rises)),
                figure(&differences.map_or(0, |found| found.pairs)),
                figure(&of_way(&found.missing)),
                figure(&of_way(&found.extra)),
                time(differences.map(|found| found.median)),
                time(differences.map(|found| found.spread)),
                time(worst.map(|(worst, _)| worst)),
                worst.map_or_else(|| time(None), |(_, at)| around(at, found.window)),
                figure(&format!("{likeness:.4}")),
            ]);
        }
    }
    table(
        "Edges",
        "time differences, positive where the simulated edge is later".to_owned(),
        "Signal|Edge|>Pairs|>Missing|>Extra|>Median|>Spread|>Worst|>At|>Likeness",
        rows,
    )
}

fn direction(rises: bool) -> String {
    (if rises { "rise" } else { "fall" }).to_owned()
}

fn unmatched(compared: &Compared, most: usize) -> MoreTable {
    let mut all: Vec<(Edge, Nanos, &str, &str)> = Vec::new();
    for (signal, _, found) in bools(compared) {
        for (edges, what) in [(&found.missing, "missing"), (&found.extra, "extra")] {
            let edges = edges.iter();
            all.extend(edges.map(|edge| (*edge, found.window, &*signal.name, what)));
        }
    }
    all.sort_by_key(|row| row.0.at);
    let caption = match all.len() {
        count if count > most => format!("the first {most} of {count}"),
        _ => "edges without a partner".to_owned(),
    };
    let rows = all
        .into_iter()
        .take(most)
        .map(|(edge, window, name, what)| {
            let texts = [name.to_owned(), direction(edge.rises), what.to_owned()];
            let mut cells = Vec::from(texts.map(Cell::Text));
            cells.push(around(edge.at, window));
            cells
        });
    let headings = "Signal|Edge|What|>Time";
    table("Missing and extra edges", caption, headings, rows.collect())
}

fn numbers(compared: &Compared) -> MoreTable {
    let rows = compared.signals.iter().filter_map(|signal| {
        let Outcome::Number(found) = &signal.outcome else {
            return None;
        };
        let with_unit = |value: f64| {
            let text = format!("{} {}", short(value), signal.unit);
            figure(&text.trim_end())
        };
        Some(vec![
            Cell::Text(signal.name.clone()),
            time(Some(found.shift)),
            with_unit(found.rms),
            with_unit(found.greatest),
            around(found.at, Nanos::from_secs(1)),
            figure(&format!("{:.4}", signal.likeness?)),
        ])
    });
    table(
        "Numbers",
        "differences after the best shift, positive where the simulated curve is later".to_owned(),
        "Signal|>Best shift|>RMS|>Greatest|>At|>Likeness",
        rows.collect(),
    )
}

fn steps(steps: &Steps) -> MoreTable {
    let rows = steps.rows.iter().map(|row| {
        let number = row.number.to_string();
        vec![
            match row.first {
                Some((from, until)) => Cell::Chart(from, until, number),
                None => Cell::Number(number),
            },
            figure(&row.real.0),
            figure(&row.simulated.0),
            time(row.real.1),
            time(row.simulated.1),
            time(row.difference()),
        ]
    });
    table(
        "Durations of steps",
        format!("medians of \"{}\"", steps.signal),
        ">Step|>Times|>Simulated|>Duration|>Simulated|>Difference",
        rows.collect(),
    )
}
