//! Requests that renew the age of values that their client wrote before.

use tickbus_base::time::Nanos;

/// Decides if requests of one client that write nothing renew the age of a station's values. Such requests count once
/// the client has written. After a silence of more than `max_age`, they count again once the client has written, or has
/// sent requests for `max_age`: a client that was held up may read before it writes, and its earlier values are old; a
/// client that writes only changes may have nothing to write.
#[derive(Clone, Copy, Debug)]
pub struct Renewal {
    /// The time of the client's last request.
    asked: Nanos,
    /// The time from which such requests count; `None` until the client has written.
    counts_from: Option<Nanos>,
}

impl Renewal {
    /// The state for a client that has just connected, and has written nothing.
    pub const fn of_new_client() -> Self {
        Self {
            asked: Nanos(i64::MIN),
            counts_from: None,
        }
    }

    /// The state for the only client that a line can have, which may have written before the line was opened.
    pub const fn of_only_client() -> Self {
        Self {
            asked: Nanos(i64::MIN),
            counts_from: Some(Nanos(i64::MIN)),
        }
    }

    /// The client has written at `now`.
    pub fn wrote(&mut self, now: Nanos) {
        *self = Self {
            asked: now,
            counts_from: Some(now),
        };
    }

    /// A request of the client was lost at `now`, and perhaps a write: its values count again as after a silence.
    pub fn lost(&mut self, now: Nanos, max_age: Nanos) {
        self.asked = now;
        if let Some(from) = &mut self.counts_from {
            *from = now + max_age;
        }
    }

    /// Requests of the client to any station were perhaps lost at `now`; `renewals` are those of its stations.
    pub fn lost_all(renewals: &mut [Self], now: Nanos, max_age: Nanos) {
        for renewal in renewals {
            renewal.lost(now, max_age);
        }
    }

    /// The client sends a request at `now` that writes nothing. Returns true if this renews values that become stale
    /// after `max_age`.
    pub fn counts(&mut self, now: Nanos, max_age: Nanos) -> bool {
        let before = std::mem::replace(&mut self.asked, now);
        let Some(from) = &mut self.counts_from else {
            return false;
        };
        if now.0.saturating_sub(before.0) > max_age.0 {
            *from = now + max_age;
        }
        now >= *from
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAX_AGE: Nanos = Nanos(100);

    #[test]
    fn a_client_that_only_reads_does_not_count() {
        let mut renewal = Renewal::of_new_client();
        assert!((0..10).all(|time| !renewal.counts(Nanos(time * 50), MAX_AGE)));
    }

    #[test]
    fn a_client_that_was_silent_counts_when_it_writes_or_has_asked_for_long_enough() {
        let mut renewal = Renewal::of_new_client();
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
    fn a_client_whose_request_was_lost_counts_when_it_writes_or_has_asked_for_long_enough() {
        let mut renewal = Renewal::of_new_client();
        renewal.wrote(Nanos(0));
        renewal.lost(Nanos(50), MAX_AGE);
        let counts = [60, 149, 150].map(|time| renewal.counts(Nanos(time), MAX_AGE));
        assert_eq!(counts, [false, false, true]);
        renewal.lost(Nanos(200), MAX_AGE);
        renewal.wrote(Nanos(210));
        assert!(renewal.counts(Nanos(211), MAX_AGE));
    }

    #[test]
    fn the_only_client_of_a_line_counts_once_it_has_asked_for_long_enough() {
        let mut renewal = Renewal::of_only_client();
        let counts = [0, 50, 100].map(|time| renewal.counts(Nanos(time), MAX_AGE));
        assert_eq!(counts, [false, false, true]);
    }
}
