//! The curves of a number in two recordings: how much they differ after the best shift.
//!
//! A recorded number holds its value until its next change, so both curves consist of steps, and their mean square
//! difference is computed exactly from the changes. As a function of the shift it consists of straight lines that meet
//! where a change of one curve falls on one of the other. The search looks at a sample of changes first, from coarse to
//! fine, and then computes the exact figure at the shifts that bring most of the sampled changes to changes.

use std::collections::BTreeMap;

use tickbus_base::time::Nanos;
use tickbus_report::Change;

/// How many changes are sampled.
const SAMPLES: usize = 256;

/// Shifts on each side of the centre, in the first pass and in the later ones.
const FIRST_PASS: i64 = 64;
const LATER_PASS: i64 = 4;

/// The search ends at steps of this length.
const FINEST: Nanos = Nanos::from_micros(1);

/// How many of the most frequent distances between changes are computed exactly.
const EXACT: usize = 3;

/// A curve: its changes, and the time for which they are known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curve<'a> {
    pub(super) changes: &'a [Change],
    pub(super) begin: Nanos,
    pub(super) end: Nanos,
}

impl Curve<'_> {
    /// The value at a time; NaN if it is unknown.
    pub(super) fn value(self, at: Nanos) -> f64 {
        let past = self.changes.partition_point(|change| change.at <= at);
        let last = past.checked_sub(1);
        last.map_or(f64::NAN, |last| self.changes[last].value)
    }
}

/// How a number differs after the best shift. Without a time at which both values are known, the differences are NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NumberResult {
    /// How much later the simulated curve is.
    pub shift: Nanos,
    /// The root of the mean square difference, in the signal's unit.
    pub rms: f64,
    /// The greatest difference, without its sign.
    pub greatest: f64,
    /// When the greatest difference begins, on the clock of the real recording.
    pub at: Nanos,
    /// Greatest minus least value of the real recording; of the simulated one, if the real one is constant.
    pub range: f64,
}

impl NumberResult {
    /// (1 − rms / range) (1 − |shift| / W), or 0 if that is less.
    #[expect(clippy::cast_precision_loss, reason = "a figure for people")]
    pub(super) fn likeness(&self, window: Nanos) -> f64 {
        let level = if self.range > 0.0 {
            (1.0 - self.rms / self.range).max(0.0)
        } else {
            f64::from(u8::from(self.rms == 0.0))
        };
        let time = 1.0 - self.shift.0.abs() as f64 / window.0.max(1) as f64;
        level * time.max(0.0)
    }
}

/// Greatest minus least value; NaN if none is known.
fn range(curve: Curve<'_>) -> f64 {
    let values = curve.changes.iter().map(|change| change.value);
    let least = values.clone().fold(f64::NAN, f64::min);
    values.fold(f64::NAN, f64::max) - least
}

/// The difference after the best shift of at most `window`.
pub(super) fn compared(real: Curve<'_>, simulated: Curve<'_>, window: Nanos) -> NumberResult {
    let mut shifts = vec![Nanos::ZERO];
    if real.changes.len() > 1 && simulated.changes.len() > 1 {
        let near = search(real, simulated, window);
        shifts.push(near);
        shifts.extend(frequent(real, simulated, near, window));
    }
    let range = Some(range(real)).filter(|range| *range > 0.0);
    let range = range.unwrap_or_else(|| self::range(simulated));
    let found = shifts.into_iter();
    let found = found.filter_map(|shift| exact(real, simulated, shift));
    let order = |a: &NumberResult, b: &NumberResult| {
        let apart = |found: &NumberResult| found.shift.0.abs();
        a.rms.total_cmp(&b.rms).then(apart(a).cmp(&apart(b)))
    };
    let unknown = NumberResult {
        shift: Nanos::ZERO,
        rms: f64::NAN,
        greatest: f64::NAN,
        at: real.begin,
        range,
    };
    let found = found.min_by(order).unwrap_or(unknown);
    NumberResult { range, ..found }
}

/// The exact difference at a shift.
#[expect(clippy::cast_precision_loss, reason = "shares of a time, for a mean")]
fn exact(real: Curve<'_>, simulated: Curve<'_>, shift: Nanos) -> Option<NumberResult> {
    let begin = real.begin.max(simulated.begin - shift);
    let end = real.end.min(simulated.end - shift);
    if begin >= end {
        return None;
    }
    let mut real = Walk::to(real.changes, begin, Nanos::ZERO);
    let mut simulated = Walk::to(simulated.changes, begin, shift);
    let (mut squares, mut time) = (0.0, 0.0);
    let (mut greatest, mut place) = (0.0, begin);
    let mut now = begin;
    while now < end {
        let next = real.next_at().min(simulated.next_at()).min(end);
        let apart = (real.value - simulated.value).abs();
        // Unknown values, and infinite ones, have no difference.
        if apart.is_finite() {
            let length = (next - now).0 as f64;
            squares += apart * apart * length;
            time += length;
            if apart > greatest {
                (greatest, place) = (apart, now);
            }
        }
        real.pass(next);
        simulated.pass(next);
        now = next;
    }
    (time > 0.0).then(|| NumberResult {
        shift,
        rms: (squares / time).sqrt(),
        greatest,
        at: place,
        range: f64::NAN,
    })
}

/// A curve that is walked along, moved back by a shift.
struct Walk<'a> {
    rest: &'a [Change],
    shift: Nanos,
    value: f64,
}

impl<'a> Walk<'a> {
    fn to(changes: &'a [Change], at: Nanos, shift: Nanos) -> Self {
        let past = changes.partition_point(|change| change.at - shift <= at);
        let last = past.checked_sub(1).map(|last| changes[last].value);
        Self {
            rest: &changes[past..],
            shift,
            value: last.unwrap_or(f64::NAN),
        }
    }

    fn next_at(&self) -> Nanos {
        let next = self.rest.first();
        next.map_or(Nanos::MAX, |change| change.at - self.shift)
    }

    fn pass(&mut self, to: Nanos) {
        while let Some((first, rest)) = self.rest.split_first()
            && first.at - self.shift <= to
        {
            self.value = first.value;
            self.rest = rest;
        }
    }
}

/// Some of the changes of a curve, evenly by their number.
fn sampled(changes: &[Change]) -> impl Iterator<Item = &Change> {
    let count = changes.len().min(SAMPLES);
    (0..count).map(move |sample| &changes[sample * changes.len() / count])
}

/// The shift at which the samples differ least.
fn search(real: Curve<'_>, simulated: Curve<'_>, window: Nanos) -> Nanos {
    // The value before a change and that after it: so a curve that changes too late is as wrong as one that does too early.
    let mut last = f64::NAN;
    let mut points = Vec::with_capacity(2 * SAMPLES);
    for change in sampled(real.changes) {
        let before = Nanos(change.at.0 - 1);
        let past = real.changes.partition_point(|other| other.at <= before);
        last = past
            .checked_sub(1)
            .map_or(last, |past| real.changes[past].value);
        points.push((before, last));
        points.push((change.at, change.value));
    }
    let cost = |shift: Nanos| cost(&points, simulated, shift);
    let mut best = (cost(Nanos::ZERO), Nanos::ZERO);
    let (mut reach, mut pass) = (window, FIRST_PASS);
    loop {
        let step = Nanos((reach.0 / pass).max(1));
        let centre = best.1;
        for place in -pass..=pass {
            let shift = centre + step.times(place);
            if shift.0.abs() > window.0 {
                continue;
            }
            let cost = cost(shift);
            let is_nearer = cost <= best.0 && shift.0.abs() < best.1.0.abs();
            if cost < best.0 || is_nearer {
                best = (cost, shift);
            }
        }
        if step <= FINEST {
            return best.1;
        }
        (reach, pass) = (step.times(2), LATER_PASS);
    }
}

/// The mean square difference at the sampled points; infinite if most of them are outside of the simulated curve.
#[expect(clippy::cast_precision_loss, reason = "a small count")]
fn cost(points: &[(Nanos, f64)], simulated: Curve<'_>, shift: Nanos) -> f64 {
    let (mut squares, mut count) = (0.0, 0_usize);
    let mut past = 0;
    for (at, value) in points {
        let at = *at + shift;
        if at < simulated.begin || at > simulated.end {
            continue;
        }
        past += past_in(&simulated.changes[past..], at);
        let other = past.checked_sub(1);
        let apart = other.map_or(f64::NAN, |last| simulated.changes[last].value - value);
        if apart.is_finite() {
            squares += apart * apart;
            count += 1;
        }
    }
    if count * 2 < points.len() {
        return f64::INFINITY;
    }
    squares / count.max(1) as f64
}

/// How many of these changes are not after `at`, found in steps of doubled length: the next point is near.
fn past_in(changes: &[Change], at: Nanos) -> usize {
    let mut end = 1;
    while end < changes.len() && changes[end].at <= at {
        end *= 2;
    }
    changes[..end.min(changes.len())].partition_point(|change| change.at <= at)
}

/// The most frequent distances from a sampled change to the simulated change next to it, at about this shift.
fn frequent(
    real: Curve<'_>,
    simulated: Curve<'_>,
    near: Nanos,
    window: Nanos,
) -> impl Iterator<Item = Nanos> {
    let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
    // The first change is the initial value, which did not change then.
    for change in sampled(real.changes).filter(|change| change.at > real.begin) {
        let at = change.at + near;
        let past = simulated.changes.partition_point(|other| other.at <= at);
        let beside = [past.checked_sub(1), Some(past)].into_iter().flatten();
        let beside = beside.filter_map(|other| simulated.changes.get(other));
        let nearest = beside.min_by_key(|other| (other.at - at).0.abs());
        let distance = nearest.map(|other| (other.at - change.at).0);
        if let Some(distance) = distance.filter(|distance| distance.abs() <= window.0) {
            *counts.entry(distance).or_default() += 1;
        }
    }
    let mut counts: Vec<(i64, usize)> = counts.into_iter().collect();
    counts.sort_by_key(|(distance, count)| (std::cmp::Reverse(*count), distance.abs()));
    counts
        .into_iter()
        .take(EXACT)
        .map(|(distance, _)| Nanos(distance))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WINDOW: Nanos = Nanos::from_millis(500);

    fn curve(changes: &[Change]) -> Curve<'_> {
        let end = changes.last().map_or(Nanos::ZERO, |last| last.at);
        Curve {
            changes,
            begin: changes.first().map_or(Nanos::ZERO, |first| first.at),
            end: end + Nanos::from_secs(1),
        }
    }

    /// Changes at these milliseconds.
    fn changes(list: &[(i64, f64)]) -> Vec<Change> {
        let change = |(at, value): &(i64, f64)| Change {
            at: Nanos::from_millis(*at),
            value: *value,
        };
        list.iter().map(change).collect()
    }

    fn moved(changes: &[Change], by: Nanos) -> Vec<Change> {
        let change = |change: &Change| Change {
            at: change.at + by,
            value: change.value,
        };
        changes.iter().map(change).collect()
    }

    /// A sine of 0.5 Hz in steps of 10 ms, for 10 s.
    fn sine() -> Vec<Change> {
        let change = |tick: i32| Change {
            at: Nanos::from_millis(i64::from(tick) * 10),
            value: (f64::from(tick) * 0.01 * std::f64::consts::PI).sin() * 100.0,
        };
        (0..1000).map(change).collect()
    }

    #[test]
    fn the_differences_of_steps_are_exact() {
        let real = changes(&[(0, 0.0), (1000, 10.0), (2000, 0.0)]);
        let flat = changes(&[(0, 0.0)]);
        let flat = Curve {
            end: Nanos::from_secs(4),
            ..curve(&flat)
        };
        let real = Curve {
            end: Nanos::from_secs(4),
            ..curve(&real)
        };
        let found = compared(real, flat, WINDOW);
        // One of four seconds differs by 10.
        assert_eq!((found.rms, found.greatest), (5.0, 10.0));
        assert_eq!((found.shift, found.at), (Nanos::ZERO, Nanos::from_secs(1)));
    }

    #[test]
    fn a_sine_that_is_late_and_noisy_is_shifted_back() {
        let real = sine();
        let mut late = moved(&real, Nanos::from_millis(137));
        for (index, change) in late.iter_mut().enumerate() {
            change.value += if index % 2 == 0 { 0.5 } else { -0.5 };
        }
        let found = compared(curve(&real), curve(&late), WINDOW);
        assert_eq!(found.shift, Nanos::from_millis(137));
        assert!((found.rms - 0.5).abs() < 1e-3, "{found:?}");
        assert!((found.greatest - 0.5).abs() < 1e-3, "{found:?}");
    }

    #[test]
    fn curves_without_a_common_time_have_no_difference() {
        let real = changes(&[(0, 1.0), (1, 2.0)]);
        let later = changes(&[(10_000, 1.0), (10_001, 2.0)]);
        assert!(compared(curve(&real), curve(&later), WINDOW).rms.is_nan());
    }

    #[test]
    fn unknown_values_do_not_count() {
        let real = changes(&[(0, 1.0), (1000, f64::NAN), (2000, 1.0)]);
        let other = changes(&[(0, 1.0), (1500, 9.0), (1600, 1.0)]);
        let found = exact(curve(&real), curve(&other), Nanos::ZERO).expect("they overlap");
        assert_eq!((found.rms, found.greatest), (0.0, 0.0));
    }

    proptest! {
        #[test]
        fn a_moved_copy_has_that_shift_and_no_difference(
            steps in proptest::collection::vec((20..2000_i64, -100..100_i32), 8..200),
            by in -400..400_i64,
        ) {
            let mut at = 0;
            let real: Vec<Change> = steps.iter().enumerate().map(|(index, (step, value))| {
                at += step;
                // No two values are equal, so no other shift fits as well.
                let value = f64::from(*value) + f64::from(u32::try_from(index).expect("few")) * 1e-3;
                Change { at: Nanos::from_millis(at), value }
            }).collect();
            let by = Nanos::from_millis(by);
            let late = moved(&real, by);
            let found = compared(curve(&real), curve(&late), WINDOW);
            prop_assert!(found.rms <= 1e-12, "{:?}", found);
            prop_assert_eq!(found.shift, by);
        }
    }
}
