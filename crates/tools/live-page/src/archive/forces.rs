//! Forced values in a trend.

use tickbus_base::time::Nanos;
use tickbus_driver::Force;
use tickbus_fieldbus::faults::{SignalEffect, between};
use tickbus_image::signal::Slot;
use tickbus_record::{Moment, TrendPoint};

use super::{Archive, Mark};

/// The number of steps in which a ramp is drawn.
const STEPS: i64 = 100;

impl Archive {
    /// True if a signal has ever been forced.
    pub(crate) fn has_forces(&self, signal: usize) -> bool {
        let is_of = |mark: &Mark| mark.force.is_some_and(|force| force.signal == signal);
        self.is_written(signal) && self.notes().marks.iter().any(is_of)
    }

    /// The end of the time up to `to` in which all forces are known.
    pub(crate) fn known_until(&self, to: Nanos) -> Nanos {
        let known = self.notes().known;
        let known = known.and_then(|known| self.history.at(Moment::Tick(known)));
        known.map_or(to, |known| to.min(known.time))
    }

    /// The value of a signal that has been forced for some time.
    pub(super) fn forced(&self, force: Force, passed: Nanos) -> Option<Slot> {
        match force.effect {
            SignalEffect::Stuck(value) => value,
            SignalEffect::Ramp { to, within, .. } if passed >= within => Some(to),
            SignalEffect::Ramp { from, to, within } => {
                let signal = &self.facts.table.signals[force.signal];
                Some(between(signal, (from?, to), (passed, within)))
            }
            _ => None,
        }
    }

    /// The changes of a signal between two times, as the other end got them: a forced value in place of what the
    /// simulation wrote meanwhile.
    pub(crate) fn with_forces(
        &self,
        signal: usize,
        points: Vec<TrendPoint>,
        to: Nanos,
    ) -> Vec<TrendPoint> {
        let begin = points.first().map(|(begin, _)| *begin);
        let Some(begin) = begin.filter(|_| self.has_forces(signal)) else {
            return points;
        };
        let last = self.last();
        let is_of = |mark: &Mark| {
            mark.tick <= last && mark.force.is_some_and(|force| force.signal == signal)
        };
        // The forces in their order; the second of two at the same time counts.
        let mut turns: Vec<(Nanos, Option<Slot>)> = Vec::new();
        let mut on: Option<String> = None;
        for mark in self.last_marks(usize::MAX, is_of) {
            let Some(force) = mark.force else { continue };
            let at = mark.since();
            // A ramp that is replaced or released on its way.
            while turns.last().is_some_and(|(last, _)| *last > at) {
                turns.pop();
            }
            if mark.begins {
                on = Some(mark.text);
                let (steps, length) = match force.effect {
                    SignalEffect::Ramp { within, .. } => (STEPS, within),
                    _ => (0, Nanos::ZERO),
                };
                for step in 0..=steps {
                    let passed = Nanos(length.0 / STEPS * step);
                    let passed = if step == STEPS { length } else { passed };
                    turns.push((at + passed, self.forced(force, passed)));
                }
            } else if on.as_ref() == Some(&mark.text) {
                on = None;
                turns.push((at, None));
            }
        }
        let mut forced = None;
        let mut own = points[0].1;
        let mut seen: Vec<TrendPoint> = Vec::new();
        let (mut turns, mut points) = (turns.into_iter().peekable(), points.into_iter().peekable());
        loop {
            let next = turns.peek().map(|(at, _)| (*at).max(begin));
            let change = points.peek().map(|(at, _)| *at);
            let at = match (next, change) {
                (Some(next), Some(change)) => next.min(change),
                (next, change) => match next.or(change) {
                    Some(at) => at,
                    None => return seen,
                },
            };
            if at > to {
                return seen;
            }
            if let Some((_, value)) = points.next_if(|(time, _)| *time <= at) {
                own = value;
            }
            while let Some((_, value)) = turns.next_if(|(time, _)| *time <= at) {
                forced = value;
            }
            let value = forced.or(own);
            if seen.last().is_none_or(|(_, last)| *last != value) {
                seen.push((at, value));
            }
        }
    }
}
