//! Small figures without a script: SVG within the page.

use maud::{Markup, html};

use super::html::{count, counted, span};
use super::statistics::Distribution;
use tickbus_base::time::{Nanos, TimeHistogram};

/// The width of a distribution's figure, in SVG units.
const WIDTH: f64 = 260.0;

/// The most bars of a histogram.
const MOST_BARS: f64 = 48.0;

/// From the median to the maximum, on a logarithmic scale shared by all `alike`: a box from p50 to p90, a
/// line to p99, a dot at the maximum.
pub(super) fn distribution(of: &Distribution, alike: &[&Distribution]) -> Markup {
    let all = || {
        alike
            .iter()
            .flat_map(|d| [d.values[0], d.values[3]])
            .map(log)
    };
    let low = all().fold(f64::INFINITY, f64::min);
    let high = all().fold(f64::NEG_INFINITY, f64::max);
    let x = |value: f64| {
        let share = if high > low {
            (log(value) - low) / (high - low)
        } else {
            0.5
        };
        6.0 + share.clamp(0.0, 1.0) * (WIDTH - 12.0)
    };
    let [p50, p90, p99, max, _] = of.values.map(x);
    let width = (p90 - p50).max(2.0);
    let line = |from: f64, to: f64| format!("M{from:.1} 8H{to:.1}");
    html! {
        svg class="box" viewBox={ "0 0 " (WIDTH) " 16" } width=(WIDTH) height="16" aria-hidden="true" {
            path class="rail" d={ "M0 8H" (WIDTH) } {}
            path class="line" d=(line(p50, p99)) {}
            path class="thin" d=(line(p99, max)) {}
            rect class="bar" x=(tenths(p50)) y="3" width=(tenths(width)) height="10" {}
            circle class="dot" cx=(tenths(max)) cy="8" r="3.5" {}
        }
    }
}

/// A coordinate in SVG units.
fn tenths(number: f64) -> String {
    format!("{number:.1}")
}

/// The logarithm, limited below at one thousandth.
fn log(value: f64) -> f64 {
    value.max(1e-3).log10()
}

/// A histogram of spans as bars, or a sentence if all spans are equal.
pub(super) fn histogram(
    what: &str,
    spans: &TimeHistogram,
    shortest: Nanos,
    longest: Nanos,
) -> Markup {
    let total = counted(spans.count(), what, &format!("{what}s"));
    if shortest == longest {
        return html! { p { (total) ", each " (span(shortest)) " long." } };
    }
    let [p50, p99] = [0.5, 0.99].map(|share| span(spans.quantile(share)));
    let axis = Axis::new(shortest, longest);
    let bars = axis.bars(spans);
    let most = bars.iter().copied().max().unwrap_or(1).max(1);
    let (wide, high) = (720.0, 160.0);
    let x = |edge: usize| wide * axis.place(edge);
    // A bar that is not empty must be visible, however rare its spans.
    #[expect(clippy::cast_precision_loss, reason = "places in a figure")]
    let height = |bar: u64| (bar as f64 / most as f64 * (high - 12.0)).max(2.0);
    let edges = [(0, "start"), (axis.bars / 2, "middle"), (axis.bars, "end")];
    html! {
        p {
            (total) ": shortest " (span(shortest)) ", median " (p50) ", 99 % at most " (p99) ", longest "
            (span(longest)) "."
        }
        figure {
            svg class="histogram" viewBox={ "0 0 " (wide) " " (high + 24.0) } role="img"
                aria-label={ "Histogram of " (what) "s" } {
                path class="rail" d={ "M0 " (high) "H" (wide) } {}
                @for (place, bar) in bars.iter().enumerate().filter(|(_, bar)| **bar > 0) {
                    rect class="bar" x=(tenths(x(place) + 0.5)) y=(tenths(high - height(*bar)))
                        width=(tenths((x(place + 1) - x(place) - 1.0).max(1.0))) height=(tenths(height(*bar))) {
                        title { (span(axis.edge(place))) " to " (span(axis.edge(place + 1))) ": " (count(*bar)) }
                    }
                }
                @for (edge, anchor) in edges {
                    text x=(tenths(x(edge))) y=(high + 16.0) text-anchor=(anchor) { (span(axis.edge(edge))) }
                }
            }
            figcaption {
                "How many " (what) "s are how long"
                @if axis.is_logarithmic { ", on a logarithmic scale" }
                "; the highest bar has " (count(most)) "."
            }
        }
    }
}

/// The axis of a histogram, divided into bars no narrower than the resolution of the spans.
#[derive(Clone, Copy, Debug)]
struct Axis {
    from: f64,
    to: f64,
    bars: usize,
    is_logarithmic: bool,
}

impl Axis {
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "places in a figure; the number of bars is small"
    )]
    fn new(shortest: Nanos, longest: Nanos) -> Self {
        let (from, to) = (shortest.0.max(1) as f64, longest.0.max(2) as f64);
        let is_logarithmic = to / from > 50.0;
        let fit = if is_logarithmic {
            (to / from).ln() / 0.02
        } else {
            (to - from) / (0.015 * to)
        };
        Self {
            from,
            to,
            bars: fit.clamp(1.0, MOST_BARS) as usize,
            is_logarithmic,
        }
    }

    /// The position of a bar's left edge, from 0 to 1.
    #[expect(clippy::cast_precision_loss, reason = "places in a figure")]
    fn place(self, edge: usize) -> f64 {
        edge as f64 / self.bars as f64
    }

    /// The span at a bar's left edge.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "between the shortest and the longest"
    )]
    fn edge(self, edge: usize) -> Nanos {
        let (share, Self { from, to, .. }) = (self.place(edge), self);
        Nanos(if self.is_logarithmic {
            from * (to / from).powf(share)
        } else {
            from + (to - from) * share
        } as i64)
    }

    /// The number of spans in each bar.
    fn bars(self, spans: &TimeHistogram) -> Vec<u64> {
        let mut bars = vec![0; self.bars];
        for (length, count) in spans.steps() {
            let beyond = (1..self.bars).find(|edge| length < self.edge(*edge));
            bars[beyond.unwrap_or(self.bars) - 1] += count;
        }
        bars
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_histogram_of_one_value_is_a_sentence() {
        let mut spans = TimeHistogram::new();
        let tick = Nanos::from_millis(1);
        (0..1500).for_each(|_| spans.record(tick));
        let text = histogram("interval", &spans, tick, tick).into_string();
        assert_eq!(text, "<p>1,500 intervals, each 1 ms long.</p>");
    }

    #[test]
    fn the_bars_have_all_spans() {
        let mut spans = TimeHistogram::new();
        (1..5000).for_each(|micros| spans.record(Nanos::from_micros(micros)));
        for shortest in [1, 1000, 4990] {
            let axis = Axis::new(Nanos::from_micros(shortest), Nanos::from_micros(4999));
            assert_eq!(axis.bars(&spans).iter().sum::<u64>(), 4999);
            assert!((1..=48).contains(&axis.bars), "{axis:?}");
            assert_eq!(axis.edge(0), Nanos::from_micros(shortest));
        }
    }

    #[test]
    fn figures_stay_within_their_frame() {
        let one = |values: [f64; 5]| Distribution {
            name: String::new(),
            unit: "µs",
            count: 1,
            values,
        };
        for values in [
            [0.0; 5],
            [1.0, 1.0, 1.0, 1.0, 1.0],
            [0.1, 2.0, 1e9, 1e9, 5.0],
        ] {
            let figure = distribution(&one(values), &[&one(values)]).into_string();
            assert!(
                !figure.contains("NaN") && !figure.contains("inf"),
                "{figure}"
            );
        }
    }
}
