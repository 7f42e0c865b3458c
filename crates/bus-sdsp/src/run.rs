//! This client's part in a run: from step to step.

use tickbus_base::time::{Clock, Monotonic, Nanos, Stop};
use tickbus_image::signal::DataType;
use tickbus_virtual_time::client::{Asked, Client, Connection};
use tickbus_virtual_time::{Cause, Declaration, Ended, Meeting, Outcome, Step};

use super::Every;

/// How long to wait until a server that was not there is tried again.
const PAUSE: Nanos = Nanos::from_millis(100);

/// How long closing waits for the others to finish the step, too.
const FAREWELL: Nanos = Nanos::from_secs(2);

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// As planned.
    Finished(Outcome),
    /// Before its time.
    Broken(Ended),
}

impl From<Ended> for End {
    fn from(ended: Ended) -> Self {
        Self::Broken(ended)
    }
}

/// A client that takes part in a run.
#[derive(Debug)]
pub(super) struct Run {
    connection: Connection,
    /// How long the server may be silent.
    timeout: Nanos,
    /// The virtual time of one step of this client.
    pub(super) interval: Nanos,
    /// How many of the steps that it is asked for make one of its own.
    each: u64,
    /// The first step that it is not to skip.
    next: u64,
    is_over: bool,
}

impl Run {
    /// Joins the run of the server at `meeting`, waits until it starts, and sends the initial values. A server that is
    /// not there is waited for.
    pub(super) fn join(
        (meeting, timeout): (&Meeting, Nanos),
        declaration: &Declaration,
        (every, types): (Every, &[DataType]),
        initial: &[u64],
        stop: &Stop,
    ) -> Result<Self, End> {
        let mut run = Self {
            connection: connect(meeting, timeout, declaration, stop)?,
            timeout,
            interval: Nanos::ZERO,
            each: 1,
            next: 1,
            is_over: false,
        };
        match run.wait()? {
            Asked::Initial => {}
            other => unreachable!("a client is first asked for its initial values, not {other:?}"),
        }
        let client = run.connection.client();
        let step = client.server_step();
        let fits = match every {
            Every::Steps(_) => Ok(1),
            Every::Time(interval) => steps_of(interval, step),
        };
        let fits = fits.and_then(|each| {
            let found = client.read_types();
            let wrong =
                (declaration.reads.iter().zip(types).zip(found)).find(|((_, own), is)| own != is);
            match wrong {
                None => Ok(each),
                Some(((name, own), is)) => Err(format!(
                    "it reads \"{name}\" as {own}, but that is {is}; give the signal this \"type\""
                )),
            }
        });
        match fits {
            Ok(each) => run.each = each,
            Err(reason) => return Err(run.give_up(&reason)),
        }
        let steps =
            i64::try_from(u64::from(declaration.multiple.get()) * run.each).unwrap_or(i64::MAX);
        run.interval = step.times(steps);
        run.connection.answer(initial);
        Ok(run)
    }

    /// Finishes the step that this client is in, and waits for its next one.
    pub(super) fn advance(&mut self, writes: &[u64]) -> Result<Step, End> {
        self.connection.answer(writes);
        self.step(writes)
    }

    /// Waits for the next step of this client; until then its values stay.
    pub(super) fn step(&mut self, writes: &[u64]) -> Result<Step, End> {
        loop {
            match self.wait()? {
                Asked::Step(step) if step.sequence >= self.next => {
                    self.next = step.sequence + self.each;
                    return Ok(step);
                }
                _ => self.connection.answer(writes),
            }
        }
    }

    /// Finishes the step that this client is in, as its last one. If it was the last one of the run, that ends as planned.
    pub(super) fn finish(&mut self, writes: &[u64]) {
        self.connection.answer(writes);
        self.timeout = self.timeout.min(FAREWELL);
        // Whatever is asked next is not answered.
        let _ = self.wait();
    }

    /// What this client reads in its step.
    pub(super) fn reads(&self) -> &[u64] {
        self.connection.client().reads()
    }

    /// Tells the server why this client does not go on, which ends the run for everyone.
    pub(super) fn give_up(&mut self, reason: &str) -> End {
        self.connection.give_up(reason);
        loop {
            match self.wait() {
                Ok(_) => {}
                Err(end) => return end,
            }
        }
    }

    fn wait(&mut self) -> Result<Asked, End> {
        let asked = self.connection.wait(self.timeout);
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

/// Connects with the server at `meeting` as soon as that is there, and joins.
///
/// # Errors
///
/// It does not appear within `timeout`, or the declaration breaks a rule.
pub fn connect(
    meeting: &Meeting,
    timeout: Nanos,
    declaration: &Declaration,
    stop: &Stop,
) -> Result<Connection, Ended> {
    let clock = Monotonic::shared();
    let end = clock.now() + timeout;
    loop {
        let now = clock.now();
        let client = Client::new(declaration.clone())
            .map_err(|mistake| ended(Cause::Configuration, mistake.to_string()))?;
        match meeting.connect(client, stop) {
            Err(ended) if ended.cause == Cause::Lost && now < end && !stop.is_stopped() => {
                clock.wait_until((now + PAUSE).min(end), stop);
            }
            connected => return connected,
        }
    }
}

/// How many steps of the server make one of `interval`.
fn steps_of(interval: Nanos, step: Nanos) -> Result<u64, String> {
    let whole = interval.0 >= step.0 && interval.0 % step.0 == 0;
    match u64::try_from(interval.0 / step.0) {
        Ok(steps) if whole => Ok(steps),
        _ => Err(format!(
            "its step of {interval} is no whole multiple of the server's, {step}; make one of them fit"
        )),
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
