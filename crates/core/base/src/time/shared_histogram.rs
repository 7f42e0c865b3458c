//! A distribution that one thread records and others read.

use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::{Nanos, TimeHistogram};

/// A [`TimeHistogram`] that one thread at a time records into while others read it.
///
/// A bus that runs in steps has the same span in every cycle: a span equal to the last one is only counted, without the
/// lock and the search for its bin.
#[derive(Debug)]
pub struct SharedHistogram {
    /// The last span, and the number of its repetitions not yet in `spans`. Both change together under the lock; the
    /// count alone also without it.
    span: AtomicI64,
    times: AtomicU64,
    spans: Mutex<TimeHistogram>,
}

impl SharedHistogram {
    /// An empty distribution.
    pub fn new() -> Self {
        Self {
            span: AtomicI64::new(0),
            times: AtomicU64::new(0),
            spans: Mutex::new(TimeHistogram::new()),
        }
    }

    /// Counts one span. If two threads record at once, spans may be lost.
    #[inline]
    pub fn record(&self, span: Nanos) {
        if span.0 == self.span.load(Ordering::Relaxed) {
            // One thread counts, others only read.
            let times = self.times.load(Ordering::Relaxed);
            self.times.store(times + 1, Ordering::Relaxed);
        } else {
            self.record_another(span);
        }
    }

    #[inline(never)]
    fn record_another(&self, span: Nanos) {
        let mut spans = self.lock();
        self.settle(&mut spans);
        self.span.store(span.0, Ordering::Relaxed);
        self.times.store(1, Ordering::Relaxed);
    }

    /// A copy of the current distribution.
    pub fn read(&self) -> TimeHistogram {
        let spans = self.lock();
        let mut copy = spans.clone();
        self.settle(&mut copy);
        copy
    }

    /// Adds the repetitions to the histogram; under its lock, so that span and count match.
    fn settle(&self, spans: &mut TimeHistogram) {
        let span = Nanos(self.span.load(Ordering::Relaxed));
        spans.record_times(span, self.times.load(Ordering::Relaxed));
    }

    fn lock(&self) -> MutexGuard<'_, TimeHistogram> {
        // A histogram is consistent after every change, so a poisoned lock is safe to use.
        self.spans.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Default for SharedHistogram {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_in_a_row_are_counted_like_any_others() {
        let shared = SharedHistogram::new();
        let mut plain = TimeHistogram::new();
        let spans = [0, 0, 0, 700, 700, 3, -5, -5, 0, i64::MAX, i64::MAX, 12, 12];
        let figures = |times: &TimeHistogram| {
            let steps: Vec<_> = times.steps().collect();
            let of = (times.count(), times.shortest(), times.longest());
            (of, times.mean(), times.deviation(), steps)
        };
        for span in spans {
            shared.record(Nanos(span));
            plain.record(Nanos(span));
            assert_eq!(figures(&shared.read()), figures(&plain), "after {span}");
        }
    }

    #[test]
    fn a_reader_never_sees_a_count_with_the_span_of_another() {
        let shared = SharedHistogram::new();
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| {
                for round in 0..2_000_i64 {
                    for _ in 0..50 {
                        // Long runs of the short span, and the long one alone.
                        shared.record(Nanos(1_000));
                    }
                    shared.record(Nanos(1_000_000 + round % 2));
                }
            });
            let mut before = 0;
            while !writer.is_finished() {
                let found = shared.read();
                assert!(found.count() >= before, "nothing is taken back");
                before = found.count();
                let long: u64 = found
                    .steps()
                    .filter(|(longest, _)| longest.0 > 10_000)
                    .map(|(_, count)| count)
                    .sum();
                assert_eq!(long, before / 51, "of {before}");
            }
        });
        assert_eq!(shared.read().count(), 2_000 * 51);
    }
}
