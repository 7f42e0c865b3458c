//! Detects by its time whether a simulation is running.

use tickbus_base::time::Nanos;

/// The state of a simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Simulation {
    /// Nothing has been received from the simulation yet.
    #[default]
    Unknown,
    /// The simulation's time advances.
    Running,
    /// The simulation's time stands still: the simulation is paused, or has ended while the line stays up.
    Stopped,
}

/// Watches the time sent by a simulation: time that goes back means a restart, time that stands still a stop.
#[derive(Clone, Copy, Debug, Default)]
pub struct SimulationTime {
    /// The state as of the last call.
    pub state: Simulation,
    /// True for one call after the simulation was restarted: state machines must start over.
    pub restarted: bool,
    last: Option<f64>,
    moved: Nanos,
}

impl SimulationTime {
    /// Evaluates the block with the simulation's time in seconds; it counts as stopped when it has not
    /// changed for longer than `limit`. A call without a time (the line is down) changes nothing: if the
    /// simulation returns with an earlier time, it was restarted in between.
    pub fn call(&mut self, now: Nanos, seconds: Option<f64>, limit: Nanos) -> Simulation {
        self.restarted = false;
        let Some(seconds) = seconds.filter(|seconds| !seconds.is_nan()) else {
            // While nothing is received, standing still cannot be judged.
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
