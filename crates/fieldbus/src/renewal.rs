//! Which requests keep values young that their client wrote before.

use tickbus_base::time::Nanos;

/// Whether requests of one client that write nothing keep the values of a station young: once it has written, and after a
/// silence in which its values became stale either when it writes again, or when it has gone on asking for `max_age`. A client that
/// was held up may read before it writes, and what it wrote then is old; one that writes only changes has nothing to write.
#[derive(Clone, Copy, Debug)]
pub struct Renewal {
    has_written: bool,
    /// When it asked last.
    asked: Nanos,
    /// From when on such requests count.
    counts_from: Nanos,
}

impl Renewal {
    /// Of a client that has written nothing yet, or, if it is the only one that the line can have, may have.
    pub const fn new(has_written: bool) -> Self {
        Self {
            has_written,
            asked: Nanos(i64::MIN),
            counts_from: Nanos(i64::MIN),
        }
    }

    /// The client has written at `now`.
    pub fn wrote(&mut self, now: Nanos) {
        *self = Self {
            has_written: true,
            asked: now,
            counts_from: now,
        };
    }

    /// The client asks at `now`, and writes nothing: whether that keeps values young which are stale after `max_age`.
    pub fn counts(&mut self, now: Nanos, max_age: Nanos) -> bool {
        let before = std::mem::replace(&mut self.asked, now);
        if now.0.saturating_sub(before.0) > max_age.0 {
            self.counts_from = now + max_age;
        }
        self.has_written && now >= self.counts_from
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAX_AGE: Nanos = Nanos(100);

    #[test]
    fn a_client_that_only_reads_does_not_count() {
        let mut renewal = Renewal::new(false);
        assert!((0..10).all(|time| !renewal.counts(Nanos(time * 50), MAX_AGE)));
    }

    #[test]
    fn a_client_that_was_silent_counts_when_it_writes_or_has_asked_for_long_enough() {
        let mut renewal = Renewal::new(false);
        renewal.wrote(Nanos(0));
        assert!(renewal.counts(Nanos(100), MAX_AGE));
        assert!(!renewal.counts(Nanos(201), MAX_AGE), "what it wrote is old");
        assert!(!renewal.counts(Nanos(300), MAX_AGE));
        assert!(
            renewal.counts(Nanos(301), MAX_AGE),
            "it writes only changes"
        );
        assert!(!renewal.counts(Nanos(500), MAX_AGE));
        renewal.wrote(Nanos(501));
        assert!(renewal.counts(Nanos(502), MAX_AGE));
    }

    #[test]
    fn the_only_client_of_a_line_counts_once_it_has_asked_for_long_enough() {
        let mut renewal = Renewal::new(true);
        let counts = [0, 50, 100].map(|time| renewal.counts(Nanos(time), MAX_AGE));
        assert_eq!(counts, [false, false, true]);
    }
}
