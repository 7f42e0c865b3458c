//! Event mode of FMI 3.0: lets an FMU's clocks tick at their times.
//!
//! A step of the run is cut at the ticks within it. A tick at its beginning sees the inputs of this step; one at its end
//! belongs to the next step (FMI 3.0, sections 2.2.8 and 4.2).

use serde::{Deserialize, Serialize};

use super::library::{Instance, Interval, StepEnd};
use super::model::{Causality, Clock, ForeignVariable, Model, Timing};
use super::target::Target;
use crate::value::{Status, Value};

/// Times that are nearer than this, in seconds, are one time: half the resolution of simulation time.
const SAME: f64 = 0.5e-9;

/// The most iterations at one time, and the most parts of one step.
const MOST: usize = 10_000;

/// A variable that is set or read only when one of its clocks ticks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Clocked {
    pub target: Target,
    pub clocks: Vec<u32>,
    /// The place among all inputs or outputs.
    pub place: usize,
    pub value: Value,
}

/// The part of a setup that an FMU with clocks needs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct EventSetup {
    pub clocks: Vec<Clock>,
    /// The clocks that the FMU itself lets tick.
    pub own: Vec<u32>,
    pub inputs: Vec<Clocked>,
    pub outputs: Vec<Clocked>,
}

impl EventSetup {
    /// Returns the setup of an FMU that has clocks and an event mode.
    pub(super) fn of(model: &Model, inputs: &[usize], outputs: &[usize]) -> Option<Self> {
        if !model.has_event_mode || model.clocks.is_empty() && model.own_clocks.is_empty() {
            return None;
        }
        let clocked = |list: &[usize]| {
            let list = list.iter().enumerate().filter_map(|(place, at)| {
                let variable: &ForeignVariable = &model.variables[*at];
                (!variable.clocks.is_empty()).then(|| Clocked {
                    target: Target::of(variable).expect("what is joined can be a signal"),
                    clocks: variable.clocks.clone(),
                    place,
                    value: Value::Real(0.0),
                })
            });
            list.collect()
        };
        debug_assert!(
            inputs
                .iter()
                .all(|at| model.variables[*at].causality == Causality::Input),
            "inputs of the FMU"
        );
        Some(Self {
            clocks: model.clocks.clone(),
            own: model.own_clocks.clone(),
            inputs: clocked(inputs),
            outputs: clocked(outputs),
        })
    }

    /// The targets that are handled with each step, and their places.
    pub(super) fn unclocked(targets: &[Target], clocked: &[Clocked]) -> Vec<(usize, Target)> {
        let is_clocked = |place| clocked.iter().any(|one| one.place == place);
        let targets = targets.iter().copied().enumerate();
        targets.filter(|(place, _)| !is_clocked(*place)).collect()
    }
}

/// A clock, and the time of its next tick.
#[derive(Debug)]
struct Running {
    clock: Clock,
    /// The ticks of a periodic clock so far: multiplied, so that no error adds up.
    ticks: f64,
    interval: Option<f64>,
    next: Option<f64>,
}

/// The clocks of a running FMU.
#[derive(Debug)]
pub(super) struct Events {
    clocks: Vec<Running>,
    own: Vec<u32>,
    inputs: Vec<Clocked>,
    pub(super) outputs: Vec<Clocked>,
    start: f64,
    /// The time of the FMU's own next event.
    own_event: Option<f64>,
}

/// The reason why an event could not be handled: a status, and the call that had it.
pub(super) type Refused = (Status, &'static str);

fn good(status: Status, what: &'static str) -> Result<(), Refused> {
    match status {
        Status::Ok | Status::Warning => Ok(()),
        bad => Err((bad, what)),
    }
}

impl Events {
    pub(super) fn of(setup: &EventSetup, start: f64) -> Self {
        let clocks = setup.clocks.iter().map(|&clock| Running {
            clock,
            ticks: 0.0,
            interval: None,
            next: match clock.timing {
                Timing::Periodic { shift, .. } => Some(start + shift),
                Timing::Asked { .. } | Timing::Countdown => None,
            },
        });
        Self {
            clocks: clocks.collect(),
            own: setup.own.clone(),
            inputs: setup.inputs.clone(),
            outputs: setup.outputs.clone(),
            start,
            own_event: None,
        }
    }

    /// Ends the event in which an FMU is after its initialisation. Returns true if the FMU asks to end the run.
    pub(super) fn begin(&mut self, instance: &mut Instance) -> Result<bool, Refused> {
        let is_too_short = |one: &Running| matches!(one.clock.timing, Timing::Periodic { interval, .. } if interval <= SAME);
        if self.clocks.iter().any(is_too_short) {
            return Err((Status::Error, "a clock with an interval of less than 1 ns"));
        }
        self.settle(instance, self.start, &[])
    }

    /// Handles the events of a time. Clocks tick if `ticks` is set. Returns true if the FMU asks to end the run.
    fn event(
        &mut self,
        instance: &mut Instance,
        now: f64,
        ticks: bool,
        set: &mut dyn FnMut(&mut Instance) -> Status,
    ) -> Result<bool, Refused> {
        good(instance.enter_events(), "entering the event mode")?;
        let is_due = |one: &&mut Running| ticks && one.next.is_some_and(|next| next <= now + SAME);
        let mut due = Vec::new();
        for one in self.clocks.iter_mut().filter(|one| is_due(one)) {
            due.push(one.clock.reference);
            one.ticks += 1.0;
            one.next = match one.clock.timing {
                Timing::Periodic { interval, shift } => {
                    Some(self.start + shift + one.ticks * interval)
                }
                Timing::Asked { .. } => one.interval.map(|interval| now + interval),
                Timing::Countdown => None,
            };
        }
        if !due.is_empty() {
            good(instance.tick(&due), "letting its clocks tick")?;
        }
        good(set(instance), "setting its inputs")?;
        for input in &self.inputs {
            if input.clocks.iter().any(|clock| due.contains(clock)) {
                let status = input.target.set(instance, input.value);
                good(status, "setting its inputs")?;
            }
        }
        self.settle(instance, now, &due)
    }

    /// Iterates until nothing changes any more, and leaves the event mode.
    fn settle(&mut self, instance: &mut Instance, now: f64, due: &[u32]) -> Result<bool, Refused> {
        let mut ticking = due.to_vec();
        let mut ends = false;
        for _ in 0..MOST {
            if !self.own.is_empty() {
                good(
                    instance.own_ticks(&self.own, &mut ticking),
                    "asking for its clocks",
                )?;
            }
            for output in &mut self.outputs {
                if output.clocks.iter().any(|clock| ticking.contains(clock)) {
                    let (status, value) = output.target.get(instance);
                    good(status, "reading its outputs")?;
                    output.value = value;
                }
            }
            ticking.clear();
            let updated = instance.update();
            good(updated.status, "its events")?;
            ends |= updated.terminate;
            self.own_event = updated.next.filter(|next| *next > now + SAME);
            if !updated.again || ends {
                self.ask(instance, now, due)?;
                good(instance.leave_events(), "leaving the event mode")?;
                return Ok(ends);
            }
        }
        Err((Status::Error, "its events without an end at one time"))
    }

    /// Asks for the intervals of the clocks that do not state them in the model description.
    fn ask(&mut self, instance: &mut Instance, now: f64, due: &[u32]) -> Result<(), Refused> {
        for one in &mut self.clocks {
            let (is_countdown, stated) = match one.clock.timing {
                Timing::Periodic { .. } => continue,
                Timing::Asked { shift } => (false, shift),
                Timing::Countdown => (true, None),
            };
            // The interval of a ticking clock may be another one from each tick on.
            let is_wanted =
                is_countdown || one.interval.is_none() || due.contains(&one.clock.reference);
            if !is_wanted {
                continue;
            }
            let (status, interval) = instance.interval(one.clock.reference);
            good(status, "asking for the interval of a clock")?;
            if let Interval::Changed(seconds) = interval {
                if !is_countdown && seconds <= SAME {
                    return Err((Status::Error, "a clock with an interval of 0"));
                }
                let is_first = one.interval.is_none() && !is_countdown;
                one.interval = Some(seconds);
                one.next = Some(if is_first {
                    let shift = if let Some(shift) = stated {
                        shift
                    } else {
                        let (status, shift) = instance.shift(one.clock.reference);
                        good(status, "asking for the shift of a clock")?;
                        shift
                    };
                    // A clock that learns its interval later has missed its shift.
                    (self.start + shift).max(now)
                } else {
                    now + seconds
                });
            }
        }
        Ok(())
    }

    /// The next time after `now` at which something happens.
    fn next(&self, now: f64) -> f64 {
        let clocks = self.clocks.iter().filter_map(|one| one.next);
        let all = clocks.chain(self.own_event);
        all.filter(|next| *next > now + SAME)
            .fold(f64::INFINITY, f64::min)
    }

    /// True if something happens at this time.
    fn is_due(&self, now: f64) -> bool {
        let clocks = self.clocks.iter().filter_map(|one| one.next);
        clocks.chain(self.own_event).any(|next| next <= now + SAME)
    }

    /// Does one step, in parts. `set` sets the inputs without a clock.
    pub(super) fn step(
        &mut self,
        instance: &mut Instance,
        inputs: &[Value],
        (from, length): (f64, f64),
        set: &mut dyn FnMut(&mut Instance) -> Status,
    ) -> Result<StepEnd, Refused> {
        for input in &mut self.inputs {
            input.value = inputs[input.place];
        }
        let ended = |at| StepEnd {
            status: Status::Ok,
            terminate: true,
            event: false,
            reached: Some(at),
        };
        let end = from + length;
        let mut now = from;
        if self.event(instance, now, true, set)? {
            return Ok(ended(now));
        }
        let mut nothing = |_: &mut Instance| Status::Ok;
        for _ in 0..MOST {
            // A countdown may have ended at once.
            if now < end && self.is_due(now) && self.event(instance, now, true, &mut nothing)? {
                return Ok(ended(now));
            }
            let next = self.next(now);
            let target = if next < end - SAME { next } else { end };
            let done = instance.step(now, target - now);
            if done.terminate || !matches!(done.status, Status::Ok | Status::Warning) {
                return Ok(done);
            }
            let reached = done.reached.unwrap_or(target);
            if !(now..=target + SAME).contains(&reached) {
                return Err((Status::Error, "a step that ends outside of its time"));
            }
            now = reached;
            let is_over = now >= end - SAME;
            if done.event && self.event(instance, now, !is_over, &mut nothing)? {
                return Ok(ended(now));
            }
            if is_over {
                return Ok(done);
            }
        }
        Err((Status::Error, "a step in more than 10000 parts"))
    }
}
