//! The changes of signals over a time, as JSON: all of them, or of very many the extremes.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use tickbus_base::time::Nanos;
use tickbus_record::TrendPoint;

use crate::archive::{Archive, millis, time};
use crate::value::Number;

/// The length of a trend if none is asked for.
const SPAN: Nanos = Nanos::from_secs(300);

/// The most changes of a signal; of more, each of some spans has its first, least, greatest and last value, and
/// the first unknown one.
const MOST_POINTS: usize = 40_000;

/// The most changes of all signals of a request, shared among them.
const MOST_IN_ALL: usize = 240_000;

/// A signal has at least this share.
const LEAST_POINTS: usize = 4_000;

/// The fewest points that a request can limit each signal to: those of one span.
const FEWEST_POINTS: usize = 5;

/// The most signals of one request.
const MOST_TRENDS: usize = 100;

/// The changes within a span that are collected before only their extremes are kept.
const CROWD: usize = 64;

/// The changes of one signal.
#[derive(Debug, Serialize)]
struct Trend {
    ms: Vec<f64>,
    values: Vec<f64>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    is_thin: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    to_ms: Option<f64>,
}

/// The changes of several signals.
#[derive(Debug, Serialize)]
struct Trends {
    to_ms: f64,
    is_sampled: bool,
    signals: BTreeMap<usize, Trend>,
}

/// The trends of signals: `INDEX,INDEX/FROM/TO`, with `/MOST` behind it of about that many points each, or `INDEX` for
/// the last minutes.
pub(crate) fn document(archive: &Archive, path: &str) -> Option<String> {
    let span = archive.history.span();
    let (first, last) = span.map_or((Nanos::ZERO, Nanos::ZERO), |span| {
        (span.first.1, span.last.1)
    });
    let parts: Vec<&str> = path.split('/').collect();
    let (indices, from, to, asked) = match parts[..] {
        [index] => (index, last - SPAN, last, MOST_POINTS),
        [indices, from, to] => (indices, time(from)?, time(to)?, MOST_POINTS),
        [indices, from, to, most] => (indices, time(from)?, time(to)?, most.parse().ok()?),
        _ => return None,
    };
    if !(FEWEST_POINTS..=MOST_POINTS).contains(&asked) {
        return None;
    }
    let indices: Option<BTreeSet<usize>> =
        indices.split(',').map(|index| index.parse().ok()).collect();
    let indices: Vec<usize> = indices?.into_iter().collect();
    let signals = &archive.facts.table.signals;
    if indices.len() > MOST_TRENDS || indices.iter().any(|index| *index >= signals.len()) {
        return None;
    }
    let until = archive.known_until(to.min(last));
    let to = until.max(from);
    let known = (from.max(first), until);
    let share = (MOST_IN_ALL / indices.len().max(1)).clamp(LEAST_POINTS, MOST_POINTS);
    let most = asked.min(share);
    let mut signals: BTreeMap<usize, Trend> = indices
        .iter()
        .copied()
        .zip(collect(archive, &indices, (from, to), known, most))
        .map(|(index, points)| (index, points.trend()))
        .collect();
    let to_ms = millis(until);
    if let (Some(trend), 1) = (signals.values_mut().next(), parts.len()) {
        trend.to_ms = Some(to_ms);
        return serde_json::to_string(&*trend).ok();
    }
    serde_json::to_string(&Trends {
        to_ms,
        is_sampled: archive.facts.is_sampled,
        signals,
    })
    .ok()
}

/// The changes of signals in one pass through the history.
fn collect(
    archive: &Archive,
    indices: &[usize],
    (from, to): (Nanos, Nanos),
    known: (Nanos, Nanos),
    most: usize,
) -> Vec<Points> {
    let signals = &archive.facts.table.signals;
    let wanted: Vec<(usize, Option<usize>)> =
        indices.iter().map(|index| archive.column(*index)).collect();
    let value = |index: usize, slot: Option<_>| {
        slot.map_or(f64::NAN, |slot| Number::of(&signals[index], slot).real())
    };
    let mut all: Vec<Points> = indices.iter().map(|_| Points::new(known, most)).collect();
    // Forced values take the places of the own ones, so that all changes of these signals are needed first.
    let mut own: BTreeMap<usize, Vec<TrendPoint>> = (0..indices.len())
        .filter(|place| archive.has_forces(indices[*place]))
        .map(|place| (place, Vec::new()))
        .collect();
    archive
        .history
        .trends(&wanted, (from, to), |place, at, slot| {
            match own.get_mut(&place) {
                Some(own) => own.push((at, slot)),
                None => all[place].push(at, value(indices[place], slot)),
            }
        });
    for (place, own) in own {
        for (at, slot) in archive.with_forces(indices[place], own, to) {
            all[place].push(at, value(indices[place], slot));
        }
    }
    all
}

/// Collects changes; very many are thinned without losing an extreme.
#[derive(Debug)]
struct Points {
    kept: Vec<(Nanos, f64)>,
    from: Nanos,
    /// The length of a span of which five values are kept.
    length: i64,
    most: usize,
    is_thin: bool,
    /// Where the values of the last span begin.
    begin: usize,
}

impl Points {
    fn new((from, to): (Nanos, Nanos), most: usize) -> Self {
        let spans = i64::try_from(most / FEWEST_POINTS).unwrap_or(1);
        Self {
            kept: Vec::new(),
            from,
            length: ((to - from).0 / spans).max(1),
            most,
            is_thin: false,
            begin: 0,
        }
    }

    fn push(&mut self, at: Nanos, value: f64) {
        if !self.is_thin {
            self.kept.push((at, value));
            if self.kept.len() > self.most {
                self.is_thin = true;
                for (at, value) in std::mem::take(&mut self.kept) {
                    self.push(at, value);
                }
            }
            return;
        }
        let is_other = |begin: &(Nanos, f64)| self.span(begin.0) != self.span(at);
        if self.kept.get(self.begin).is_some_and(is_other) {
            self.thin();
            self.begin = self.kept.len();
        } else if self.kept.len() - self.begin > CROWD {
            self.thin();
        }
        self.kept.push((at, value));
    }

    /// The number of the span of a time.
    fn span(&self, at: Nanos) -> i64 {
        (at - self.from).0 / self.length
    }

    /// Keeps the first, least, greatest and last value of the last span, and the first unknown one.
    fn thin(&mut self) {
        let group = &self.kept[self.begin..];
        let by = |a: &usize, b: &usize| group[*a].1.total_cmp(&group[*b].1);
        let known = || (0..group.len()).filter(|place| !group[*place].1.is_nan());
        // Several can have the same time.
        let places: BTreeSet<usize> = [
            (!group.is_empty()).then_some(0),
            known().min_by(by),
            known().max_by(by),
            group.iter().position(|(_, value)| value.is_nan()),
            group.len().checked_sub(1),
        ]
        .into_iter()
        .flatten()
        .collect();
        let mut ends: Vec<_> = places.into_iter().map(|place| group[place]).collect();
        self.kept.truncate(self.begin);
        self.kept.append(&mut ends);
    }

    fn trend(mut self) -> Trend {
        if self.is_thin {
            self.thin();
        }
        let (ms, values) = self
            .kept
            .iter()
            .map(|(at, value)| (millis(*at), *value))
            .unzip();
        Trend {
            ms,
            values,
            is_thin: self.is_thin,
            to_ms: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_trend_has_every_extreme_and_its_ends() {
        let until = 100_000;
        let mut points = Points::new((Nanos::ZERO, Nanos(until)), 4_000);
        for at in 0..=until {
            // One tick in ten thousand stands out.
            #[expect(clippy::cast_precision_loss, reason = "small numbers")]
            let value = match at % 10_000 {
                4_321 => at as f64,
                4_322 => -(at as f64),
                _ => f64::from(u8::from(at % 2 == 0)),
            };
            points.push(Nanos(at), value);
            assert!(points.kept.len() <= 4_000 + CROWD + 1);
        }
        let trend = points.trend();
        assert!(trend.is_thin);
        assert_eq!((trend.ms[0], trend.ms.last()), (0.0, Some(&0.1)));
        assert!(trend.ms.is_sorted());
        for peak in (0..10).map(|n| n * 10_000 + 4_321) {
            let at = trend
                .ms
                .iter()
                .position(|ms| (ms * 1e6 - f64::from(peak)).abs() < 0.5);
            let at = at.unwrap_or_else(|| panic!("{peak} is lost"));
            assert_eq!(
                trend.values[at..at + 2],
                [f64::from(peak), -f64::from(peak + 1)]
            );
        }
    }

    #[test]
    fn unknown_values_hide_no_peak() {
        let until = 100_000;
        let mut points = Points::new((Nanos::ZERO, Nanos(until)), 4_000);
        for at in 0..=until {
            let value = match at {
                _ if at % 10 == 0 => f64::NAN,
                54_321 => 9.0,
                54_322 => -9.0,
                _ => f64::from(u8::from(at % 2 == 0)),
            };
            points.push(Nanos(at), value);
            assert!(points.kept.len() <= 4_000 + CROWD + 1);
        }
        let trend = points.trend();
        assert!(trend.is_thin && trend.ms.is_sorted());
        let at = trend
            .values
            .iter()
            .position(|value| value.to_bits() == 9.0_f64.to_bits());
        let at = at.expect("the peak is there");
        assert_eq!(trend.values[at + 1].to_bits(), (-9.0_f64).to_bits());
        assert!(trend.values[at - 3..at].iter().any(|value| value.is_nan()));
    }

    #[test]
    fn changes_in_the_same_nanosecond_stay_apart() {
        let mut points = Points::new((Nanos::ZERO, Nanos(1_000)), 5_000);
        for change in 0..10_000 {
            points.push(Nanos(change / 10), f64::from(u8::from(change % 2 == 1)));
        }
        let trend = points.trend();
        assert!(trend.is_thin && trend.ms.is_sorted());
        let edges = trend.values.windows(2).filter(|pair| pair[0] < pair[1]);
        assert!(edges.count() >= 1_000, "{:?}", trend.values);
    }

    #[test]
    fn few_changes_stay_as_they_are() {
        let mut points = Points::new((Nanos::ZERO, Nanos(9)), 4_000);
        points.push(Nanos(1), f64::NAN);
        points.push(Nanos(5), 2.5);
        let json = serde_json::to_string(&points.trend()).expect("numbers");
        assert_eq!(json, r#"{"ms":[1e-6,5e-6],"values":[null,2.5]}"#);
    }
}
