//! The tables of the page.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::html::{count, counted, digits, seconds, span};
use super::spans::{Span, state_class};
use super::statistics::Distribution;
use super::{Run, RunStatistics, Signal, SignalKind, figures};
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
    fn link(self, from: Nanos, until: Nanos) -> Markup {
        self.link_with(from, until, &seconds(from))
    }

    /// As [`link`](Self::link), with this text.
    pub(super) fn link_with(self, from: Nanos, until: Nanos, text: &str) -> Markup {
        let (begin, end) = (self.units(from), self.units(until));
        html! { a href="#signals" data-from=(begin) data-to=(end) { (text) } }
    }
}

/// A table. Headings that begin with ">" head columns of numbers; the class "list" is for narrow rows, which
/// are set in several columns if there is room.
pub(super) fn table(class: &str, caption: &str, headings: &[&str], rows: &Markup) -> Markup {
    html! {
        div class=(class) { table {
            caption { (caption) }
            thead { tr {
                @for heading in headings {
                    @match heading.strip_prefix('>') {
                        Some(heading) => th scope="col" class="n" { (heading) },
                        None => th scope="col" { (heading) },
                    }
                }
            } }
            tbody { (rows) }
        } }
    }
}

fn left_out(total: usize) -> Markup {
    html! {
        @if total > MOST_ROWS {
            p.note {
                (counted((total - MOST_ROWS) as u64, "more is", "more are"))
                " not listed; the chart has all that the recording has."
            }
        }
    }
}

/// Steps: the number and length of each, then their sequence.
pub(super) fn steps(steps: &[Span], scale: Scale) -> Markup {
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
    let mean = |lengths: &[Nanos]| {
        let sum: i128 = lengths.iter().map(|length| i128::from(length.0)).sum();
        let mean = sum.checked_div(lengths.len() as i128)?;
        i64::try_from(mean).ok().map(Nanos)
    };
    let each = html! {
        @for ((_, text), lengths) in &by_text {
            tr {
                th scope="row" { (text) }
                td.n { (count(lengths.len() as u64)) }
                @for length in [lengths.iter().min().copied(), mean(lengths), lengths.iter().max().copied()] {
                    td.n { (length.map_or_else(|| "–".to_owned(), span)) }
                }
            }
        }
    };
    let all = html! {
        @for step in steps.iter().take(MOST_ROWS) {
            tr { th scope="row" { (step.text) } (begin_and_length(step, scale)) }
        }
    };
    let headings = ["Step", ">Times", ">Shortest", ">Mean", ">Longest"];
    html! {
        (table("wide", "How long each step took", &headings, &each))
        details open[steps.len() <= 100] {
            summary { (counted(steps.len() as u64, "step", "steps")) ", one after another" }
            (table("list", "Steps in the order of time", &["Step", ">Begin", ">Duration"], &all))
            (left_out(steps.len()))
        }
    }
}

fn begin_and_length(step: &Span, scale: Scale) -> Markup {
    html! {
        td.n { (scale.link(step.from, step.until)) }
        td.n {
            (span(step.until - step.from))
            @if step.is_open { span.note { " until the end" } }
        }
    }
}

/// Faults, gaps, notes: each with kind, beginning and duration.
pub(super) fn events(events: &[(&str, Span)], scale: Scale) -> Markup {
    let rows = html! {
        @for (kind, event) in events.iter().take(MOST_ROWS) {
            tr {
                th scope="row" { span class={ "tag " (kind.to_lowercase()) } { (kind) } }
                (begin_and_length(event, scale))
                td { (event.text) }
            }
        }
    };
    let headings = ["What", ">Begin", ">Duration", "Text"];
    html! {
        (table("wide", "In the order of time", &headings, &rows))
        (left_out(events.len()))
    }
}

/// States of lines over time.
pub(super) fn states(states: &[Span], scale: Scale) -> Markup {
    let has_names = states.iter().any(|state| !state.of.is_empty());
    let headings = ["Station", "State", ">Begin", ">Duration"];
    let rows = html! {
        @for state in states.iter().take(MOST_ROWS) {
            @let (word, reason) = state.text.split_once(": ").unwrap_or((&state.text, ""));
            tr {
                @if has_names { td { (state.of) } }
                td { (tag(word)) " " (reason) }
                (begin_and_length(state, scale))
            }
        }
    };
    let headings = &headings[usize::from(!has_names)..];
    html! {
        (table("wide", "States in the order of time", headings, &rows))
        (left_out(states.len()))
    }
}

/// The state of a line.
pub(super) fn tag(state: &str) -> Markup {
    html! { span class={ "tag " (state_class(state)) } { (state) } }
}

/// The distributions of the statistics, each with a figure.
pub(super) fn distributions(distributions: &[Distribution]) -> Markup {
    let alike = |unit: &str| -> Vec<&Distribution> {
        let all = distributions.iter();
        all.filter(|other| other.unit == unit).collect()
    };
    let rows = html! {
        @for distribution in distributions {
            tr {
                th scope="row" class="name" { (distribution.name) }
                td.n { (count(distribution.count)) }
                @for value in distribution.values { td.n { (digits(value)) } }
                td { (distribution.unit) }
                td.figure { (figures::distribution(distribution, &alike(distribution.unit))) }
            }
        }
    };
    let caption = "Percentiles; in the figure, the box is p50 to p90, the line extends to p99, the dot is the maximum";
    let headings = [
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
    table("wide", caption, &headings, &rows)
}

/// All keys and values.
pub(super) fn statistics(statistics: &RunStatistics) -> Markup {
    let rows = html! {
        @for (key, value) in statistics.all() {
            tr { th scope="row" class="name" { (key) } td { (value) } }
        }
    };
    table("wide", "All statistics", &["Key", "Value"], &rows)
}

/// A summary of each signal.
pub(super) fn signals(run: &Run) -> Markup {
    let number = |value: Option<f64>| {
        let known = value.filter(|value| !value.is_nan());
        known.map_or_else(|| "–".to_owned(), short_number)
    };
    let percent = |share: f64| format!("{} %", digits(share * 100.0));
    let rows = html! {
        @for signal in run.signals() {
            @let range = signal.range();
            tr {
                th scope="row" class="name" { (signal.name) }
                td { (signal.unit) }
                td.n { (count(signal.seen().saturating_sub(1))) }
                td.n { (signal.edges().map(count).unwrap_or_default()) }
                td.n { (number(range.map(|(low, _)| low))) }
                td.n { (number(range.map(|(_, high)| high))) }
                td.n { (number(signal.changes().last().map(|change| change.value))) }
                td.n { (share_on(signal, run).map(percent).unwrap_or_default()) }
            }
        }
    };
    let headings = [
        "Signal",
        "Unit",
        ">Changes",
        ">Edges",
        ">Least",
        ">Greatest",
        ">Last",
        ">On",
    ];
    table("wide", "What each signal did", &headings, &rows)
}

/// The share of the run during which a bool was on.
#[expect(clippy::cast_precision_loss, reason = "a share, for people")]
fn share_on(signal: &Signal, run: &Run) -> Option<f64> {
    let (begin, end) = run.extent();
    if signal.kind != SignalKind::Bool || begin == end || signal.resolution() != Nanos::ZERO {
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
