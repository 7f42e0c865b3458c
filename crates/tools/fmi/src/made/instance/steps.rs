//! Steps, and the event mode between them.

use tickbus_base::time::{Clock as _, Nanos};
use tickbus_driver::{Code, Driver};

use super::super::variables::seconds;
use super::{EventMode, Instance, Phase};

/// The largest distance between the end of a step and the beginning of the next, in seconds, apart from the rounding
/// of doubles.
const TOLERANCE: f64 = 1e-9;

/// The end of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepEnd {
    /// True if a new whole bus cycle has arrived, and the importing tool uses the event mode.
    pub event: bool,
    /// True if the step ended early, at that event.
    pub early: bool,
}

/// The result of an iteration of the event mode. One iteration is enough.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Updated {
    /// True if the bus has ended on its own.
    pub terminate: bool,
    /// The time of the next bus cycle in seconds, if it is known.
    pub next: Option<f64>,
}

impl Instance {
    /// Does one step, from `from` to `from` + `length` seconds: sends the inputs, and receives the outputs at its end.
    ///
    /// If steps can end early, a step ends at the first new bus cycle.
    ///
    /// # Errors
    ///
    /// No bus is open, the step does not follow the last one or goes beyond the stop time, or the line has failed.
    pub fn step(&mut self, from: f64, length: f64) -> Result<StepEnd, String> {
        if self.phase != Phase::Stepping {
            return Err(self.unfit("a step"));
        }
        let to = from + length;
        if !is_near(from, self.time) || length <= 0.0 || !to.is_finite() {
            return Err(not_next(self.time, from, length));
        }
        if let Some(stop) = self.stop_time
            && to > stop
            && !is_near(to, stop)
        {
            return Err(format!(
                "a step from {from} s to {to} s, but the run ends at {stop} s, the stop time of the initialisation: make the \
                 last step shorter, or hand in a later stop time"
            ));
        }
        let (uses_events, is_early) = match self.event_mode {
            EventMode::Unused => (false, false),
            EventMode::Used { early_return } => (true, early_return),
        };
        let last = nanos(to - self.origin);
        loop {
            let Some(driver) = &mut self.driver else {
                return Err(self.unfit("a step"));
            };
            let (granted, is_stepped) = (self.found.granted, driver.is_stepped());
            let now = nanos(self.time - self.origin);
            let next = if is_stepped {
                granted
            } else {
                now + self.real_time.span(self.cycle)
            };
            // A free bus without a pace would bring nothing between two exchanges that follow each other at once.
            let is_cut = is_early && next > now && next < last;
            let at = if is_cut { next } else { last };
            self.found = driver.exchange(at, &mut self.slots);
            if self.found.code.code() >= 0 && driver.is_over() {
                return Ok(StepEnd::default());
            }
            self.time = if is_cut {
                self.origin + seconds(at)
            } else {
                to
            };
            if self.found.code.code() < 0 {
                let reason = driver.link().reason;
                return Err(failed(self.found.code, &reason));
            }
            if self.real_time.pace > 0.0 {
                self.wait(at);
            }
            // On a stepped bus each exchange brings data, but only a scan or a step of the bus brings new ones.
            let is_new = !is_stepped || self.found.granted != granted;
            self.ticks = uses_events && is_new && self.found.code == Code::Fresh;
            if self.ticks || !is_cut {
                return Ok(StepEnd {
                    event: self.ticks,
                    early: is_cut,
                });
            }
        }
    }

    /// Enters the event mode.
    ///
    /// # Errors
    ///
    /// The importing tool has not asked for the event mode, or the instance is not in the step mode.
    pub fn enter_events(&mut self) -> Result<(), String> {
        if self.event_mode == EventMode::Unused {
            return Err(
                "the event mode was not asked for: let the importing tool make the instance with eventModeUsed = true"
                    .to_owned(),
            );
        }
        if self.phase != Phase::Stepping {
            return Err(self.unfit("entering the event mode"));
        }
        self.phase = Phase::Events;
        Ok(())
    }

    /// Does an iteration of the event mode. The clock of bus cycles ticks in the first one only.
    ///
    /// # Errors
    ///
    /// The instance is not in the event mode.
    pub fn update(&mut self) -> Result<Updated, String> {
        if self.phase != Phase::Events {
            return Err(self.unfit("updating discrete states"));
        }
        self.ticks = false;
        let granted = self.found.granted;
        let is_stepped = self.driver.as_ref().is_some_and(Driver::is_stepped);
        let is_known = is_stepped && granted > nanos(self.time - self.origin);
        Ok(Updated {
            terminate: self.is_over(),
            next: is_known.then(|| self.origin + seconds(granted)),
        })
    }

    /// Leaves the event mode for the next step.
    ///
    /// # Errors
    ///
    /// The instance is not in the event mode.
    pub fn leave_events(&mut self) -> Result<(), String> {
        if self.phase != Phase::Events {
            return Err(self.unfit("entering the step mode"));
        }
        self.ticks = false;
        self.phase = Phase::Stepping;
        Ok(())
    }

    /// Waits until the wall clock has reached the simulation time.
    fn wait(&mut self, time: Nanos) {
        let was_late = self.real_time.lost() > Nanos::ZERO;
        let due = self.real_time.due(time, self.clock.now());
        let lost = self.real_time.lost();
        if lost > Nanos::ZERO && !was_late {
            log::warn!(
                "{}: at {time} the simulation is {} behind the clock, and does not catch up; later delays are not logged",
                self.config.name,
                lost.rounded()
            );
        }
        if let Some(due) = due {
            while self.clock.now() < due {
                self.clock.wait_until(due, &self.stop);
            }
        }
    }
}

/// Rounds seconds, which are not negative, to the nearest nanosecond; 292 years at most.
#[inline]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "it saturates, and a number with a fraction is exact as a double"
)]
fn nanos(seconds: f64) -> Nanos {
    let exact = seconds * 1e9;
    let whole = exact as i64;
    // Same result as `round`, which calls the C library on processors that may lack the instruction.
    Nanos(whole.saturating_add(i64::from(exact - whole as f64 >= 0.5)))
}

/// Returns true if two times in seconds are the same, apart from the rounding of doubles.
fn is_near(one: f64, other: f64) -> bool {
    (one - other).abs() <= TOLERANCE + 8.0 * f64::EPSILON * other.abs()
}

#[cold]
fn not_next(time: f64, from: f64, length: f64) -> String {
    if length <= 0.0 || !(from + length).is_finite() {
        return format!("a step of {length} s at {from} s; hand in seconds above 0");
    }
    format!(
        "a step from {from} s, but the last one has ended at {time} s; time cannot go back, and a bus cannot be set back: \
         begin each step where the last one has ended"
    )
}

#[cold]
fn failed(code: Code, reason: &str) -> String {
    let (name, remedy) = (code.name(), code.remedy());
    let what = if reason.is_empty() {
        code.text()
    } else {
        reason
    };
    format!("{name}: {what}; {remedy}")
}
