//! The bus: a client of a run, ticked by its simulation.

use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::time::{Clock, Monotonic, Nanos, Stop};
use tickbus_fieldbus::{BusError, BusSetup, Cause, Lead, Port, Receipt, Stepped};
use tickbus_image::signal::DataType;
use tickbus_virtual_time as sdsp;
use tickbus_virtual_time::{Declaration, Ended, Meeting, Step};

use super::run::{End, Run};
use super::{Every, Options, Variables};

/// The most steps that one tick catches up on. More steps are assumed to be a wrong time.
const MOST_STEPS: i64 = 100_000;

/// The same for a simulation whose ticks are of any length: the server takes them in some seconds, in one exchange.
const MOST_STEPS_OF_A_TICK: i64 = 100_000_000;

/// The statistic with the clients that the server waits for.
const WAITS_FOR: &str = "sdsp.waits_for";

/// The fact if it waits for nobody.
const NOBODY: &str = "nobody";

/// A client of a run on virtual time.
#[derive(Debug)]
pub struct Sdsp {
    meeting: Meeting,
    timeout: Nanos,
    clock: Arc<dyn Clock>,
    declaration: Declaration,
    /// Each tick is a step.
    by_ticks: bool,
    stop: Stop,
    values: Values,
    state: State,
}

#[derive(Debug)]
enum State {
    /// The client has not joined yet.
    Apart,
    /// In a step; the next one is due at this time of the simulation. Virtual time began at `begun`.
    Joined {
        run: Box<Run>,
        due: Nanos,
        begun: Nanos,
    },
    /// The run has ended, or continues without this client.
    Over(Result<(), BusError>),
}

impl Sdsp {
    /// A client with these options, which connects in its first cycle.
    ///
    /// # Errors
    ///
    /// The names of client or variables break a rule.
    pub fn new(options: &Options, setup: &BusSetup<'_>) -> Result<Self, Mistake> {
        let (writes, reads) = options.variables(setup.role, setup.table);
        let declaration = options.declaration(setup, &writes, &reads)?;
        let (_, area) = setup.role.areas();
        let stations = setup.table.stations.iter();
        // The wait for others is in real time, even if the driver's clock stands still until it is set.
        let clock = if setup.clock.passes_alone() {
            Arc::clone(setup.clock)
        } else {
            Monotonic::shared()
        };
        Ok(Self {
            meeting: options.meeting.clone(),
            timeout: options.timeout,
            clock,
            stop: setup
                .hosted
                .map(|hosted| hosted.stop.clone())
                .unwrap_or_default(),
            values: Values {
                slots: vec![0; declaration.writes.len()],
                types: reads.iter().map(|variable| variable.data_type).collect(),
                frames: stations
                    .map(|station| vec![0; station.bytes(area)].into())
                    .collect(),
                writes,
                reads,
                receipt: None,
            },
            declaration,
            by_ticks: options.every == Every::Tick && setup.hosted.is_none(),
            state: State::Apart,
        })
    }

    /// Takes part up to `now`; returns when the next step is due.
    fn run_to(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, End> {
        let values = &mut self.values;
        if let State::Apart = self.state {
            port.opening(&format!(
                "waiting for the server at {} to start the run",
                self.meeting
            ));
            let mut run = Run::join(
                (&self.meeting, self.timeout, &self.clock),
                &self.declaration,
                &values.types,
                &values.slots,
                (&self.stop, &mut |whom| port.tell(WAITS_FOR, whom)),
            )?;
            values.are_sent(port);
            let step = run.step(&mut |whom| port.tell(WAITS_FOR, whom))?;
            port.tell(WAITS_FOR, NOBODY);
            let due = now + run.interval;
            values.deliver(now, run.reads(), port);
            self.begin(step, port);
            self.state = State::Joined {
                run: Box::new(run),
                due,
                begun: now,
            };
            return Ok(due);
        }
        let State::Joined { run, due, begun } = &mut self.state else {
            unreachable!("the caller has seen to it");
        };
        // With ticks of any length each one after the current step asks for another: the due time is only what a
        // simulation without a step of its own takes.
        let since = if self.by_ticks {
            *due - run.interval + Nanos(1)
        } else {
            *due
        };
        let late = now - since;
        let most = if self.by_ticks {
            MOST_STEPS_OF_A_TICK
        } else {
            MOST_STEPS
        };
        if late > run.interval.times(most) {
            return Err(run.give_up(&format!(
                "its simulation time jumped from {due} to {now}, over more than {most} steps; hand in the \
                 nanoseconds since the simulation began, tick by tick"
            )));
        }
        if late < Nanos::ZERO {
            values.touch(now, port);
            return Ok(*due);
        }
        loop {
            let next = self.by_ticks.then_some(now - *begun);
            let mut has_waited = false;
            let step = run.advance(&values.slots, next, &mut |whom| {
                port.tell(WAITS_FOR, whom);
                has_waited = true;
            })?;
            if has_waited {
                port.tell(WAITS_FOR, NOBODY);
            }
            values.are_sent(port);
            values.deliver(now, run.reads(), port);
            if self.by_ticks {
                // With longer steps the server is ahead of this tick.
                *due = *begun + step.time + run.interval;
                return Ok(*due);
            }
            *due += run.interval;
            if now < *due {
                return Ok(*due);
            }
            values.collect(now, port);
        }
    }

    fn begin(&self, step: Step, port: &mut Port) {
        debug_assert_eq!(step.time, Nanos::ZERO, "a run begins at 0");
        port.running(&format!("in step with the server at {}", self.meeting));
    }

    /// The run has ended: reports that, and makes the received data invalid.
    fn end(end: &End, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let result = match end {
            End::Finished(outcome) => {
                port.tell("sdsp.hash", &outcome.hash.to_string());
                Ok(format!(
                    "the run has come to its end after {} steps, at {} of virtual time; its trace hash is {}",
                    outcome.steps, outcome.time, outcome.hash
                ))
            }
            End::Broken(ended) => Err(bus_error(ended)),
        };
        port.tell(WAITS_FOR, NOBODY);
        let (cause, why) = match &result {
            Ok(why) => (Cause::Left, why.clone()),
            Err(error) => (error.into(), error.to_string()),
        };
        for station in 0..port.stations() {
            port.station_left(station, now, cause, &why);
        }
        result.map(|_| ())
    }
}

impl Stepped for Sdsp {
    fn send(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        self.values.collect(now, port);
        Ok(())
    }

    fn receive(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError> {
        if let State::Over(result) = &self.state {
            return result.clone().map(|()| now);
        }
        match self.run_to(now, port) {
            Ok(due) => Ok(due),
            // A server that cannot be reached may come later.
            Err(End::Broken(ended))
                if matches!(self.state, State::Apart) && ended.cause == sdsp::Cause::Lost =>
            {
                port.tell(WAITS_FOR, NOBODY);
                Err(bus_error(&ended))
            }
            Err(end) => {
                let result = Self::end(&end, now, port);
                self.state = State::Over(result.clone());
                result.map(|()| now)
            }
        }
    }

    fn lead(&self) -> Lead {
        match self.state {
            State::Over(_) => Lead::Ended,
            _ => Lead::Bus,
        }
    }
}

impl Drop for Sdsp {
    fn drop(&mut self) {
        if let State::Joined { run, .. } = &mut self.state
            && self.values.receipt.is_some()
        {
            // The simulation has answered this step, and there is no further cycle to send it.
            run.finish(&self.values.slots);
        }
    }
}

/// The values of this client, and the image that they come from and go to.
#[derive(Debug)]
struct Values {
    writes: Variables,
    reads: Variables,
    types: Vec<DataType>,
    /// The values to send next.
    slots: Vec<u64>,
    /// The receipt for the values in the slots.
    receipt: Option<Receipt>,
    /// Per station, the frame that it reads.
    frames: Vec<Box<[u8]>>,
}

impl Values {
    /// Takes the simulation's values. If a fault swallows them, the previous values are sent again.
    fn collect(&mut self, now: Nanos, port: &mut Port) {
        let Some(mut frames) = port.take_all(now) else {
            return;
        };
        for station in frames.stations() {
            self.writes.take(station, frames.frame(station));
        }
        self.receipt = Some(frames.receipt());
        self.writes.get(&mut self.slots);
    }

    /// The server will get the values in the slots.
    fn are_sent(&mut self, port: &mut Port) {
        if let Some(receipt) = self.receipt.take() {
            port.sent(&receipt);
        }
    }

    /// Passes on the values read in a step.
    fn deliver(&mut self, now: Nanos, reads: &[u64], port: &mut Port) {
        self.reads.set(reads);
        port.together(|port| {
            for (station, frame) in self.frames.iter_mut().enumerate() {
                self.reads.give(station, frame);
                if port.is_up(now) {
                    port.received(station, now, frame);
                }
            }
        });
    }

    /// No new values are possible since: between two steps only the simulation's own time passes.
    fn touch(&self, now: Nanos, port: &mut Port) {
        if port.is_up(now) {
            port.together(|port| {
                (0..self.frames.len()).for_each(|station| port.touch(station, now));
            });
        }
    }
}

fn bus_error(ended: &Ended) -> BusError {
    let reason = ended.to_string();
    match ended.cause {
        sdsp::Cause::Configuration | sdsp::Cause::Refused => BusError::Refused(reason),
        sdsp::Cause::Protocol => BusError::Protocol(reason),
        sdsp::Cause::Failed | sdsp::Cause::Logic | sdsp::Cause::Stopped => BusError::Left(reason),
        sdsp::Cause::Lost | sdsp::Cause::Hung | sdsp::Cause::System => BusError::Link(reason),
    }
}
