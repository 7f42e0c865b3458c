//! The client, without I/O: frames of the server in; requests and frames for the server out.

use std::fmt;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;

use crate::step::step_at;
use crate::wire::{self, FromServer};
use crate::{Cause, Declaration, Ended, Outcome, Participant, Step};

/// A request of the server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Asked {
    /// The initial values.
    Initial,
    /// A step, with [`Client::reads`].
    Step(Step),
    /// Nothing more.
    End(Result<Outcome, Ended>),
}

/// One client of a run.
#[derive(Debug)]
pub struct Client {
    declaration: Declaration,
    /// The step that the client owes an answer to.
    owes: Option<u64>,
    /// The step that the client ran last; `None` before the initial write.
    ran: Option<u64>,
    step: Nanos,
    read_types: Vec<DataType>,
    reads: Vec<u64>,
    waits_for: String,
    /// The request of the server about the state.
    state: Option<Stated>,
    out: Vec<u8>,
}

/// A request about the state of a client.
#[derive(Debug)]
enum Stated {
    /// Save it as it is after this step.
    Save(u64),
    /// Restore it.
    Restore { writes: Vec<u64>, state: Vec<u8> },
}

impl Client {
    /// A client with this declaration; [send](Self::frame) its join next.
    ///
    /// # Errors
    ///
    /// The declaration breaks a rule.
    pub fn new(declaration: Declaration) -> Result<Self, Mistake> {
        declaration.check()?;
        let mut out = Vec::new();
        wire::join(&mut out, &declaration)
            .map_err(|what| Mistake::new(what, "or make several clients of it"))?;
        Ok(Self {
            reads: vec![0; declaration.reads.len()],
            declaration,
            owes: None,
            ran: None,
            step: Nanos::ZERO,
            read_types: Vec::new(),
            waits_for: String::new(),
            state: None,
            out,
        })
    }

    /// The client's declaration.
    pub const fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    /// The virtual time of one step of the server; zero before the start.
    pub const fn server_step(&self) -> Nanos {
        self.step
    }

    /// The types of the variables that the client reads, in the order of its declaration; empty before the start.
    pub fn read_types(&self) -> &[DataType] {
        &self.read_types
    }

    /// The values that the client reads in this step.
    pub fn reads(&self) -> &[u64] {
        &self.reads
    }

    /// The text of the last waiting message; see [`Participant::waiting`].
    pub fn waits_for(&self) -> &str {
        &self.waits_for
    }

    /// The frame to send: first the join, then the last one made.
    pub fn frame(&self) -> &[u8] {
        &self.out
    }

    /// The steps that were certainly committed: the server continued after them.
    fn steps(&self) -> u64 {
        self.ran.unwrap_or(0).saturating_sub(1)
    }

    /// Takes a frame of the server, without its header; `None`: nothing is requested yet.
    ///
    /// # Errors
    ///
    /// The server violates the protocol.
    pub fn receive(&mut self, frame: &[u8]) -> Result<Option<Asked>, Ended> {
        let steps = self.steps();
        let violated = |what: String| {
            let reason = format!("the server violates the protocol: it {what}");
            Ended {
                steps,
                ..Ended::before(Cause::Protocol, reason)
            }
        };
        let message = wire::from_server(frame).map_err(violated)?;
        if let FromServer::End(outcome) = message {
            self.owes = None;
            return Ok(Some(Asked::End(outcome)));
        }
        if let FromServer::Waiting(whom) = message {
            self.waits_for.clear();
            self.waits_for.push_str(whom);
            return Ok(None);
        }
        if let FromServer::Meet(_) | FromServer::Members(_) | FromServer::Until(_) = message {
            // The line of the client deals with these, if it can.
            return Err(violated("lets clients meet that cannot".to_owned()));
        }
        if let FromServer::Save(sequence) = message {
            self.state = Some(Stated::Save(sequence));
            return Ok(None);
        }
        if let Some(owed) = self.owes {
            return Err(violated(format!("went on before step {owed} was answered")));
        }
        let expected = self.declaration.reads.len();
        let count = |count: usize| match count {
            count if count == expected => Ok(()),
            count => Err(violated(format!(
                "sent {count} values, expected {expected}"
            ))),
        };
        match message {
            FromServer::Start { step, reads } => {
                if self.ran.is_some() {
                    return Err(violated("started twice".to_owned()));
                }
                count(reads.len())?;
                if step <= Nanos::ZERO {
                    return Err(violated(format!("starts a run with steps of {step}")));
                }
                (self.step, self.read_types) = (step, reads);
                self.owes = Some(0);
                Ok(Some(Asked::Initial))
            }
            FromServer::Step { step, reads } => {
                if self.ran.is_none_or(|ran| step.sequence <= ran) {
                    let sequence = step.sequence;
                    let what = format!("asked for step {sequence} out of order");
                    return Err(violated(what));
                }
                count(reads.iter().len())?;
                for (slot, read) in self.reads.iter_mut().zip(reads.iter()) {
                    *slot = read;
                }
                self.owes = Some(step.sequence);
                Ok(Some(Asked::Step(step)))
            }
            FromServer::Restore {
                sequence,
                writes,
                state,
            } => {
                let expected = self.declaration.writes.len();
                if self.ran != Some(0) || writes.iter().len() != expected {
                    return Err(violated("restores another state".to_owned()));
                }
                self.owes = Some(sequence);
                self.state = Some(Stated::Restore {
                    writes: writes.iter().collect(),
                    state: state.to_vec(),
                });
                Ok(None)
            }
            _ => unreachable!("dealt with above"),
        }
    }

    /// Answers the last request: [send](Self::frame) the frame afterwards.
    ///
    /// # Panics
    ///
    /// When nothing was requested, or `writes` does not have one value per variable of [`Declaration::writes`].
    pub fn answer(&mut self, writes: &[u64]) {
        self.answer_until(writes, None);
    }

    /// Like [`answer`](Self::answer), with the virtual time at which the client wants to run next; see
    /// [`Participant::next_update`].
    ///
    /// # Panics
    ///
    /// The same as for `answer`.
    pub fn answer_until(&mut self, writes: &[u64], next: Option<Nanos>) {
        let sequence = self.owes.take().expect("the server has asked");
        assert_eq!(writes.len(), self.declaration.writes.len(), "values");
        self.ran = Some(sequence);
        self.out.clear();
        let next = next.map_or(0, |time| step_at(time, self.step));
        wire::done(&mut self.out, sequence, next, writes);
    }

    /// Makes the frame with the state after the step `sequence`, or the reason why the client gives none.
    fn saved(&mut self, sequence: u64, state: Result<Vec<u8>, String>) {
        let state = state.and_then(|state| match state.len() {
            0..=wire::LONGEST_STATE => Ok(state),
            long => Err(format!(
                "its state has {long} bytes, {} at most",
                wire::LONGEST_STATE
            )),
        });
        self.out.clear();
        let state = state.as_deref().map_err(|reason| &**reason);
        wire::saved(&mut self.out, sequence, state);
    }

    /// Makes the frame that says why the client gives up.
    pub fn give_up(&mut self, reason: &str) {
        self.out.clear();
        wire::give_up(&mut self.out, reason);
    }
}

/// A line to a server; a client waits for one frame at a time.
pub(crate) trait Line: fmt::Debug + Send {
    /// Sends a frame. If that fails, the next `receive` returns the error.
    fn send(&mut self, frame: &[u8]);

    /// Waits for the next frame, for `limit` at most, and returns it without its header.
    fn receive(&mut self, limit: Nanos) -> Result<&[u8], Ended>;

    /// From now on, `receive` gives up after `limit` in all, even if the server says that it waits for others.
    fn leave_within(&mut self, limit: Nanos);
}

/// The answer of a client that cannot save its state.
const NO_STATE: &str = "it has no way to save its state";

/// A frame of the server.
enum Heard {
    Asked(Asked),
    Waiting,
    State(Stated),
}

/// A client that has joined a server, for a simulation that calls instead of being called: [`wait`](Self::wait) for a
/// step, run it, [`answer`](Self::answer).
#[derive(Debug)]
pub struct Connection {
    client: Client,
    line: Box<dyn Line>,
}

impl Connection {
    /// Joins a run.
    pub(crate) fn join(client: Client, mut line: impl Line + 'static) -> Self {
        line.send(client.frame());
        let line = Box::new(line);
        Self { client, line }
    }

    /// The client, with its declaration and the values that it reads in the current step.
    pub const fn client(&self) -> &Client {
        &self.client
    }

    /// Waits for the server's next request. A server that sends nothing for `limit` of wall-clock time, give or take 50
    /// ms, hangs: a waiting server sends a message every second.
    ///
    /// # Errors
    ///
    /// The server is lost, violates the protocol or sends nothing, or this client was stopped.
    pub fn wait(&mut self, limit: Nanos) -> Result<Asked, Ended> {
        self.wait_telling(limit, &mut |_| {})
    }

    /// Like [`wait`](Self::wait); `told` gets what the server waits for, once a second, see [`Participant::waiting`].
    ///
    /// # Errors
    ///
    /// The same as for `wait`.
    pub fn wait_telling(
        &mut self,
        limit: Nanos,
        told: &mut dyn FnMut(&str),
    ) -> Result<Asked, Ended> {
        loop {
            match self.hear(limit)? {
                Heard::Asked(asked) => return Ok(asked),
                Heard::Waiting => told(self.client.waits_for()),
                Heard::State(Stated::Save(sequence)) => {
                    self.client.saved(sequence, Err(NO_STATE.to_owned()));
                    self.line.send(self.client.frame());
                }
                // It has given no state.
                Heard::State(Stated::Restore { .. }) => self.give_up(NO_STATE),
            }
        }
    }

    /// Receives one frame.
    fn hear(&mut self, limit: Nanos) -> Result<Heard, Ended> {
        let steps = self.client.steps();
        let frame = self.line.receive(limit);
        // The line does not know the number of steps.
        let frame = frame.map_err(|ended| Ended { steps, ..ended })?;
        match self.client.receive(frame) {
            Ok(Some(asked)) => Ok(Heard::Asked(asked)),
            Ok(None) => Ok(self
                .client
                .state
                .take()
                .map_or(Heard::Waiting, Heard::State)),
            Err(ended) => {
                self.give_up(&ended.reason);
                Err(ended)
            }
        }
    }

    /// Answers the request, with one value per variable of the declaration's writes. If the server is lost, the next
    /// [`wait`](Self::wait) returns the error.
    ///
    /// # Panics
    ///
    /// When nothing was requested, or the number of values is wrong.
    pub fn answer(&mut self, writes: &[u64]) {
        self.answer_until(writes, None);
    }

    /// Like [`answer`](Self::answer), with the virtual time at which the client wants to run next; see
    /// [`Participant::next_update`].
    ///
    /// # Panics
    ///
    /// The same as for `answer`.
    pub fn answer_until(&mut self, writes: &[u64], next: Option<Nanos>) {
        self.client.answer_until(writes, next);
        self.line.send(self.client.frame());
    }

    /// From now on, [`wait`](Self::wait) ends after `limit` of wall-clock time in all, even if the server says that it
    /// waits for others: for a client that is about to leave.
    pub fn leave_within(&mut self, limit: Nanos) {
        self.line.leave_within(limit);
    }

    /// Tells the server why this client gives up. The run ends for everyone; [`wait`](Self::wait) returns the end.
    pub fn give_up(&mut self, reason: &str) {
        self.client.give_up(reason);
        self.line.send(self.client.frame());
    }

    /// Runs `participant` until the run ends.
    ///
    /// # Errors
    ///
    /// The run was broken off.
    pub fn run(mut self, participant: &mut dyn Participant) -> Result<Outcome, Ended> {
        let mut writes = vec![0; self.client.declaration.writes.len()];
        loop {
            let asked = match self.hear(Nanos::MAX)? {
                Heard::Asked(asked) => asked,
                Heard::Waiting => {
                    participant.waiting(self.client.waits_for());
                    continue;
                }
                Heard::State(Stated::Save(sequence)) => {
                    self.client.saved(sequence, participant.save());
                    self.line.send(self.client.frame());
                    continue;
                }
                Heard::State(Stated::Restore { writes: old, state }) => {
                    writes = old;
                    match participant.restore(&state) {
                        Ok(()) => self.answer(&writes),
                        Err(reason) => self.give_up(&reason),
                    }
                    continue;
                }
            };
            match asked {
                Asked::Initial => participant.initial(&mut writes),
                Asked::Step(step) => {
                    let ran = participant.run(step, self.client.reads(), &mut writes);
                    if let Err(reason) = ran {
                        self.give_up(&reason);
                        // The server answers with the end, which contains the number of steps.
                        continue;
                    }
                }
                Asked::End(outcome) => return outcome,
            }
            self.answer_until(&writes, participant.next_update());
        }
    }
}

/// The time for leaving is over.
pub(crate) fn closed() -> Ended {
    Ended::before(Cause::Stopped, "it was closed")
}

/// The server has sent nothing for `limit`.
pub(crate) fn silent(limit: Nanos) -> Ended {
    let reason = format!("the server has not said anything for {limit}");
    Ended::before(Cause::Hung, reason)
}

/// The client of a participant.
pub(crate) fn client_of(participant: &dyn Participant) -> Result<Client, Ended> {
    Client::new(participant.declare())
        .map_err(|mistake| Ended::before(Cause::Configuration, mistake.to_string()))
}
