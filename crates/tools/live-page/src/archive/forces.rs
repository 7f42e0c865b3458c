//! Forced values in a trend.

use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;
use tickbus_record::TrendPoint;

use super::{Archive, Force, Mark};

impl Archive {
    /// True if a signal has ever been forced.
    pub(crate) fn has_forces(&self, signal: usize) -> bool {
        let is_of = |mark: &Mark| mark.force.is_some_and(|force| force.signal == signal);
        self.is_written(signal) && self.notes().marks.iter().any(is_of)
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
            let (Some(at), Some(Force { value, .. })) = (mark.at, mark.force) else {
                continue;
            };
            if mark.begins {
                on = Some(mark.text);
                turns.push((at, Some(value)));
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
