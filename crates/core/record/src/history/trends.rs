//! The changes of single columns.

use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;

use super::block::{Block, Cursor, is_stale};
use super::{History, TrendPoint};
use crate::Tick;

/// The columns whose changes are looked at: each with the station whose stale data have no value.
type Wanted<'a> = &'a [(usize, Option<usize>)];

/// The value of a column in a tick; `None` while its data are stale.
fn seen(tick: &Tick, (column, station): (usize, Option<usize>)) -> Option<Slot> {
    let status = station.map(|station| tick.stations.get(station).unwrap_or(&tick.status));
    let is_live = status.is_none_or(|status| !is_stale(*status));
    is_live.then(|| tick.values[column])
}

/// True if no tick of a block changes a column that is wanted, or makes data stale or live.
fn is_quiet(block: &Block, wanted: Wanted<'_>) -> bool {
    !block.has_turn && !wanted.iter().any(|(column, _)| block.has_changed(*column))
}

impl History {
    /// The changes of columns between two times, both included, in one pass: first each value at `from`, or at the oldest
    /// tick. `wanted` has each column once, with the station whose stale data have no value, by its index in
    /// [`Columns::stations`](crate::Columns::stations): without any stations, the status of the whole exchange counts;
    /// `None` if the values are never stale. `each` gets the place in `wanted`, the time and the value.
    pub fn trends(
        &self,
        wanted: Wanted<'_>,
        (from, to): (Nanos, Nanos),
        mut each: impl FnMut(usize, Nanos, Option<Slot>),
    ) {
        let mut places: Vec<Option<usize>> = vec![None; self.kinds.len()];
        for (place, (column, _)) in wanted.iter().enumerate() {
            places[*column] = Some(place);
        }
        let mut last: Vec<Option<Slot>> = vec![None; wanted.len()];
        // The time of the first values, once they are known, and whether `each` has them.
        let mut begin = None;
        let mut has_begun = false;
        for block in self.blocks(from, to) {
            let is_quiet = is_quiet(&block, wanted);
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
                        *last = seen(&cursor.tick, wanted[place]);
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
                    let value = seen(&cursor.tick, wanted[place]);
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

    /// Calls `each` with the values of columns, which are those of [`trends`](Self::trends): first at the last tick up to
    /// the number `from`, or at the oldest tick, then at each later tick in which one of them changes; if `is_every`, at
    /// every later tick. Ends early if `each` returns false.
    pub fn follow(
        &self,
        wanted: Wanted<'_>,
        (from, is_every): (u64, bool),
        mut each: impl FnMut((u64, Nanos), &[Option<Slot>]) -> bool,
    ) {
        let blocks = self.blocks(Nanos(i64::MIN), Nanos::MAX);
        let first = blocks.partition_point(|block| block.first.0 <= from);
        let mut values = vec![None; wanted.len()];
        let mut now = values.clone();
        // The tick of the first values, until `each` has them.
        let mut begin = None;
        let mut has_begun = false;
        for block in &blocks[first.saturating_sub(1)..] {
            if (begin.is_some() || has_begun) && !is_every && is_quiet(block, wanted) {
                continue;
            }
            let mut cursor = Cursor::new(block, &self.kinds);
            while cursor.step() {
                let place = (cursor.tick.number, cursor.tick.time);
                let is_first = !has_begun && (begin.is_none() || place.0 <= from);
                if !is_first && !is_every && cursor.turned.is_none() && cursor.touched.is_empty() {
                    continue;
                }
                for (now, wanted) in now.iter_mut().zip(wanted) {
                    *now = seen(&cursor.tick, *wanted);
                }
                if is_first {
                    begin = Some(place);
                    values.clone_from(&now);
                    continue;
                }
                if let Some(begin) = begin.take() {
                    has_begun = true;
                    if !each(begin, &values) {
                        return;
                    }
                }
                if is_every || values != now {
                    values.clone_from(&now);
                    if !each(place, &values) {
                        return;
                    }
                }
            }
        }
        if let Some(begin) = begin {
            each(begin, &values);
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
