//! The tables of the page.

use std::collections::BTreeMap;
use std::fmt::{self, Write as _};

use super::html::{Text, count, counted, digits, seconds, span};
use super::spans::{Span, state_class};
use super::statistics::Distribution;
use super::{Kind, Run, Signal, Statistics, figures};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::short_number;

/// Further rows of a list are left out, and counted.
const MOST_ROWS: usize = 1_000;

/// Converts times for the script: to units since the start of the run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub(super) begin: Nanos,
    pub(super) unit: i64,
}

impl Scale {
    /// A time in units, possibly fractional.
    #[expect(clippy::cast_precision_loss, reason = "a place in a chart")]
    pub(super) fn units(self, at: Nanos) -> f64 {
        (at - self.begin).0 as f64 / self.unit as f64
    }

    /// A link that shows a span in the chart.
    fn link(self, from: Nanos, until: Nanos) -> String {
        let (begin, end) = (self.units(from), self.units(until));
        let at = seconds(from);
        format!("<a href=\"#signals\" data-from=\"{begin}\" data-to=\"{end}\">{at}</a>")
    }
}

/// Heading cells; those that begin with ">" head columns of numbers.
fn head(out: &mut String, caption: &str, cells: &[&str]) {
    begin(out, "wide", caption, cells);
}

/// As [`head`], with a class; "list" is for narrow rows, which are set in several columns if there is room.
fn begin(out: &mut String, class: &str, caption: &str, cells: &[&str]) {
    let _ = write!(
        out,
        "<div class=\"{class}\"><table><caption>{caption}</caption><thead><tr>"
    );
    for cell in cells {
        let _ = match cell.strip_prefix('>') {
            Some(cell) => write!(out, "<th scope=\"col\" class=\"n\">{cell}</th>"),
            None => write!(out, "<th scope=\"col\">{cell}</th>"),
        };
    }
    out.push_str("</tr></thead><tbody>\n");
}

fn end(out: &mut String) {
    out.push_str("</tbody></table></div>\n");
}

fn number(out: &mut String, value: &dyn fmt::Display) {
    let _ = write!(out, "<td class=\"n\">{value}</td>");
}

fn left_out(out: &mut String, total: usize) {
    if total > MOST_ROWS {
        let more = counted((total - MOST_ROWS) as u64, "more is", "more are");
        let _ = writeln!(
            out,
            "<p class=\"note\">{more} not listed; the chart has all that the recording has.</p>"
        );
    }
}

/// Steps: the number and length of each, then their sequence.
pub(super) fn steps(out: &mut String, steps: &[Span], scale: Scale) {
    let mut by_text: BTreeMap<(u64, &str), Vec<Nanos>> = BTreeMap::new();
    for step in steps {
        // In numerical order if they are numbers.
        let number = step.text.parse().unwrap_or(u64::MAX);
        // A step cut off by the end of the run says nothing about its length.
        let lengths = by_text.entry((number, &step.text)).or_default();
        if !step.is_open {
            lengths.push(step.until - step.from);
        }
    }
    head(
        out,
        "How long each step took",
        &["Step", ">Times", ">Shortest", ">Mean", ">Longest"],
    );
    for ((_, text), lengths) in &by_text {
        let _ = write!(out, "<tr><th scope=\"row\">{}</th>", Text(text));
        number(out, &count(lengths.len() as u64));
        let sum = lengths
            .iter()
            .map(|length| i128::from(length.0))
            .sum::<i128>();
        let mean = sum
            .checked_div(lengths.len() as i128)
            .and_then(|mean| i64::try_from(mean).ok());
        for length in [
            lengths.iter().min().copied(),
            mean.map(Nanos),
            lengths.iter().max().copied(),
        ] {
            number(out, &length.map_or_else(|| "–".to_owned(), span));
        }
        out.push_str("</tr>\n");
    }
    end(out);
    let _ = writeln!(
        out,
        "<details{}><summary>{}, one after another</summary>",
        if steps.len() <= 100 { " open" } else { "" },
        counted(steps.len() as u64, "step", "steps")
    );
    begin(
        out,
        "list",
        "Steps in the order of time",
        &["Step", ">Begin", ">Duration"],
    );
    for step in steps.iter().take(MOST_ROWS) {
        let _ = write!(out, "<tr><th scope=\"row\">{}</th>", Text(&step.text));
        begin_and_length(out, step, scale);
        out.push_str("</tr>\n");
    }
    end(out);
    left_out(out, steps.len());
    out.push_str("</details>\n");
}

fn begin_and_length(out: &mut String, step: &Span, scale: Scale) {
    number(out, &scale.link(step.from, step.until));
    let length = span(step.until - step.from);
    let open = if step.is_open {
        "<span class=\"note\"> until the end</span>"
    } else {
        ""
    };
    let _ = write!(out, "<td class=\"n\">{length}{open}</td>");
}

/// Faults, gaps, notes: each with kind, beginning and duration.
pub(super) fn events(out: &mut String, events: &[(&str, Span)], scale: Scale) {
    head(
        out,
        "In the order of time",
        &["What", ">Begin", ">Duration", "Text"],
    );
    for (kind, event) in events.iter().take(MOST_ROWS) {
        let class = kind.to_lowercase();
        let _ = write!(
            out,
            "<tr><th scope=\"row\"><span class=\"tag {class}\">{kind}</span></th>"
        );
        begin_and_length(out, event, scale);
        let _ = writeln!(out, "<td>{}</td></tr>", Text(&event.text));
    }
    end(out);
    left_out(out, events.len());
}

/// States of lines over time.
pub(super) fn states(out: &mut String, states: &[Span], scale: Scale) {
    let has_names = states.iter().any(|state| !state.of.is_empty());
    let cells: &[&str] = if has_names {
        &["Station", "State", ">Begin", ">Duration"]
    } else {
        &["State", ">Begin", ">Duration"]
    };
    head(out, "States in the order of time", cells);
    for state in states.iter().take(MOST_ROWS) {
        out.push_str("<tr>");
        if has_names {
            let _ = write!(out, "<td>{}</td>", Text(&state.of));
        }
        let (word, reason) = state.text.split_once(": ").unwrap_or((&state.text, ""));
        let class = state_class(word);
        let _ = write!(
            out,
            "<td><span class=\"tag {class}\">{}</span> {}</td>",
            Text(word),
            Text(reason)
        );
        begin_and_length(out, state, scale);
        out.push_str("</tr>\n");
    }
    end(out);
    left_out(out, states.len());
}

/// The distributions of the statistics, each with a figure.
pub(super) fn distributions(out: &mut String, distributions: &[Distribution]) {
    let cells = [
        "Distribution",
        ">Count",
        ">p50",
        ">p90",
        ">p99",
        ">Max",
        ">Mean",
        "Unit",
        "p50 to max",
    ];
    head(
        out,
        "Percentiles; in the figure, the box is p50 to p90, the line goes on to p99, the dot is the maximum",
        &cells,
    );
    for distribution in distributions {
        let _ = write!(
            out,
            "<tr><th scope=\"row\" class=\"name\">{}</th>",
            Text(&distribution.name)
        );
        number(out, &count(distribution.count));
        for value in distribution.values {
            number(out, &digits(value));
        }
        let alike = distributions
            .iter()
            .filter(|other| other.unit == distribution.unit);
        let figure = figures::distribution(distribution, &alike.collect::<Vec<_>>());
        let _ = writeln!(
            out,
            "<td>{}</td><td class=\"figure\">{figure}</td></tr>",
            distribution.unit
        );
    }
    end(out);
}

/// All keys and values.
pub(super) fn statistics(out: &mut String, statistics: &Statistics) {
    head(out, "All statistics", &["Key", "Value"]);
    for (key, value) in statistics.all() {
        let _ = writeln!(
            out,
            "<tr><th scope=\"row\" class=\"name\">{}</th><td>{}</td></tr>",
            Text(key),
            Text(value)
        );
    }
    end(out);
}

/// A summary of each signal.
pub(super) fn signals(out: &mut String, run: &Run) {
    let cells = [
        "Signal",
        "Unit",
        ">Changes",
        ">Edges",
        ">Least",
        ">Greatest",
        ">Last",
        ">On",
    ];
    head(out, "What each signal did", &cells);
    for signal in run.signals() {
        let (name, unit) = (Text(&signal.name), Text(&signal.unit));
        let _ = write!(
            out,
            "<tr><th scope=\"row\" class=\"name\">{name}</th><td>{unit}</td>"
        );
        number(out, &count(signal.seen().saturating_sub(1)));
        number(out, &signal.edges().map(count).unwrap_or_default());
        let (low, high) = signal.range().unwrap_or((f64::NAN, f64::NAN));
        let last = signal
            .changes()
            .last()
            .map_or(f64::NAN, |change| change.value);
        for value in [low, high, last] {
            number(
                out,
                &if value.is_nan() {
                    "–".to_owned()
                } else {
                    short_number(value)
                },
            );
        }
        number(
            out,
            &share_on(signal, run)
                .map(|share| format!("{} %", digits(share * 100.0)))
                .unwrap_or_default(),
        );
        out.push_str("</tr>\n");
    }
    end(out);
}

/// The share of the run during which a bool was on.
#[expect(clippy::cast_precision_loss, reason = "a share, for people")]
fn share_on(signal: &Signal, run: &Run) -> Option<f64> {
    let (begin, end) = run.extent();
    if signal.kind != Kind::Bool || begin == end || signal.resolution() != Nanos::ZERO {
        return None;
    }
    let changes = signal.changes();
    let ends = changes.iter().skip(1).map(|change| change.at).chain([end]);
    let on = changes
        .iter()
        .zip(ends)
        .filter(|(change, _)| change.value > 0.5);
    let on: i64 = on.map(|(change, end)| (end - change.at).0).sum();
    Some(on as f64 / (end - begin).0 as f64)
}
