//! The changes of single columns.

use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;

use super::block::{Cursor, is_stale};
use super::{History, TrendPoint};
use crate::Tick;

impl History {
    /// The changes of columns between two times, both included, in one pass: first each value at `from`, or at the oldest
    /// tick. `wanted` has each column once, with the station whose stale data have no value, by its index in
    /// [`Columns::stations`](crate::Columns::stations): without any stations, the status of the whole exchange counts;
    /// `None` if the values are never stale. `each` gets the place in `wanted`, the time and the value.
    pub fn trends(
        &self,
        wanted: &[(usize, Option<usize>)],
        (from, to): (Nanos, Nanos),
        mut each: impl FnMut(usize, Nanos, Option<Slot>),
    ) {
        let mut places: Vec<Option<usize>> = vec![None; self.kinds.len()];
        for (place, (column, _)) in wanted.iter().enumerate() {
            places[*column] = Some(place);
        }
        let seen = |tick: &Tick, place: usize| {
            let (column, station) = wanted[place];
            let status = station.map(|station| tick.stations.get(station).unwrap_or(&tick.status));
            let is_live = status.is_none_or(|status| !is_stale(*status));
            is_live.then(|| tick.values[column])
        };
        let mut last: Vec<Option<Slot>> = vec![None; wanted.len()];
        // The time of the first values, once they are known, and whether `each` has them.
        let mut begin = None;
        let mut has_begun = false;
        for block in self.blocks(from, to) {
            let is_quiet =
                !block.has_turn && !wanted.iter().any(|(column, _)| block.has_changed(*column));
            if is_quiet && begin.is_some() {
                continue;
            }
            let mut cursor = Cursor::new(&block, &self.kinds);
            while cursor.step() {
                let time = cursor.tick.time;
                if time > to {
                    break;
                }
                if time <= from || begin.is_none() {
                    begin = Some(time.max(from));
                    for (place, last) in last.iter_mut().enumerate() {
                        *last = seen(&cursor.tick, place);
                    }
                    if is_quiet {
                        break;
                    }
                    continue;
                }
                if let (Some(begin), false) = (begin, has_begun) {
                    has_begun = true;
                    for (place, value) in last.iter().enumerate() {
                        each(place, begin, *value);
                    }
                }
                let mut look = |place: usize| {
                    let value = seen(&cursor.tick, place);
                    if last[place] != value {
                        last[place] = value;
                        each(place, time, value);
                    }
                };
                if cursor.turned.is_some() {
                    (0..wanted.len()).for_each(look);
                } else {
                    let touched = cursor.touched.iter();
                    touched
                        .filter_map(|column| places[*column])
                        .for_each(&mut look);
                }
            }
        }
        if let (Some(begin), false) = (begin, has_begun) {
            for (place, value) in last.iter().enumerate() {
                each(place, begin, *value);
            }
        }
    }

    /// The changes of one column, as [`trends`](Self::trends) finds them.
    pub fn trend(
        &self,
        column: usize,
        station: Option<usize>,
        span: (Nanos, Nanos),
    ) -> Vec<TrendPoint> {
        let mut points = Vec::new();
        self.trends(&[(column, station)], span, |_, time, value| {
            points.push((time, value));
        });
        points
    }
}
