//! Distributions of time spans.

use std::fmt::Write as _;

use hdrhistogram::Histogram;

use super::Nanos;

/// The resolution at the lower end, in nanoseconds: shorter spans are not distinguished.
const SHORTEST: u64 = 100;
/// The longest distinguished span: an hour. Longer ones count as this.
const LONGEST: i64 = 3_600_000_000_000;
/// Significant decimal digits of the figures.
const DIGITS: u8 = 2;

/// A histogram of time spans from 100 ns to an hour, accurate to 1 %; mean, standard deviation, and the
/// shortest and longest span are exact.
///
/// The size is fixed, some 15 kB; recording allocates nothing.
#[derive(Clone, Debug)]
pub struct TimeHistogram {
    histogram: Histogram<u32>,
    shortest: Nanos,
    longest: Nanos,
    /// The sum of all spans, and of their squares, in nanoseconds: 10^13 spans of an hour fit.
    sum: u128,
    squares: u128,
}

impl TimeHistogram {
    /// An empty histogram.
    pub fn new() -> Self {
        let histogram = Histogram::new_with_bounds(SHORTEST, LONGEST.unsigned_abs(), DIGITS);
        Self {
            histogram: histogram.expect("constant bounds that hdrhistogram takes"),
            shortest: Nanos::MAX,
            longest: Nanos::ZERO,
            sum: 0,
            squares: 0,
        }
    }

    /// Counts one span; a negative one counts as zero.
    pub fn record(&mut self, span: Nanos) {
        self.record_times(span, 1);
    }

    /// Counts a span that occurred this many times.
    pub fn record_times(&mut self, span: Nanos, times: u64) {
        if times == 0 {
            return;
        }
        let span = Nanos(span.0.clamp(0, LONGEST));
        let nanos = span.0.unsigned_abs();
        let mut rest = times;
        while rest > 0 {
            // The bins count in 32 bits.
            let some = u32::try_from(rest).unwrap_or(u32::MAX);
            self.histogram.saturating_record_n(nanos, some);
            rest -= u64::from(some);
        }
        self.shortest = self.shortest.min(span);
        self.longest = self.longest.max(span);
        self.sum += u128::from(nanos) * u128::from(times);
        self.squares += u128::from(nanos) * u128::from(nanos) * u128::from(times);
    }

    /// Becomes a copy of `other`, without allocating memory.
    pub fn copy_from(&mut self, other: &Self) {
        let Self {
            histogram,
            shortest,
            longest,
            sum,
            squares,
        } = self;
        let copied = histogram.set_to(&other.histogram);
        copied.expect("all have the same bounds");
        (*shortest, *longest) = (other.shortest, other.longest);
        (*sum, *squares) = (other.sum, other.squares);
    }

    /// The number of spans.
    pub fn count(&self) -> u64 {
        self.histogram.len()
    }

    /// The span that the fraction `share` of all spans does not exceed: 0.5 gives the median. Zero without
    /// spans.
    pub fn quantile(&self, share: f64) -> Nanos {
        let span = i64::try_from(self.histogram.value_at_quantile(share)).unwrap_or(i64::MAX);
        Nanos(span).min(self.longest)
    }

    /// The mean in nanoseconds; zero without spans.
    pub fn mean(&self) -> f64 {
        match u128::from(self.count()) {
            0 => 0.0,
            count => as_float(self.sum / count) + as_float(self.sum % count) / as_float(count),
        }
    }

    /// The sum of all spans in nanoseconds.
    pub fn sum(&self) -> f64 {
        as_float(self.sum)
    }

    /// The standard deviation in nanoseconds; zero without spans.
    pub fn deviation(&self) -> f64 {
        let count = u128::from(self.count());
        if count == 0 {
            return 0.0;
        }
        // Distances from the mean rounded down, and a correction for that: whole numbers, which lose nothing where the
        // spans are long and their scatter is small.
        let mean = self.sum / count;
        let squares = self.squares + count * mean * mean - 2 * mean * self.sum;
        let off = as_float(self.sum % count) / as_float(count);
        (as_float(squares) / as_float(count) - off * off)
            .max(0.0)
            .sqrt()
    }

    /// The shortest span; zero without spans.
    pub fn shortest(&self) -> Nanos {
        if self.count() == 0 {
            return Nanos::ZERO;
        }
        self.shortest
    }

    /// The longest span; zero without spans.
    pub fn longest(&self) -> Nanos {
        self.longest
    }

    /// The non-empty bins of the histogram: the longest span of each, and its count.
    pub fn steps(&self) -> impl Iterator<Item = (Nanos, u64)> + '_ {
        self.histogram.iter_recorded().map(|step| {
            let longest = i64::try_from(step.value_iterated_to()).unwrap_or(i64::MAX);
            (Nanos(longest), step.count_since_last_iteration())
        })
    }

    /// The distribution as text: at most twelve rows, whose limits grow by a constant factor, each with a bar
    /// for its share.
    pub fn chart(&self) -> String {
        const ROWS: usize = 12;
        const WIDTH: u64 = 40;
        let steps: Vec<(f64, u64)> = self
            .steps()
            .map(|(longest, count)| (longest.as_micros(), count))
            .collect();
        let (Some((first, _)), Some((last, _))) = (steps.first(), steps.last()) else {
            return String::new();
        };
        // Rows narrower than the bins of the histogram would at times be empty.
        let factor = (last / first).powf(1.0 / 11.0).max(1.03);
        let mut rows = vec![(*first, 0_u64)];
        for (longest, count) in &steps {
            while rows.last().is_some_and(|(row, _)| *longest > row * 1.001) && rows.len() < ROWS {
                let next = rows.last().expect("one at least").0 * factor;
                rows.push((next, 0));
            }
            rows.last_mut().expect("one at least").1 += count;
        }
        let most = rows.iter().map(|(_, count)| *count).max().unwrap_or(1);
        let mut text = String::new();
        for (row, count) in rows {
            let bar = (count * WIDTH).div_ceil(most.max(1));
            let bar = "#".repeat(usize::try_from(bar).unwrap_or_default());
            // Writing to a string cannot fail.
            let _ = writeln!(text, "  up to {row:>10.1} us {count:>8}  {bar}");
        }
        text
    }
}

#[expect(clippy::cast_precision_loss, reason = "good to 16 digits")]
fn as_float(number: u128) -> f64 {
    number as f64
}

impl Default for TimeHistogram {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_good_to_one_percent() {
        let mut spans = TimeHistogram::new();
        for micros in 1..=1000 {
            spans.record(Nanos::from_micros(micros));
        }
        for (share, micros) in [(0.5, 500.0), (0.99, 990.0), (1.0, 1000.0)] {
            let got = spans.quantile(share).as_micros();
            assert!((got / micros - 1.0).abs() < 0.01, "{share}: {got}");
        }
        assert_eq!(spans.count(), 1000);
        assert_eq!(spans.steps().map(|(_, count)| count).sum::<u64>(), 1000);
    }

    #[test]
    fn mean_scatter_and_the_ends_are_exact() {
        let mut spans = TimeHistogram::new();
        assert_eq!(
            (spans.shortest(), spans.mean(), spans.deviation()),
            (Nanos::ZERO, 0.0, 0.0)
        );
        for micros in [9_999, 10_001, 10_000, 10_004] {
            spans.record(Nanos::from_micros(micros));
        }
        assert_eq!(spans.shortest(), Nanos::from_micros(9_999));
        assert_eq!(spans.longest(), Nanos::from_micros(10_004));
        let mut none = TimeHistogram::new();
        none.record(Nanos::ZERO);
        assert_eq!(
            (none.quantile(0.5), none.longest()),
            (Nanos::ZERO, Nanos::ZERO)
        );
        assert!((spans.mean() - 10_001_000.0).abs() < 1e-3);
        assert!(
            (spans.deviation() - 3.5_f64.sqrt() * 1e3).abs() < 1e-3,
            "{}",
            spans.deviation()
        );
    }

    #[test]
    fn the_ends_of_the_range_take_what_is_beyond_them() {
        let mut spans = TimeHistogram::new();
        spans.record(Nanos(-5));
        spans.record(Nanos::MAX);
        assert_eq!(spans.count(), 2);
        assert!(spans.longest() >= Nanos::from_secs(3_590));
    }

    #[test]
    fn the_chart_has_all_spans_in_a_few_rows() {
        let mut spans = TimeHistogram::new();
        for micros in [10, 11, 12, 100, 1000, 5000] {
            spans.record(Nanos::from_micros(micros));
        }
        let chart = spans.chart();
        assert!(chart.lines().count() <= 12, "{chart}");
        let counts = chart
            .lines()
            .filter_map(|line| line.split_whitespace().nth(4));
        let counts: Vec<u64> = counts
            .map(|count| count.parse().expect("a count"))
            .collect();
        assert_eq!(counts.iter().sum::<u64>(), 6, "{chart}");
        spans = TimeHistogram::new();
        assert_eq!(spans.chart(), "");
        spans.record(Nanos::from_micros(7));
        assert_eq!(spans.chart().lines().count(), 1);
    }
}
