//! Periodic deadlines.

use super::Nanos;

/// Deadlines at even intervals; a deadline met late does not delay the next one.
///
/// After a stall the missed deadlines are skipped, because a burst would only carry outdated data. The phase is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pace {
    due: Nanos,
    interval: Nanos,
}

impl Pace {
    /// A pace whose first deadline is `first`.
    ///
    /// # Panics
    ///
    /// When the interval is not positive.
    pub fn new(first: Nanos, interval: Nanos) -> Self {
        assert!(interval > Nanos::ZERO, "a rhythm needs an interval");
        Self {
            due: first,
            interval,
        }
    }

    /// The next deadline.
    pub fn due(&self) -> Nanos {
        self.due
    }

    /// If the deadline has come by `now`, advances to the first one after `now`; returns whether it had come.
    pub fn take(&mut self, now: Nanos) -> bool {
        if now < self.due {
            return false;
        }
        let missed = (now - self.due).0 / self.interval.0;
        self.due += self.interval.times(missed.saturating_add(1));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lateness_does_not_add_up() {
        let mut pace = Pace::new(Nanos(0), Nanos(10));
        for now in [0, 13, 20, 39] {
            assert!(pace.take(Nanos(now)));
            assert!(!pace.take(Nanos(now)));
        }
        assert_eq!(pace.due(), Nanos(40));
    }

    #[test]
    fn missed_deadlines_are_left_out() {
        let mut pace = Pace::new(Nanos(0), Nanos(10));
        assert!(pace.take(Nanos(95)));
        assert_eq!(pace.due(), Nanos(100));
        assert!(!pace.take(Nanos(99)));
        assert!(pace.take(Nanos(100)));
    }
}
