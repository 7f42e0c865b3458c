//! The marks of faults: those that are kept, their times, and the faults that are on.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::SignalEffect;
use tickbus_record::{Moment, Span, Tick};

use super::{Archive, MOST, Mark};

/// Adds a mark. If there are `most`, the oldest ones go, but not the beginnings of faults that are still on after them.
pub(super) fn keep(marks: &mut VecDeque<Mark>, mark: Mark, most: usize) {
    if marks.len() >= most {
        let dropped: Vec<Mark> = marks.drain(..most / 4).collect();
        for begun in on_after(&dropped).into_iter().rev() {
            marks.push_front(begun.clone());
        }
    }
    marks.push_back(mark);
}

/// The beginnings of the faults that are on after these marks.
fn on_after<'a>(marks: impl IntoIterator<Item = &'a Mark>) -> Vec<&'a Mark> {
    let mut on: Vec<&Mark> = Vec::new();
    for mark in marks {
        on.retain(|other| other.name != mark.name || other.text != mark.text);
        if mark.begins {
            on.push(mark);
        }
    }
    on
}

impl Archive {
    /// Notes the times of the marks, and the values at which ramps begin: their ticks leave the memory.
    pub(super) fn time_marks(&self) {
        let Some(Span { first, last, .. }) = self.history.span() else {
            return;
        };
        let is_kept = |tick: &u64| (first.0..=last.0).contains(tick);
        let due: BTreeSet<u64> = {
            let notes = self.notes();
            let untimed = notes.marks.iter().filter(|mark| mark.at.is_none());
            untimed.map(|mark| mark.tick).filter(is_kept).collect()
        };
        if due.is_empty() {
            return;
        }
        // Each is looked for once, without the lock, since that decodes a part of the history.
        let find = |tick: u64| self.history.at(Moment::Tick(tick)).map(|it| (tick, it));
        let found: BTreeMap<u64, Tick> = due.into_iter().filter_map(find).collect();
        for mark in &mut self.notes().marks {
            if mark.at.is_none()
                && let Some(tick) = found.get(&mark.tick)
            {
                time_mark(mark, tick);
            }
        }
    }

    /// The last `most` of the marks that are wanted, with their times as far as the history has, or had, them.
    pub(super) fn last_marks(&self, most: usize, is_wanted: impl Fn(&Mark) -> bool) -> Vec<Mark> {
        self.time_marks();
        let notes = self.notes();
        let wanted = notes.marks.iter().rev().filter(|mark| is_wanted(mark));
        let mut marks: Vec<Mark> = wanted.take(most).cloned().collect();
        marks.reverse();
        marks
    }

    /// The marks of the ticks that the history has. Of more than `MOST`, some are left out: the bar of time has fewer pixels.
    pub(super) fn marks_of(&self, span: Option<Span>) -> Vec<Mark> {
        let Some(Span { first, last, .. }) = span else {
            return Vec::new();
        };
        let is_kept = |mark: &Mark| (first.0..=last.0).contains(&mark.tick);
        let mut marks = self.last_marks(usize::MAX, is_kept);
        if marks.len() > MOST {
            let pixel = (last.1 - first.1).0 / i64::try_from(MOST).unwrap_or(1) + 1;
            marks.retain(|mark| mark.begins);
            marks.dedup_by_key(|mark| mark.at.map(|at| (at - first.1).0 / pixel));
        }
        marks
    }

    /// The faults that are on at a tick.
    pub(super) fn faults_at(&self, tick: u64) -> Vec<Mark> {
        self.time_marks();
        let notes = self.notes();
        let marks = notes.marks.iter().filter(|mark| mark.tick <= tick);
        on_after(marks).into_iter().cloned().collect()
    }
}

/// Notes the time of a mark's tick.
fn time_mark(mark: &mut Mark, tick: &Tick) {
    // The tick has left the memory meanwhile.
    if tick.number > mark.tick {
        return;
    }
    mark.at = Some(tick.time);
    if let Some(force) = &mut mark.force
        && let SignalEffect::Ramp { from, .. } = &mut force.effect
    {
        *from = from.or(Some(tick.values[force.signal]));
    }
}

impl Mark {
    /// Since when the fault is on, at a tick of the history; long ago if its beginning has left the memory.
    pub(super) fn since(&self) -> Nanos {
        self.at.unwrap_or(Nanos(i64::MIN / 2))
    }
}
