//! Whether a simulation goes on, by the time that it sends.

use tickbus_base::time::Nanos;

/// What the time of a simulation tells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Simulation {
    /// Nothing was seen of it yet.
    #[default]
    Unknown,
    /// Its time goes on.
    Running,
    /// Its time stands still: it is paused, or has ended with the line still up.
    Stopped,
}

/// Watches the time that a simulation sends: a time that goes back is a restart, one that stands still a stop.
#[derive(Clone, Copy, Debug, Default)]
pub struct SimulationTime {
    /// What it tells, as of the last call.
    pub state: Simulation,
    /// The simulation was started again, for one call: state machines begin anew.
    pub restarted: bool,
    last: Option<f64>,
    moved: Nanos,
}

impl SimulationTime {
    /// Evaluates the block with the simulation's time in seconds; it stands still once it has not changed for
    /// longer than `limit`. A call without a time, since the line is down, changes nothing: whoever comes back with
    /// an earlier time was restarted meanwhile.
    pub fn call(&mut self, now: Nanos, seconds: Option<f64>, limit: Nanos) -> Simulation {
        self.restarted = false;
        let Some(seconds) = seconds.filter(|seconds| !seconds.is_nan()) else {
            // Nobody is to blame for what did not come.
            self.moved = now;
            return self.state;
        };
        match self.last {
            Some(last) if seconds < last => {
                self.restarted = true;
                self.moved = now;
                self.state = Simulation::Running;
            }
            Some(last) if seconds > last => {
                self.moved = now;
                self.state = Simulation::Running;
            }
            Some(_) => {
                if now - self.moved > limit {
                    self.state = Simulation::Stopped;
                }
            }
            None => self.moved = now,
        }
        self.last = Some(seconds);
        self.state
    }
}

#[cfg(test)]
mod tests {
    use super::Simulation::{Running, Stopped, Unknown};
    use super::*;

    #[test]
    fn a_time_that_goes_back_is_a_restart_and_one_that_stands_still_a_stop() {
        let mut block = SimulationTime::default();
        let mut told = Vec::new();
        for (millis, seconds) in [
            (0, Some(5.0)),
            (10, Some(5.01)),
            (20, Some(5.01)),
            (110, Some(5.01)),
            (130, Some(5.01)),
            (140, Some(5.02)),
            (150, Some(0.0)),
            (160, Some(0.01)),
            (170, Some(f64::NAN)),
            (900, None),
            (910, Some(0.01)),
            (920, Some(0.005)),
        ] {
            let state = block.call(Nanos::from_millis(millis), seconds, Nanos::from_millis(100));
            told.push((state, block.restarted));
        }
        assert_eq!(
            told,
            [
                (Unknown, false),
                (Running, false),
                (Running, false),
                (Running, false),
                (Stopped, false),
                (Running, false),
                (Running, true),
                (Running, false),
                (Running, false),
                (Running, false),
                (Running, false),
                (Running, true),
            ]
        );
    }
}
