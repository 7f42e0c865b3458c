//! Keeps simulation time in step with the wall clock.

use tickbus_base::time::Nanos;

/// The largest delay that later steps make up for; after a longer one the pace restarts.
const LATE: Nanos = Nanos::from_millis(100);

/// Limits how fast simulation time passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RealTime {
    /// Seconds of simulation per second of the wall clock; 0 for as fast as possible. Never negative.
    pub pace: f64,
    /// The simulation time and the clock time at which the pace began.
    begun: Option<(Nanos, Nanos)>,
    /// The clock time lost to stalls.
    lost: Nanos,
    /// How late the last step ended.
    lag: Nanos,
}

impl RealTime {
    /// Creates a pace, which begins with the first step.
    pub const fn new(pace: f64) -> Self {
        Self {
            pace,
            begun: None,
            lost: Nanos::ZERO,
            lag: Nanos::ZERO,
        }
    }

    /// Returns how late the last step ended; zero if it had to wait, or if nothing keeps it to the clock.
    pub const fn lag(&self) -> Nanos {
        self.lag
    }

    /// Returns the simulation time that passes in a span of the clock; zero if nothing keeps it to the clock.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "exact for 100 days"
    )]
    pub fn span(&self, clock: Nanos) -> Nanos {
        Nanos((clock.0 as f64 * self.pace) as i64)
    }

    /// Returns how far simulation time has fallen behind the clock: the sum of all stalls of more than 100 ms.
    pub const fn lost(&self) -> Nanos {
        self.lost
    }

    /// Returns the time until which to wait, when at `now` the simulation has reached `time`; `None` for no wait.
    ///
    /// After a stall, the missed time is not made up for in a burst: the other end did not stop meanwhile.
    pub fn due(&mut self, time: Nanos, now: Nanos) -> Option<Nanos> {
        if self.pace <= 0.0 {
            return None;
        }
        let (from, begun) = *self.begun.get_or_insert((time, now));
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            reason = "exact for 100 days"
        )]
        let due = begun + Nanos(((time - from).0 as f64 / self.pace) as i64);
        self.lag = (now - due).max(Nanos::ZERO);
        if now > due + LATE {
            self.begun = Some((time, now));
            self.lost += now - due;
            return None;
        }
        (now < due).then_some(due)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(millis: i64) -> Nanos {
        Nanos::from_millis(millis)
    }

    #[test]
    fn steps_wait_for_the_clock_and_a_stall_is_not_made_up_for() {
        let mut twice = RealTime::new(2.0);
        assert_eq!(twice.due(ms(10), ms(1000)), None);
        assert_eq!(twice.due(ms(20), ms(1001)), Some(ms(1005)));
        // A little late: the next steps catch up.
        assert_eq!(twice.due(ms(30), ms(1012)), None);
        assert_eq!(twice.lag(), ms(2));
        assert_eq!(twice.due(ms(50), ms(1013)), Some(ms(1020)));
        assert_eq!((twice.lag(), twice.lost()), (Nanos::ZERO, Nanos::ZERO));
        // A stall: the pace restarts here.
        assert_eq!(twice.due(ms(60), ms(2000)), None);
        assert_eq!(twice.due(ms(70), ms(2000)), Some(ms(2005)));
        assert_eq!(twice.lost(), ms(975));
        assert_eq!(twice.due(ms(80), ms(2510)), None);
        assert_eq!(twice.lost(), ms(975 + 500));
        assert_eq!(RealTime::new(0.0).due(ms(70), ms(0)), None);
        assert_eq!(
            (twice.span(ms(5)), RealTime::new(0.0).span(ms(5))),
            (ms(10), Nanos::ZERO)
        );
    }
}
