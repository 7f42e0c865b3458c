//! A recording in memory: every change of every tick, as far back as its memory reaches.
//!
//! The recorder's thread feeds a [`History`]; the tick does not know it. Ticks are kept in blocks of some kilobytes. A
//! block begins with the whole state and has the changes of each tick, so any moment is found by decoding one block.
//! When the memory is full, the oldest block goes. Readers share the blocks, and the lock is only held while they take
//! references to them.

mod block;
#[cfg(all(test, not(loom)))]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::float_cmp,
    reason = "tests: random words and small whole numbers"
)]
mod tests;
mod trends;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;

use self::block::{Block, Cursor, is_stale};
use crate::{Columns, Format, Tick, ValueKind};

/// The least size of a block's changes, in bytes.
const LEAST_BLOCK: usize = 16 << 10;

/// A history has at least this many blocks, unless a single state is larger.
const LEAST_BLOCKS: usize = 16;

/// The most outages that are kept.
const MOST_OUTAGES: usize = 10_000;

/// A recording in memory, bounded in bytes.
#[derive(Debug)]
pub struct History {
    columns: Columns,
    kinds: Box<[ValueKind]>,
    /// The most bytes that it takes.
    limit: usize,
    /// The changes of a block, in bytes.
    block: usize,
    kept: Mutex<Kept>,
}

#[derive(Debug)]
struct Kept {
    /// Oldest first; the last one is still open.
    blocks: VecDeque<Arc<Block>>,
    open: Option<Block>,
    /// The bytes of `blocks`.
    bytes: usize,
    /// The last tick, with sums of edges.
    now: Tick,
    /// The outages since the first tick that is kept, oldest first: each with its end, if it has ended.
    outages: VecDeque<(Nanos, Option<Nanos>)>,
}

impl Kept {
    /// Notes whether the data of a tick are stale.
    fn note_outage(&mut self, tick: &Tick) {
        let mut stations = tick.stations.iter().copied();
        let is_now = is_stale(tick.status) || stations.any(is_stale);
        let last = self.outages.back_mut().filter(|(_, end)| end.is_none());
        match (last, is_now) {
            (None, true) => {
                if self.outages.len() == MOST_OUTAGES {
                    self.outages.pop_front();
                }
                self.outages.push_back((tick.time, None));
            }
            (Some((_, end)), false) => *end = Some(tick.time),
            (None, false) | (Some(_), true) => {}
        }
    }

    /// Drops outages that ended before the first tick.
    fn drop_outages(&mut self) {
        let oldest = self.blocks.front().map(|block| &**block);
        let Some(first) = oldest.or(self.open.as_ref()).map(|block| block.first.1) else {
            return;
        };
        let is_over = |outage: &(Nanos, Option<Nanos>)| outage.1.is_some_and(|end| end <= first);
        while self.outages.front().is_some_and(is_over) {
            self.outages.pop_front();
        }
    }
}

/// A moment in a history.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// The last tick up to this number.
    Tick(u64),
    /// The first tick after this number.
    After(u64),
    /// The last tick up to this time.
    Time(Nanos),
}

/// How far a history reaches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Number and time of the oldest tick.
    pub first: (u64, Nanos),
    /// Number and time of the newest tick.
    pub last: (u64, Nanos),
    /// The memory in use, in bytes.
    pub bytes: usize,
    /// True if older ticks were dropped because the memory is full.
    pub is_cut: bool,
}

/// The goal of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// A tick in which this column has another value than in the tick before.
    Change(usize),
    /// A tick in which data become stale, of any station.
    Outage,
}

/// A value from a time on; `None` while the data are stale.
pub type TrendPoint = (Nanos, Option<Slot>);

impl History {
    /// An empty history of ticks with these columns, of at most `limit` bytes.
    pub fn new(columns: Columns, limit: usize) -> Self {
        let state = columns.columns.len() * size_of::<Slot>();
        let kinds = columns.columns.iter().map(|column| column.kind);
        let tick = Tick::new(&columns);
        Self {
            kinds: kinds.collect(),
            block: LEAST_BLOCK.max(2 * state).min(limit / LEAST_BLOCKS).max(1),
            columns,
            limit,
            kept: Mutex::new(Kept {
                blocks: VecDeque::new(),
                open: None,
                bytes: 0,
                now: tick,
                outages: VecDeque::new(),
            }),
        }
    }

    /// The contents of its ticks.
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// The most bytes that it takes.
    pub fn limit(&self) -> usize {
        self.limit
    }

    /// Adds a tick, whose number is larger than that of the tick before. Its values come from
    /// [`ValueKind::kept`].
    pub fn push(&self, tick: &Tick) {
        let mut kept = self.lock();
        kept.note_outage(tick);
        let Kept {
            blocks,
            open,
            bytes,
            now,
            ..
        } = &mut *kept;
        let block = open.get_or_insert_with(|| {
            if blocks.is_empty() && now.number == 0 {
                // The state before the first tick is that of the first tick, so that nothing changes in it.
                now.clone_from(tick);
                now.number = tick.number.wrapping_sub(1);
                for (value, kind) in now.values.iter_mut().zip(&self.kinds) {
                    if *kind == ValueKind::Count {
                        *value = Slot::from_real(0.0);
                    }
                }
            }
            Block::new(now.clone())
        });
        block.push(&self.kinds, tick, now);
        let mut size = block.bytes();
        if block.len() >= self.block
            && let Some(mut full) = open.take()
        {
            full.shrink();
            *bytes += full.bytes();
            size = 0;
            blocks.push_back(Arc::new(full));
        }
        let mut has_dropped = false;
        while *bytes + size > self.limit
            && let Some(oldest) =
                (blocks.len() > usize::from(size == 0)).then(|| blocks.pop_front())
        {
            *bytes -= oldest.map_or(0, |oldest| oldest.bytes());
            has_dropped = true;
        }
        if has_dropped {
            kept.drop_outages();
        }
    }

    /// How far it reaches; `None` before the first tick.
    pub fn span(&self) -> Option<Span> {
        let kept = self.lock();
        let oldest = kept.blocks.front().map(|block| &**block);
        let newest = kept.blocks.back().map(|block| &**block);
        let (oldest, newest) = (
            oldest.or(kept.open.as_ref())?,
            kept.open.as_ref().or(newest)?,
        );
        let open = kept.open.as_ref().map_or(0, Block::bytes);
        Some(Span {
            first: oldest.first,
            last: newest.last,
            bytes: kept.bytes + open,
            is_cut: oldest.first.0 > 1,
        })
    }

    /// The tick of a moment; a moment before the oldest tick means that one, and a moment after the newest that one.
    /// Edge columns have the number of edges since the recording began.
    pub fn at(&self, moment: Moment) -> Option<Tick> {
        let block = {
            let kept = self.lock();
            // The first block whose last tick is not before the moment.
            let is_before = |block: &Block| match moment {
                Moment::Tick(number) => block.last.0 < number,
                Moment::After(number) => block.last.0 <= number,
                // Later ticks can have the same time.
                Moment::Time(time) => block.last.1 <= time,
            };
            let mut at = kept.blocks.partition_point(|block| is_before(block));
            let next = kept.blocks.get(at).map(|block| &**block);
            // A moment between two blocks belongs to the earlier one.
            let is_between = next
                .or(kept.open.as_ref())
                .is_none_or(|block| match moment {
                    Moment::Tick(number) => number < block.first.0,
                    Moment::After(_) => false,
                    Moment::Time(time) => time < block.first.1,
                });
            if is_between && at > 0 {
                at -= 1;
            }
            match kept.blocks.get(at) {
                Some(block) => Arc::clone(block),
                None => Arc::new(
                    kept.open
                        .clone()
                        .or_else(|| kept.blocks.back().map(|block| Block::clone(block)))?,
                ),
            }
        };
        // First the number of steps: a copy of the state at each would take far longer.
        let mut cursor = Cursor::new(&block, &self.kinds);
        let mut steps = 0;
        while cursor.step() {
            let (number, time) = (cursor.tick.number, cursor.tick.time);
            let is_within = match moment {
                Moment::Tick(asked) | Moment::After(asked) => number <= asked,
                Moment::Time(asked) => time <= asked,
            };
            if !is_within {
                // The first tick of all has none before it.
                steps += usize::from(steps == 0 || matches!(moment, Moment::After(_)));
                break;
            }
            steps += 1;
        }
        let mut cursor = Cursor::new(&block, &self.kinds);
        for _ in 0..steps {
            cursor.step();
        }
        (steps > 0).then_some(cursor.tick)
    }

    /// The times in which data of a station are stale, or of any without stations; the last one may still last. At most
    /// the last 10,000.
    pub fn outages(&self) -> Vec<(Nanos, Option<Nanos>)> {
        self.lock().outages.iter().copied().collect()
    }

    /// The nearest tick after the one with this number that is a goal, or before it; its number and time.
    pub fn search(&self, from: u64, is_forward: bool, goal: Goal) -> Option<(u64, Nanos)> {
        let mut blocks = self.blocks(Nanos(i64::MIN), Nanos::MAX);
        if !is_forward {
            blocks.reverse();
        }
        let is_hit = |cursor: &Cursor<'_>| match goal {
            Goal::Change(column) => cursor.touched.contains(&column),
            Goal::Outage => cursor.has_gone_stale(),
        };
        for block in blocks {
            let can_hit = match goal {
                Goal::Change(column) => block.has_changed(column),
                Goal::Outage => block.has_turn,
            };
            let is_aside = if is_forward {
                block.last.0 <= from
            } else {
                block.first.0 >= from
            };
            if !can_hit || is_aside {
                continue;
            }
            let mut cursor = Cursor::new(&block, &self.kinds);
            let mut last = None;
            while cursor.step() {
                let number = cursor.tick.number;
                if !is_forward && number >= from {
                    break;
                }
                if number != from && (number > from) == is_forward && is_hit(&cursor) {
                    last = Some((number, cursor.tick.time));
                    if is_forward {
                        return last;
                    }
                }
            }
            if last.is_some() {
                return last;
            }
        }
        None
    }

    /// Calls `each` with every tick between two times, both included, as the recorder got it; ends early if `each`
    /// returns false.
    pub fn ticks(&self, (from, to): (Nanos, Nanos), mut each: impl FnMut(&Tick) -> bool) {
        let kinds = self.kinds.iter().enumerate();
        let counts: Vec<usize> = kinds
            .filter(|(_, kind)| **kind == ValueKind::Count)
            .map(|(column, _)| column)
            .collect();
        let mut tick = Tick::new(&self.columns);
        for block in self.blocks(from, to) {
            let mut cursor = Cursor::new(&block, &self.kinds);
            let sums = |tick: &Tick| -> Vec<f64> {
                counts
                    .iter()
                    .map(|column| tick.values[*column].real())
                    .collect()
            };
            let mut before = sums(&cursor.tick);
            while cursor.step() {
                let time = cursor.tick.time;
                if time > to {
                    break;
                }
                let now = sums(&cursor.tick);
                if time >= from {
                    tick.clone_from(&cursor.tick);
                    for ((column, now), before) in counts.iter().zip(&now).zip(&before) {
                        tick.values[*column] = Slot::from_real(now - before);
                    }
                    if !each(&tick) {
                        return;
                    }
                }
                before = now;
            }
        }
    }

    /// The ticks between two times, both included, as a file of this format; `None` if it has more than `most` bytes.
    pub fn file(&self, format: Format, span: (Nanos, Nanos), most: usize) -> Option<Vec<u8>> {
        let mut sink = format.sink(self.columns.clone());
        let mut out = Vec::new();
        sink.header(&mut out);
        let (mut ticks, mut dropped) = (0_u64, 0);
        let mut first = None;
        self.ticks(span, |tick| {
            ticks += 1;
            let base = *first.get_or_insert(tick.dropped);
            dropped = tick.dropped - base;
            sink.tick(tick, &mut out);
            out.len() <= most
        });
        sink.end(&format!("ticks={ticks} dropped={dropped}"), &mut out);
        (out.len() <= most).then_some(out)
    }

    /// The blocks with ticks between two times.
    fn blocks(&self, from: Nanos, to: Nanos) -> Vec<Arc<Block>> {
        let kept = self.lock();
        let mut first = kept.blocks.partition_point(|block| block.last.1 < from);
        // The state at `from` is in the block before, unless a block has begun by then.
        let begins = kept.blocks.get(first).map(|block| block.first.1);
        let begins = begins.or(kept.open.as_ref().map(|open| open.first.1));
        if first > 0 && begins.is_none_or(|begins| begins > from) {
            first -= 1;
        }
        let blocks = kept.blocks.range(first..);
        let mut blocks: Vec<_> = blocks
            .take_while(|block| block.first.1 <= to)
            .map(Arc::clone)
            .collect();
        let open = kept.open.as_ref().filter(|open| open.first.1 <= to);
        blocks.extend(open.map(|open| Arc::new(open.clone())));
        blocks
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        // A panic while a tick is added can spoil no block but the open one, and ends the recorder.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
