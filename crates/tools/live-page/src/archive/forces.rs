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

    /// The time of the tick in which a fault began, as far as the history has it.
    pub(super) fn time_of(&self, mark: &Mark) -> Option<Nanos> {
        let find = || {
            self.history
                .at(Moment::Tick(mark.tick))
                .map(|tick| tick.time)
        };
        mark.at.or_else(find)
    }

    /// The value of a signal that is forced since a time, at another time; `own` is the value without the force when it
    /// began.
    pub(super) fn forced(&self, force: Force, own: Option<Slot>, passed: Nanos) -> Option<Slot> {
        match force.effect {
            SignalEffect::Stuck(value) => value,
            SignalEffect::Ramp { to, within, .. } if passed >= within => Some(to),
            SignalEffect::Ramp { from, to, within } => {
                let signal = &self.facts.table.signals[force.signal];
                Some(between(signal, (from.or(own)?, to), (passed, within)))
            }
            _ => None,
        }
    }

    /// Puts the value of a signal that is forced since a time into the values of a tick.
    pub(super) fn apply(&self, force: Force, since: Nanos, now: Nanos, values: &mut [Slot]) {
        // Without the first value, the tick's own one is nearest to it.
        let begun = || {
            self.history
                .at(Moment::Time(since))
                .map(|it| it.values[force.signal])
        };
        let own = match force.effect {
            SignalEffect::Ramp { from: None, .. } => begun().unwrap_or(values[force.signal]),
            _ => values[force.signal],
        };
        if let Some(value) = self.forced(force, Some(own), now - since) {
            values[force.signal] = value;
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
        let is_of = |mark: &Mark| mark.force.is_some_and(|force| force.signal == signal);
        // The forces in their order; the second of two at the same time counts.
        let mut turns: Vec<(Nanos, Option<Slot>)> = Vec::new();
        let mut on: Option<String> = None;
        for mark in self.timed_marks().into_iter().filter(is_of) {
            let (Some(at), Some(force)) = (mark.at, mark.force) else {
                continue;
            };
            // A ramp that is replaced or released on its way.
            while turns.last().is_some_and(|(last, _)| *last > at) {
                turns.pop();
            }
            if mark.begins {
                on = Some(mark.text);
                let own = points.iter().rev().find(|(time, _)| *time <= at);
                let own = own.and_then(|(_, value)| *value).or_else(|| {
                    // The ramp began before the first of these points.
                    let is_open = matches!(force.effect, SignalEffect::Ramp { from: None, .. });
                    let tick = is_open
                        .then(|| self.history.at(Moment::Time(at)))
                        .flatten()?;
                    Some(tick.values[signal])
                });
                let (steps, length) = match force.effect {
                    SignalEffect::Ramp { within, .. } => (STEPS, within),
                    _ => (0, Nanos::ZERO),
                };
                for step in 0..=steps {
                    let passed = Nanos(length.0 / STEPS * step);
                    let passed = if step == STEPS { length } else { passed };
                    turns.push((at + passed, self.forced(force, own, passed)));
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
