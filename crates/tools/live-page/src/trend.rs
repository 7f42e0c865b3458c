//! The last minutes of every signal.

use std::collections::VecDeque;

use tickbus_base::time::Nanos;

/// The length of a trend.
const SPAN: Nanos = Nanos::from_secs(300);

/// The shortest time step.
const STEP: Nanos = Nanos::from_millis(500);

/// The most entries of one driver, of 32 bytes each. Drivers with more signals have longer steps.
const ENTRIES: i64 = 1 << 20;

/// The values of a driver's signals in time steps: the least, the greatest and the last one of each step, so that no
/// pulse that was seen gets lost.
#[derive(Debug)]
pub(crate) struct Trend {
    step: Nanos,
    /// The closed steps, oldest first.
    steps: VecDeque<Step>,
    open: Step,
    /// Per signal, its entry in the open step.
    places: Vec<Option<u32>>,
    /// The values before the oldest step, and the newest values.
    first: Vec<f64>,
    last: Vec<f64>,
    begin: Nanos,
}

/// The signals that changed in a step, unordered while it is open, later in the order of their indices.
#[derive(Debug, Default)]
struct Step {
    at: Nanos,
    /// When the step was closed, which is when the last of its values were seen.
    end: Nanos,
    changed: Vec<Changed>,
}

#[derive(Clone, Copy, Debug)]
struct Changed {
    signal: u32,
    least: f64,
    greatest: f64,
    last: f64,
}

/// A value at a time.
pub(crate) type Point = (Nanos, f64);

impl Trend {
    /// Begins at `now`, with this many signals and no values.
    pub(crate) fn new(now: Nanos, signals: usize) -> Self {
        let values = vec![f64::NAN; signals];
        let signals = i64::try_from(signals).unwrap_or(i64::MAX);
        let all = signals.saturating_mul(SPAN.0 / STEP.0);
        Self {
            step: STEP.times((all / ENTRIES + 1).max(1)),
            steps: VecDeque::new(),
            open: Step {
                at: now,
                end: now,
                changed: Vec::new(),
            },
            places: vec![None; values.len()],
            first: values.clone(),
            last: values,
            begin: now,
        }
    }

    /// A signal has this value now; between the last call and now it also had `extremes`, if there was a pulse.
    pub(crate) fn add(&mut self, signal: usize, value: f64, extremes: Option<[f64; 2]>) {
        let before = self.last[signal];
        if before.total_cmp(&value).is_eq() && extremes.is_none() {
            return;
        }
        self.last[signal] = value;
        let changed = &mut self.open.changed;
        let place = *self.places[signal].get_or_insert_with(|| {
            let place = u32::try_from(changed.len()).unwrap_or(u32::MAX);
            changed.push(Changed {
                signal: u32::try_from(signal).unwrap_or(u32::MAX),
                least: before,
                greatest: before,
                last: before,
            });
            place
        });
        let [low, high] = extremes.unwrap_or([value, value]);
        let entry = &mut changed[place as usize];
        entry.least = entry.least.min(low).min(value);
        entry.greatest = entry.greatest.max(high).max(value);
        entry.last = value;
    }

    /// Closes the open step if it is over.
    pub(crate) fn go_on(&mut self, now: Nanos) {
        if now - self.open.at < self.step {
            return;
        }
        let mut step = std::mem::take(&mut self.open);
        (self.open.at, step.end) = (now, now);
        if !step.changed.is_empty() {
            for entry in &step.changed {
                self.places[entry.signal as usize] = None;
            }
            step.changed.sort_unstable_by_key(|entry| entry.signal);
            step.changed.shrink_to_fit();
            self.steps.push_back(step);
        }
        while self.steps.front().is_some_and(|step| now - step.at > SPAN) {
            let oldest = self.steps.pop_front().unwrap_or_default();
            for entry in oldest.changed {
                self.first[entry.signal as usize] = entry.last;
            }
        }
        self.begin = self.begin.max(now - SPAN);
    }

    /// The values of a signal, as a step line; NaN without a valid value. If a step has just one new value, that was
    /// seen at its end; other values lie somewhere within the step.
    pub(crate) fn of(&self, signal: usize, now: Nanos) -> Vec<Point> {
        let mut points = vec![(self.begin, self.first[signal])];
        let index = u32::try_from(signal).unwrap_or(u32::MAX);
        let closed = self.steps.iter().filter_map(|step| {
            let found = step
                .changed
                .binary_search_by_key(&index, |entry| entry.signal);
            found
                .ok()
                .map(|place| ((step.at, step.end), step.changed[place]))
        });
        let open = self.places[signal]
            .map(|place| ((self.open.at, now), self.open.changed[place as usize]));
        for ((at, end), entry) in closed.chain(open) {
            let mut add = |at: Nanos, value: f64| {
                let is_same = |(_, last): &Point| last.total_cmp(&value).is_eq();
                if !points.last().is_some_and(is_same) {
                    points.push((at.min(now), value));
                }
            };
            // The line ends at the last value; the other extreme precedes it.
            let ends_high = (entry.greatest - entry.last).abs() <= (entry.last - entry.least).abs();
            let (one, other) = if ends_high {
                (entry.least, entry.greatest)
            } else {
                (entry.greatest, entry.least)
            };
            if one.total_cmp(&other).is_ne() {
                add(at, one);
            }
            if other.total_cmp(&entry.last).is_ne() {
                add(Nanos(at.0.midpoint(end.0)), other);
            }
            add(end, entry.last);
        }
        points.push((now, self.last[signal]));
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;

    fn values(trend: &Trend, signal: usize, now: Nanos) -> Vec<f64> {
        let points = trend.of(signal, now);
        assert!(points.is_sorted_by_key(|(at, _)| *at), "{points:?}");
        points.into_iter().map(|(_, value)| value).collect()
    }

    fn known(trend: &Trend, signal: usize, now: Nanos) -> Vec<f64> {
        let values = values(trend, signal, now).into_iter();
        values.filter(|value| !value.is_nan()).collect()
    }

    #[test]
    fn a_trend_has_the_changes_and_the_pulses_between_them() {
        let mut trend = Trend::new(Nanos(0), 2);
        trend.add(0, 0.0, None);
        trend.add(1, 5.0, None);
        trend.add(0, 1.0, None);
        trend.add(0, 0.0, None);
        trend.add(1, 5.0, None);
        trend.go_on(Nanos(SECOND));
        trend.add(0, 0.0, Some([0.0, 1.0]));
        let now = Nanos(SECOND * 3 / 2);
        trend.go_on(now);
        assert_eq!(known(&trend, 0, now), [1.0, 0.0, 1.0, 0.0, 0.0]);
        assert_eq!(known(&trend, 1, now), [5.0, 5.0]);
    }

    #[test]
    fn a_value_that_was_looked_at_once_in_a_step_stands_where_it_was_seen() {
        let mut trend = Trend::new(Nanos(0), 1);
        trend.add(0, 0.0, None);
        for half in 1..=4_i64 {
            let now = Nanos(half * SECOND / 2);
            trend.add(0, f64::from(u8::from(half >= 3)), None);
            trend.go_on(now);
        }
        let points = trend.of(0, Nanos(2 * SECOND));
        let rise = points.iter().find(|(_, value)| *value > 0.5);
        assert_eq!(rise, Some(&(Nanos(3 * SECOND / 2), 1.0)));
    }

    #[test]
    fn what_does_not_count_is_a_gap() {
        let mut trend = Trend::new(Nanos(0), 1);
        for (second, value) in (1..).zip([4.0, f64::NAN, f64::NAN, 5.0]) {
            trend.add(0, value, None);
            trend.go_on(Nanos(second * SECOND));
        }
        let points = trend.of(0, Nanos(5 * SECOND));
        let seconds = points.iter().map(|(at, _)| at.0 / SECOND);
        assert_eq!(seconds.collect::<Vec<_>>(), [0, 1, 2, 4, 5]);
        let gaps = points.iter().map(|(_, value)| value.is_nan());
        assert_eq!(gaps.collect::<Vec<_>>(), [true, false, true, false, false]);
    }

    #[test]
    fn a_trend_forgets_what_is_older_than_five_minutes() {
        let mut trend = Trend::new(Nanos(0), 1);
        for second in 1..=1000_i32 {
            trend.add(0, f64::from(second), None);
            trend.go_on(Nanos(i64::from(second) * SECOND));
        }
        let now = Nanos(1000 * SECOND);
        let points = trend.of(0, now);
        assert!((300..=303).contains(&points.len()), "{}", points.len());
        assert_eq!(points[0].0, Nanos(700 * SECOND));
        assert!(points[0].1 >= 698.0, "{:?}", points[0]);
        assert!(trend.steps.len() <= 301);
    }

    #[test]
    fn many_signals_take_a_bounded_memory() {
        let count = 5_000;
        let mut trend = Trend::new(Nanos(0), count);
        for second in 1..=700_i32 {
            for signal in 0..count {
                trend.add(signal, f64::from(second), None);
            }
            trend.go_on(Nanos(i64::from(second) * SECOND));
        }
        let entries: usize = trend.steps.iter().map(|step| step.changed.len()).sum();
        assert!((700_000..=1_050_000).contains(&entries), "{entries}");
    }
}
