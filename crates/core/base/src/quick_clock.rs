//! A clock for code that reads it millions of times per second.

use std::sync::Arc;

use crate::os::TimeStampCounter;
use crate::time::{Clock, Nanos};

/// The longest span between two reads of the system's clock.
const SPAN: u64 = 1_000_000;

/// The shortest span for measuring the counter's pace.
const SHORTEST: u64 = SPAN / 2;

/// The longest span for measuring the counter's pace: in a longer one the computer may have slept.
const LONGEST: u64 = 1_000_000_000;

/// The most counts that a read of the clock may take, some ten times the usual number. In a longer read the thread was
/// interrupted, so clock and counter do not belong together: the measured pace would be too fast by as much.
const MOST: u64 = 1_000;

/// The share by which the counter is assumed slower than measured, as a power of two: a system that corrects its clock
/// speeds it up by less.
const MARGIN: u32 = 10;

/// The share by which the counter's pace may differ between two spans, as a power of two.
const TOLERANCE: u32 = 6;

/// A clock for code that reads it millions of times per second: between two reads of the system's clock, which are a
/// millisecond apart or less, the time comes from the processor's counter, which takes a third of the time.
///
/// The time is never behind the underlying clock, and at most about 2 us ahead of it, so measured ages are not
/// understated. The time never goes back. A system that corrects its clock by more than one part in a thousand can put
/// the time behind by as much of one millisecond; systems correct their clocks by half of that, unless they have to set
/// the time quickly.
///
/// Each clock belongs to one thread. Its times can be compared with times that other threads read from the underlying
/// clock.
#[derive(Debug)]
pub struct QuickClock {
    clock: Arc<dyn Clock>,
    counter: Option<TimeStampCounter>,
    course: Course,
}

impl QuickClock {
    /// Reads `clock`, with the help of the processor's counter if that can be trusted.
    pub fn new(clock: Arc<dyn Clock>) -> Self {
        let counter = clock.is_steady().then(TimeStampCounter::trusted).flatten();
        Self {
            clock,
            counter,
            course: Course::default(),
        }
    }

    /// The current time.
    #[inline]
    pub fn now(&mut self) -> Nanos {
        let Some(counter) = self.counter else {
            return self.clock.now();
        };
        match self.course.time_at(counter.read()) {
            Some(now) => now,
            None => self.look(counter),
        }
    }

    /// Reads the underlying clock.
    #[cold]
    fn look(&mut self, counter: TimeStampCounter) -> Nanos {
        let before = counter.read();
        let now = self.clock.now();
        self.course.learn([before, counter.read()], now)
    }
}

/// The measured course of the counter.
#[derive(Debug, Default)]
struct Course {
    /// The last read of the clock: the counter before it, and the time.
    count: u64,
    time: Nanos,
    /// The counter after that read.
    count_after: u64,
    /// The number of counts for which the counter gives the time.
    limit: u64,
    /// Nanoseconds per count in the last span, rounded up, in 2^32nds; kept even if unused.
    rate: u64,
    /// The latest time returned: no earlier one may follow.
    latest: Nanos,
}

impl Course {
    /// The time at `count`; `None` if the clock has to be read.
    #[inline]
    fn time_at(&mut self, count: u64) -> Option<Nanos> {
        // Also `None` if the counter went back.
        let since = count.wrapping_sub(self.count);
        if since >= self.limit {
            return None;
        }
        // Below 2^63: the limit is a millisecond.
        let span = ((since * self.rate) >> 32).cast_signed() + 1;
        self.latest = self.latest.max(Nanos(self.time.0 + span));
        Some(self.latest)
    }

    /// The clock showed `now`, with the counter at `counts` before and after that. Returns the time to use.
    fn learn(&mut self, counts: [u64; 2], now: Nanos) -> Nanos {
        self.latest = self.latest.max(now);
        let [before, after] = counts;
        let is_interrupted = after.wrapping_sub(before) > MOST;
        let span = u64::try_from((now - self.time).0).unwrap_or(u64::MAX);
        if is_interrupted || span < SHORTEST {
            return self.latest;
        }
        let rate = Self::rate_of(before.wrapping_sub(self.count_after), span);
        // Two spans in a row must agree before the counter is used.
        let is_even = rate > 0 && rate.abs_diff(self.rate) <= rate >> TOLERANCE;
        self.limit = if is_even { (SPAN << 32) / rate } else { 0 };
        self.rate = rate;
        (self.count, self.count_after) = (before, after);
        self.time = now;
        self.latest
    }

    /// The rate of a counter that counted this many in a span; zero if that is impossible.
    fn rate_of(counts: u64, span: u64) -> u64 {
        // From 16 MHz to 64 GHz.
        if span > LONGEST || counts < span >> 6 || counts > span << 6 {
            return 0;
        }
        let rate = (span << 32) / counts;
        rate + (rate >> MARGIN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::{Manual, Monotonic};

    /// A computer with a counter of 3 counts per nanosecond, and a separate clock.
    struct Computer {
        course: Course,
        nanos: u64,
        count: u64,
        looks: usize,
        /// The time for a read of the clock, one way.
        way: u64,
    }

    impl Computer {
        fn new() -> Self {
            Self {
                course: Course::default(),
                nanos: 5_000_000,
                count: u64::MAX - 1_000,
                looks: 0,
                way: 20,
            }
        }

        fn pass(&mut self, nanos: u64) {
            self.nanos += nanos;
            self.count = self.count.wrapping_add(3 * nanos);
        }

        fn clock(&self) -> Nanos {
            Nanos(i64::try_from(self.nanos).expect("it is small"))
        }

        fn now(&mut self) -> Nanos {
            let count = self.count;
            self.course.time_at(count).unwrap_or_else(|| {
                self.looks += 1;
                self.pass(self.way);
                let now = self.clock();
                self.pass(self.way);
                self.course.learn([count, self.count], now)
            })
        }

        /// Reads the clock until the counter is used.
        fn learnt() -> Self {
            let mut computer = Self::new();
            for _ in 0..4 {
                computer.now();
                computer.pass(600_000);
            }
            computer.now();
            computer
        }
    }

    #[test]
    fn between_two_looks_at_the_clock_the_counter_tells_the_time() {
        let mut computer = Computer::learnt();
        computer.looks = 0;
        let mut last = Nanos::ZERO;
        for _ in 0..100_000 {
            computer.pass(100);
            let before = computer.clock();
            let now = computer.now();
            assert!(now >= before, "behind the clock: {now} at {before}");
            assert!(now - computer.clock() < Nanos(2_000), "far ahead: {now}");
            assert!(now >= last, "back from {last} to {now}");
            last = now;
        }
        assert!(
            computer.looks <= 11,
            "one in a millisecond: {}",
            computer.looks
        );
    }

    #[test]
    fn looks_that_take_long_do_not_put_it_far_ahead() {
        for way in [150, 1_500, 3_000] {
            let mut computer = Computer::learnt();
            computer.way = way;
            for _ in 0..100_000 {
                computer.pass(100);
                let before = computer.clock();
                let now = computer.now();
                assert!(now >= before, "behind the clock: {now} at {before}");
                assert!(now - computer.clock() < Nanos(2_000), "far ahead: {now}");
            }
        }
    }

    #[test]
    fn a_thread_that_paused_looks_at_the_clock() {
        let mut computer = Computer::learnt();
        for pause in [2_000_000, 3_000_000_000, 50_000] {
            computer.pass(pause);
            let before = computer.clock();
            assert!((before..before + Nanos(2_000)).contains(&computer.now()));
        }
    }

    #[test]
    fn a_counter_that_jumps_or_changes_its_pace_is_not_asked_until_it_is_even_again() {
        for jump in [u64::MAX / 2, 1_000_000_000_000, 2 << 40] {
            let mut computer = Computer::learnt();
            computer.count = computer.count.wrapping_sub(jump);
            for _ in 0..10_000 {
                computer.pass(100);
                let before = computer.clock();
                let now = computer.now();
                assert!((before..before + Nanos(2_000)).contains(&now), "{jump}");
            }
        }
        let mut computer = Computer::learnt();
        computer.pass(2_000_000);
        computer.now();
        // At half the pace.
        for _ in 0..5 {
            computer.pass(2_000_000);
            computer.count = computer.count.wrapping_sub(3_000_000);
            let (before, looks) = (computer.clock(), computer.looks);
            assert!(computer.now() >= before);
            assert_eq!(computer.looks, looks + 1);
        }
    }

    #[test]
    fn a_look_that_was_interrupted_teaches_nothing() {
        let mut computer = Computer::learnt();
        computer.pass(1_100_000);
        let (count, time) = (computer.course.count, computer.course.time);
        let counts = [computer.count, computer.count.wrapping_add(MOST + 1)];
        let now = computer.clock();
        assert_eq!(computer.course.learn(counts, now), now);
        assert_eq!((computer.course.count, computer.course.time), (count, time));
    }

    #[test]
    fn it_is_never_behind_the_computers_clock() {
        let clock = Monotonic::shared();
        let mut quick = QuickClock::new(Arc::clone(&clock) as _);
        let mut last = Nanos::ZERO;
        let end = clock.now() + Nanos::from_millis(20);
        while last < end {
            let before = clock.now();
            let now = quick.now();
            assert!(now >= before, "{now} at {before}");
            assert!(now >= last);
            last = now;
        }
    }

    #[test]
    fn a_clock_that_is_moved_by_hand_is_looked_at_each_time() {
        let clock = Manual::new();
        let mut quick = QuickClock::new(Arc::clone(&clock) as _);
        for _ in 0..3 {
            clock.advance(Nanos(7));
            assert_eq!(quick.now(), clock.now());
        }
    }
}
