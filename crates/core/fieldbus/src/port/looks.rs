//! The times at which the bus looked at its line, and the age of the data that it finds there.

use tickbus_base::time::Nanos;

/// The shortest time between two looks at an idle line, however short `max_age` is: more looks would keep a processor
/// busy.
const LEAST_REST: Nanos = Nanos::from_millis(1);

/// The looks of a bus at its line. The data that a look finds have arrived since the previous look, and count as young
/// only if that look was recent. A process that was suspended finds data that arrived during the suspension, however
/// long ago.
#[derive(Debug)]
pub(super) struct Looks {
    /// The limit of age.
    max_age: Nanos,
    /// The last look, since the bus [began](Self::begin) to look at its line.
    last: Option<Nanos>,
    /// The arrival time that counts for the data that this look finds, if the look came too late.
    kept_since: Option<Nanos>,
    /// True if the look has not found everything that waited.
    is_unfinished: bool,
}

impl Looks {
    /// No looks so far.
    pub(super) fn new(max_age: Nanos) -> Self {
        Self {
            max_age,
            last: None,
            kept_since: None,
            is_unfinished: false,
        }
    }

    /// The line is new at `now`, so nothing waits there.
    pub(super) fn begin(&mut self, now: Nanos) {
        (self.last, self.kept_since, self.is_unfinished) = (Some(now), None, false);
    }

    /// The bus looks at its line at `now`.
    pub(super) fn look(&mut self, now: Nanos) {
        let Some(last) = &mut self.last else {
            return;
        };
        let last = std::mem::replace(last, now);
        if !std::mem::take(&mut self.is_unfinished) {
            self.kept_since = None;
        }
        // The limit is twice the promised time, because threads often wake up a little late.
        if now - last > self.rest() + self.rest() {
            self.kept_since.get_or_insert(last);
            // The process may have been suspended after it was told what is there, and before it read the time.
            self.is_unfinished = true;
        }
    }

    /// This look has not found everything: the data that the next look finds may have waited as long.
    pub(super) fn leaves_some(&mut self) {
        self.is_unfinished = true;
    }

    /// The data that are handed in next arrived at `at`.
    pub(super) fn came(&mut self, at: Nanos) {
        self.kept_since = Some(at);
    }

    /// The latest time for the next look; [`Nanos::MAX`] if the bus has not begun to look.
    pub(super) fn next(&self) -> Nanos {
        self.last.map_or(Nanos::MAX, |last| last + self.rest())
    }

    /// The arrival time that counts for data handed in at `now`.
    #[inline]
    pub(super) fn arrival(&self, now: Nanos) -> Nanos {
        let look = self.last.unwrap_or(now);
        self.kept_since.unwrap_or(look).min(now)
    }

    /// The time between two looks at an idle line.
    fn rest(&self) -> Nanos {
        Nanos((self.max_age.0 / 4).max(LEAST_REST.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: i64) -> Nanos {
        Nanos::from_millis(ms)
    }

    /// The looks at a line whose data may be 100 ms old, begun at 1000 ms.
    fn looks() -> Looks {
        let mut looks = Looks::new(at(100));
        looks.begin(at(1000));
        looks
    }

    #[test]
    fn what_a_look_in_time_finds_has_come_now() {
        let mut looks = looks();
        for now in [1025, 1075, 1125] {
            looks.look(at(now));
            assert_eq!(looks.arrival(at(now)), at(now));
            assert_eq!(looks.next(), at(now + 25));
        }
    }

    #[test]
    fn what_is_read_long_after_a_look_counts_as_found_by_that_look() {
        let mut looks = looks();
        looks.look(at(1025));
        // The thread had no processor between the look and the reading.
        assert_eq!(looks.arrival(at(1900)), at(1025));
    }

    #[test]
    fn what_a_late_look_finds_may_have_come_right_after_the_one_before() {
        let mut looks = looks();
        looks.look(at(1051));
        assert_eq!(looks.arrival(at(1051)), at(1000));
        // Suspended in the middle of that look, it has not seen what came meanwhile.
        looks.look(at(1052));
        assert_eq!(looks.arrival(at(1052)), at(1000));
        looks.look(at(1053));
        assert_eq!(looks.arrival(at(1053)), at(1053));
    }

    #[test]
    fn what_a_late_look_leaves_is_as_old() {
        let mut looks = looks();
        looks.look(at(5000));
        looks.leaves_some();
        looks.look(at(5001));
        looks.leaves_some();
        looks.look(at(9000));
        assert_eq!(looks.arrival(at(9000)), at(1000));
        looks.look(at(9001));
        assert_eq!(looks.arrival(at(9001)), at(1000));
        looks.look(at(9002));
        assert_eq!(looks.arrival(at(9002)), at(9002));
    }

    #[test]
    fn a_look_in_time_may_leave_some_too() {
        let mut looks = looks();
        looks.look(at(1010));
        looks.leaves_some();
        looks.look(at(1020));
        assert_eq!(looks.arrival(at(1020)), at(1020));
    }

    #[test]
    fn a_new_line_has_nothing_that_waits() {
        let mut looks = looks();
        looks.look(at(5000));
        looks.leaves_some();
        looks.begin(at(6000));
        assert_eq!(looks.arrival(at(6000)), at(6000));
        looks.look(at(6001));
        assert_eq!(looks.arrival(at(6001)), at(6001));
    }

    #[test]
    fn a_bus_that_does_not_look_promises_nothing() {
        let mut looks = Looks::new(at(100));
        assert_eq!(looks.next(), Nanos::MAX);
        assert_eq!(looks.arrival(at(70)), at(70));
        looks.look(at(900));
        assert_eq!(looks.arrival(at(900)), at(900));
    }

    #[test]
    fn a_short_max_age_does_not_keep_a_processor_busy() {
        let mut looks = Looks::new(Nanos(50_000));
        looks.begin(at(1));
        assert_eq!(looks.next(), at(2));
        looks.look(at(3));
        assert_eq!(looks.arrival(at(3)), at(3));
        looks.look(at(6));
        assert_eq!(looks.arrival(at(6)), at(3));
    }
}
