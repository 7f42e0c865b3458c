//! The values that one end has written, and when.

use crate::stamp::Stamp;

/// A tick of a writer: its number, and when its call returned.
#[derive(Clone, Copy, Debug)]
struct Written {
    life: u64,
    tick: u64,
    ended: i64,
}

/// The ticks and pulses that one end has written.
#[derive(Debug, Default)]
pub(crate) struct Writer {
    written: Vec<Written>,
    /// The times at which pulses were written, to all stations at once.
    pub(crate) pulses: Vec<i64>,
}

impl Writer {
    /// Begins a tick.
    pub(crate) fn begin(&mut self, life: u64, tick: u64) {
        self.written.push(Written {
            life,
            tick,
            ended: i64::MAX,
        });
    }

    /// Ends the tick.
    pub(crate) fn end(&mut self, now: i64) {
        if let Some(written) = self.written.last_mut() {
            written.ended = now;
        }
    }

    /// The newest tick that was complete at a time, with its life.
    pub(crate) fn newest_at(&self, time: i64) -> Option<(u64, u64)> {
        let after = self
            .written
            .partition_point(|written| written.ended <= time);
        let written = self.written.get(after.checked_sub(1)?)?;
        Some((written.life, written.tick))
    }

    /// Returns true if a stamp was not yet complete at a time.
    pub(super) fn wrote_after(&self, time: i64, Stamp { life, tick, .. }: Stamp) -> bool {
        Some((life, tick)) > self.newest_at(time)
    }

    /// The times at which the ticks `first` to `last` of a life ended.
    pub(super) fn times(&self, life: u64, first: u64, last: u64) -> Vec<i64> {
        let of_life = self.written.iter().rev();
        let ticks = of_life
            .take_while(|written| (written.life, written.tick) >= (life, first))
            .filter(|written| (written.life, written.tick) <= (life, last));
        let mut times: Vec<i64> = ticks.map(|written| written.ended).collect();
        times.reverse();
        times.retain(|time| *time < i64::MAX);
        times
    }

    pub(super) fn has_begun(&self, life: u64, tick: u64) -> bool {
        let newest = self.written.last();
        newest.is_some_and(|newest| (life, tick) <= (newest.life, newest.tick))
    }

    /// When the writer's last tick before `now` ended.
    pub(super) fn last_ended(&self, now: i64) -> Option<i64> {
        let after = self.written.partition_point(|written| written.ended <= now);
        Some(self.written.get(after.checked_sub(1)?)?.ended)
    }

    /// Returns true while a tick is running.
    pub(super) fn is_ticking(&self) -> bool {
        self.written
            .last()
            .is_some_and(|written| written.ended == i64::MAX)
    }
}
