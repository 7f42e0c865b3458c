//! Simulation time beside the clock on the wall.

use tickbus_base::time::Nanos;

/// How late a step may be and still be made up for; a later one begins the pace anew.
const LATE: Nanos = Nanos::from_millis(100);

/// How fast simulation time may pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RealTime {
    /// Seconds of simulation in one of the clock on the wall; 0 for as many as can. Never negative.
    pub pace: f64,
    /// The time at which the pace began: the simulation's, and the clock's.
    begun: Option<(Nanos, Nanos)>,
    /// The time on the clock that stalls have taken.
    lost: Nanos,
}

impl RealTime {
    /// A pace, which begins with the first step.
    pub const fn new(pace: f64) -> Self {
        Self {
            pace,
            begun: None,
            lost: Nanos::ZERO,
        }
    }

    /// How far simulation time has fallen behind the clock: the sum of all stalls of more than 100 ms.
    pub const fn lost(&self) -> Nanos {
        self.lost
    }

    /// Until when to wait at `now` when the simulation has come to `time`; `None` for not at all.
    ///
    /// After a stall, what was missed is not made up for in a burst: the other end has not stood still meanwhile.
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
        // A little late: the next ones catch up.
        assert_eq!(twice.due(ms(30), ms(1012)), None);
        assert_eq!(twice.due(ms(50), ms(1013)), Some(ms(1020)));
        assert_eq!(twice.lost(), Nanos::ZERO);
        // A stall: the pace begins here.
        assert_eq!(twice.due(ms(60), ms(2000)), None);
        assert_eq!(twice.due(ms(70), ms(2000)), Some(ms(2005)));
        assert_eq!(twice.lost(), ms(975));
        assert_eq!(twice.due(ms(80), ms(2510)), None);
        assert_eq!(twice.lost(), ms(975 + 500));
        assert_eq!(RealTime::new(0.0).due(ms(70), ms(0)), None);
    }
}
