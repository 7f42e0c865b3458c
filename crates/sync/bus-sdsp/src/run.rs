//! This client's part in a run: from step to step.

use std::sync::Arc;

use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_image::signal::DataType;
use tickbus_virtual_time::client::{Asked, Client, Connection};
use tickbus_virtual_time::{Cause, Declaration, Ended, Meeting, Outcome, Step};

/// The pause before retrying a server that was not there.
const PAUSE: Nanos = Nanos::from_millis(100);

/// How long closing waits for the others to finish the step, too.
const FAREWELL: Nanos = Nanos::from_secs(2);

/// The end of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// As planned.
    Finished(Outcome),
    /// Prematurely.
    Broken(Ended),
}

impl From<Ended> for End {
    fn from(ended: Ended) -> Self {
        Self::Broken(ended)
    }
}

/// Gets what the server waits for, once a second.
pub(super) type Told<'t> = &'t mut dyn FnMut(&str);

/// A client that takes part in a run.
#[derive(Debug)]
pub(super) struct Run {
    connection: Connection,
    /// How long the server may be silent.
    timeout: Nanos,
    /// The virtual time of one step of this client.
    pub(super) interval: Nanos,
    is_over: bool,
}

impl Run {
    /// Joins the run of the server at `meeting`, waits until it starts, and sends the initial values. Waits for a
    /// server that is not there yet.
    pub(super) fn join(
        (meeting, timeout, clock): (&Meeting, Nanos, &Arc<dyn Clock>),
        declaration: &Declaration,
        types: &[DataType],
        initial: &[u64],
        (stop, told): (&Stop, Told<'_>),
    ) -> Result<Self, End> {
        let mut run = Self {
            connection: connect((meeting, clock), timeout, declaration, stop)?,
            timeout,
            interval: Nanos::ZERO,
            is_over: false,
        };
        match run.wait(told)? {
            Asked::Initial => {}
            other => unreachable!("a client is first asked for its initial values, not {other:?}"),
        }
        let client = run.connection.client();
        let of_steps = client
            .server_step()
            .times(declaration.multiple.get().into());
        run.interval = declaration.interval.unwrap_or(of_steps);
        let found = client.read_types();
        let mut all = declaration.reads.iter().zip(types).zip(found);
        if let Some(((name, own), is)) = all.find(|((_, own), is)| own != is) {
            let reason = format!(
                "it reads \"{name}\" as {own}, but that is {is}; give the signal this \"type\""
            );
            return Err(run.give_up(&reason));
        }
        run.connection.answer(initial);
        Ok(run)
    }

    /// Finishes the step that this client is in, and waits for its next one, which is at the virtual time `next` or soon
    /// after it; `None`: as declared.
    pub(super) fn advance(
        &mut self,
        writes: &[u64],
        next: Option<Nanos>,
        told: Told<'_>,
    ) -> Result<Step, End> {
        self.connection.answer_until(writes, next);
        self.step(told)
    }

    /// Waits for the next step of this client.
    pub(super) fn step(&mut self, told: Told<'_>) -> Result<Step, End> {
        match self.wait(told)? {
            Asked::Step(step) => Ok(step),
            other => unreachable!("after the start a client is asked for steps, not {other:?}"),
        }
    }

    /// Finishes the step that this client is in, as its last one. If it was the last step of the run, the run ends as
    /// planned.
    pub(super) fn finish(&mut self, writes: &[u64]) {
        self.connection.answer(writes);
        // A server that is paused says so once a second, for ever.
        self.connection.leave_within(self.timeout.min(FAREWELL));
        // The next request gets no answer.
        let _ = self.wait(&mut |_| {});
    }

    /// The values that this client reads in its step.
    pub(super) fn reads(&self) -> &[u64] {
        self.connection.client().reads()
    }

    /// Reports to the server why this client gives up, which ends the run for everyone.
    pub(super) fn give_up(&mut self, reason: &str) -> End {
        self.connection.give_up(reason);
        loop {
            match self.wait(&mut |_| {}) {
                Ok(_) => {}
                Err(end) => return end,
            }
        }
    }

    fn wait(&mut self, told: Told<'_>) -> Result<Asked, End> {
        let asked = self.connection.wait_telling(self.timeout, told);
        self.is_over = !matches!(asked, Ok(Asked::Initial | Asked::Step(_)));
        if let Err(ended) = &asked {
            self.connection.give_up(&ended.reason);
        }
        match asked? {
            Asked::End(Ok(outcome)) => Err(End::Finished(outcome)),
            Asked::End(Err(ended)) => Err(End::Broken(ended)),
            asked => Ok(asked),
        }
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        if !self.is_over {
            self.connection.give_up("it was closed");
        }
    }
}

/// Connects with the server at `meeting` as soon as it is there, and joins. `clock` provides the times.
///
/// # Errors
///
/// The server does not appear within `timeout`, or the declaration breaks a rule.
pub fn connect(
    (meeting, clock): (&Meeting, &Arc<dyn Clock>),
    timeout: Nanos,
    declaration: &Declaration,
    stop: &Stop,
) -> Result<Connection, Ended> {
    let end = clock.now() + timeout;
    loop {
        let now = clock.now();
        let client = Client::new(declaration.clone())
            .map_err(|mistake| ended(Cause::Configuration, mistake.to_string()))?;
        match meeting.connect(client, clock, stop) {
            Err(ended) if ended.cause == Cause::Lost && now < end && !stop.is_stopped() => {
                clock.wait_until((now + PAUSE).min(end), stop);
            }
            connected => return connected,
        }
    }
}

fn ended(cause: Cause, reason: impl Into<String>) -> Ended {
    Ended {
        cause,
        client: None,
        reason: reason.into(),
        steps: 0,
    }
}
