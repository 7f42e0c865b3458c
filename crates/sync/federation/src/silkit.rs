//! A participant of SIL Kit that is a client of a run.
//!
//! In the step at time *t* the participant publishes what the client reads, completes its own step before *t*, waits
//! until the simulation is at *t*, and writes what was published before *t*.

mod find;
mod inbox;
mod library;
mod scalar;
mod settings;

pub use settings::{Label, SilKitMapping, SilKitSettings, Topic};

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::Builder;
use std::time::Duration;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_bus_sdsp::connect;
use tickbus_virtual_time::{Ended, Meeting, Outcome, Step};

use crate::member::{Federation, ended, run};
use crate::opened::{EngineLibrary, Opened};
use inbox::{Inbox, Slot};
use library::{Library, Member, Participant, Publisher};

/// The pause between two attempts at the registry.
const PAUSE: Nanos = Nanos::from_millis(200);

/// How often a blocked thread looks whether it was stopped.
const LOOK: Duration = Duration::from_millis(50);

/// A simulation of SIL Kit as a client of a run.
pub type SilKit = Opened<SilKitSettings, Library>;

impl EngineLibrary for Library {
    fn find(named: Option<&Path>) -> Result<Self, Mistake> {
        find::load(named)
    }

    fn version(&self) -> String {
        Self::version(*self)
    }
}

/// The participant in its simulation.
struct Joined<'s> {
    silkit: &'s SilKit,
    member: Member,
    inbox: Arc<Inbox>,
    publishers: Vec<Publisher>,
    /// The time of the first step; `None` before it.
    begun: Option<Nanos>,
    /// The topics without a value were listed.
    is_listed: bool,
    news: &'s mut dyn FnMut(&str),
}

impl SilKit {
    /// Joins the simulation, waits until all its participants have connected, and takes part in the run of the server at
    /// `meeting` until the run ends. `news` gets a line for people about each stage.
    ///
    /// # Errors
    ///
    /// The registry or the server did not appear, or the run was broken off.
    pub fn take_part(
        &self,
        meeting: &Meeting,
        news: &mut dyn FnMut(&str),
    ) -> Result<Outcome, Ended> {
        let mapping = &self.mapping;
        let early = |reason| ended(&self.stop, &mapping.client, reason);
        let participant = self.connect().map_err(early)?;
        news(&format!(
            "the participant \"{}\" has joined; the simulation begins when all participants that the system controller \
             names have joined",
            mapping.name
        ));
        let mut joined = self.join(participant, news).map_err(early)?;
        let ready = joined.inbox.wait_ready(&*self.clock, &self.stop);
        let outcome = ready.map_err(early).and_then(|()| {
            (joined.news)("the simulation is complete");
            let at = (meeting, &self.clock);
            let timeout = self.options.timeout;
            let connection = connect(at, timeout, &mapping.declaration(), &self.stop)?;
            run(connection, mapping, timeout, &mut joined)
        });
        joined.leave(&outcome);
        outcome
    }

    /// Connects with the registry as soon as it is there. The library's call blocks, so it has its own thread, which is
    /// left behind if it hangs.
    fn connect(&self) -> Result<Participant, String> {
        let end = self.clock.now() + self.options.timeout;
        let (name, registry) = (&self.mapping.name, &self.mapping.engine.registry);
        loop {
            let (send, receive) = channel();
            let (library, name, registry) = (self.library, name.clone(), registry.clone());
            let builder = Builder::new().name("tickbus-silkit".to_owned());
            let thread = builder.spawn(move || {
                let _ = send.send(library.participant(&name, &registry));
            });
            thread.map_err(|error| format!("a thread cannot be started: {error}"))?;
            let why = loop {
                match receive.recv_timeout(LOOK) {
                    Ok(Ok(participant)) => return Ok(participant),
                    Ok(Err(why)) => break why,
                    Err(RecvTimeoutError::Disconnected) => break "its thread has ended".to_owned(),
                    Err(RecvTimeoutError::Timeout) if self.stop.is_stopped() => {
                        return Err("it was stopped".to_owned());
                    }
                    Err(RecvTimeoutError::Timeout) if self.clock.now() >= end => {
                        break format!("there is no answer within {}", self.options.timeout);
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                }
            };
            let now = self.clock.now();
            if now >= end || self.stop.is_stopped() {
                return Err(format!(
                    "the participant \"{}\" cannot join a simulation through the registry {}: {why}; start \
                     sil-kit-registry first, and give each participant another name",
                    self.mapping.name, self.mapping.engine.registry
                ));
            }
            self.clock.wait_until((now + PAUSE).min(end), &self.stop);
        }
    }

    /// Creates everything that the mapping names, and begins to wait for the others.
    fn join<'s>(
        &'s self,
        participant: Participant,
        news: &'s mut dyn FnMut(&str),
    ) -> Result<Joined<'s>, String> {
        let mapping = &self.mapping;
        let slots = mapping.subscribe.iter().map(|one| {
            let name = &one.key.name;
            Slot::new(name, one.variable.data_type, one.initial)
        });
        let inbox = Arc::new(Inbox::new(&mapping.name, slots.collect()));
        let step = mapping.step.unwrap_or(Nanos::ZERO).0.unsigned_abs();
        let mut member = participant.join(step, &inbox)?;
        let cannot =
            |name: &str, why: String| format!("the topic \"{name}\" cannot be registered: {why}");
        let publishers = mapping.publish.iter().map(|one| {
            let made = member.publisher(&one.variable, &one.key);
            made.map_err(|why| cannot(&one.key.name, why))
        });
        let publishers = publishers.collect::<Result<_, _>>()?;
        for (slot, one) in mapping.subscribe.iter().enumerate() {
            let made = member.subscriber(&one.variable.name, &one.key, slot);
            made.map_err(|why| cannot(&one.key.name, why))?;
        }
        member.start()?;
        Ok(Joined {
            silkit: self,
            member,
            inbox,
            publishers,
            begun: None,
            is_listed: false,
            news,
        })
    }
}

impl Joined<'_> {
    /// Ends the simulation as the run has ended, and waits until it has been heard.
    fn leave(mut self, outcome: &Result<Outcome, Ended>) {
        let limit = match outcome {
            Ok(_) => {
                self.list_silent();
                self.member.stop("the run of tickbus has ended as planned");
                self.silkit.options.timeout
            }
            Err(ended) => {
                if !self.inbox.has_stopped() {
                    // Otherwise the others would wait for our next step for ever.
                    self.member.fail(&format!("the run of tickbus: {ended}"));
                }
                self.silkit.options.timeout.min(Nanos::from_secs(2))
            }
        };
        self.inbox.wait_shut(&*self.silkit.clock, limit);
    }

    /// Lists the topics that nothing has come from, once.
    fn list_silent(&mut self) {
        if self.is_listed {
            return;
        }
        self.is_listed = true;
        for topic in self.inbox.silent() {
            (self.news)(&format!(
                "nothing has been published at the topic \"{topic}\"; compare topic, labels and media type with its \
                 publisher"
            ));
        }
    }
}

impl Federation for Joined<'_> {
    fn step(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String> {
        let silkit = self.silkit;
        let mapping = &silkit.mapping;
        for ((one, publisher), raw) in mapping.publish.iter().zip(&self.publishers).zip(reads) {
            let message = &scalar::bytes(*raw)[..scalar::size(one.data_type)];
            self.member.publish(publisher, message)?;
        }
        match self.begun {
            Some(_) => self.member.complete_step()?,
            None => self.member.complete_ready()?,
        }
        let time = step.time;
        let next = time + mapping.step.unwrap_or(Nanos::ZERO);
        let now = self.inbox.wait_step(
            (&*silkit.clock, &silkit.stop),
            (silkit.options.timeout, time),
            self.news,
            (next.0, writes),
        )?;
        if i64::try_from(now) != Ok(time.0) {
            return Err(format!(
                "the simulation is at {} where the run is at {time}; switch DynamicSimulationStep of SIL Kit off",
                Nanos(i64::try_from(now).unwrap_or(i64::MAX))
            ));
        }
        let begun = *self.begun.get_or_insert_with(|| silkit.clock.now());
        if !self.is_listed && silkit.clock.now() - begun > silkit.options.timeout {
            self.list_silent();
        }
        Ok(())
    }
}
