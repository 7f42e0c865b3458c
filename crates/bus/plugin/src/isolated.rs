//! The plug-in bus whose library runs in a helper process.

use std::io::{self, ErrorKind, Read as _};
use std::net::Shutdown;
use std::path::PathBuf;
use std::process::Child;
use std::sync::Arc;

use super::answer::Answer;
use super::helper::{memory_bytes, out_word};
use super::request::Request;
use super::setup::Setup;
use super::{Limits, VERSION};
use tickbus_base::os::helper::{self, Line, send_quietly};
use tickbus_base::os::{Interest, PollSet, SharedMemory};
use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};
use tickbus_fieldbus::{BusError, Exchange, Exchanged, Free, Port};
use tickbus_net::{Inbox, Message as _};

/// The time for a killed helper to end.
const END: Nanos = Nanos::from_secs(1);

/// Lets a helper process call the library.
#[derive(Debug)]
pub(super) struct Isolated {
    setup: Setup,
    limits: Limits,
    program: PathBuf,
    name: String,
    /// The name of the calls in the statistics.
    exchange: Arc<str>,
    close: Arc<str>,
}

impl Isolated {
    /// A bus for the library of `setup`, whose helper processes run `program`.
    pub(super) fn new(setup: Setup, limits: Limits, program: PathBuf) -> Self {
        let name = setup.library_name();
        Self {
            exchange: format!("tickbus_exchange() of {name}").into(),
            close: format!("the helper process of {name}").into(),
            setup,
            limits,
            program,
            name,
        }
    }
}

impl Free for Isolated {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let setup = &self.setup;
        port.tell("library", &setup.library.to_string_lossy());
        let mut helper = Helper::start(self, stop)?;
        let process = helper.child.id();
        let helper_is = format!("{} as process {process}", self.program.display());
        port.tell("helper", &helper_is);
        port.count("plugin.helpers");
        if !helper.open(self, stop)? {
            return Ok(());
        }
        let mut line = OpenBus {
            helper,
            setup,
            input: vec![0; setup.tx()].into(),
            output: vec![0; setup.rx()].into(),
            call: &self.exchange,
            limit: setup.timeout() + self.limits.call,
        };
        let ended = setup.cycles().serve(&mut line, port, stop);
        port.calling(&self.close, self.close_timeout(), || drop(line));
        ended
    }

    fn close_timeout(&self) -> Nanos {
        // The library first has its time to close, then the helper is killed.
        self.setup.timeout() + self.limits.close + END
    }
}

/// A bus that is open in a helper.
struct OpenBus<'a> {
    helper: Helper,
    setup: &'a Setup,
    input: Box<[u8]>,
    output: Box<[u8]>,
    call: &'a Arc<str>,
    limit: Nanos,
}

impl Exchange for OpenBus<'_> {
    fn input(&mut self) -> &mut [u8] {
        &mut self.input
    }

    fn exchange(&mut self, port: &Port, stop: &Stop) -> Result<Exchanged, BusError> {
        let helper = &mut self.helper;
        helper.memory.write(0, &self.input);
        let asked = port.calling(self.call, self.limit, || {
            let what = Waiting::For("tickbus_exchange");
            helper.ask(Some(&Request::Exchange), what, self.limit, stop)
        });
        let outcome = match asked? {
            None => return Ok(Exchanged::Stopped),
            Some(Answer::Done(outcome)) => outcome,
            Some(other) => return Err(helper.out_of_turn(&other)),
        };
        if outcome.is_fresh() {
            helper.memory.read(out_word(self.setup), &mut self.output);
        }
        Ok(outcome.exchanged())
    }

    fn output(&self) -> &[u8] {
        &self.output
    }
}

/// The event that the host is waiting for.
#[derive(Clone, Copy, Debug)]
enum Waiting {
    /// The start of the helper.
    ForHello,
    /// The return of this function of the library.
    For(&'static str),
}

/// A helper process; dropping it asks it to end, and kills it if it does not.
#[derive(Debug)]
struct Helper {
    child: Child,
    /// Waits for `line`, and is dropped first.
    set: PollSet,
    interest: Interest,
    line: Line,
    inbox: Inbox,
    memory: SharedMemory,
    /// The system's time, in which the helper runs regardless of the driver's clock.
    clock: Arc<Monotonic>,
    program: PathBuf,
    library: String,
    /// The time for the helper to end on its own.
    grace: Nanos,
}

impl Helper {
    fn start(bus: &Isolated, stop: &Stop) -> Result<Self, BusError> {
        let cannot = |error: io::Error| {
            let program = bus.program.display();
            BusError::Link(format!(
                "the helper process {program} cannot be started: {error}; check `helper` in the driver.cfg"
            ))
        };
        let (memory, file) = SharedMemory::create(memory_bytes(&bus.setup)).map_err(cannot)?;
        let started = helper::start(&bus.program, "plugin-helper", Some(&file));
        let (child, line) = started.map_err(cannot)?;
        // From here on, an error ends the process as well.
        let mut helper = Self {
            child,
            set: PollSet::new(stop),
            interest: Interest::Read,
            line,
            inbox: Inbox::new(),
            memory,
            clock: Monotonic::shared(),
            program: bus.program.clone(),
            library: bus.name.clone(),
            grace: bus.setup.timeout() + bus.limits.close,
        };
        helper.line.set_nonblocking(true).map_err(cannot)?;
        let added = helper.set.add(0, &helper.line, helper.interest);
        added.map_err(cannot)?;
        Ok(helper)
    }

    /// Makes the helper load the library and open the bus; `false` if it was stopped meanwhile.
    fn open(&mut self, bus: &Isolated, stop: &Stop) -> Result<bool, BusError> {
        let limit = bus.limits.open;
        match self.ask(None, Waiting::ForHello, limit, stop)? {
            None => return Ok(false),
            Some(Answer::Hello { version }) if version == VERSION => {}
            Some(Answer::Hello { version }) => {
                return Err(BusError::Refused(format!(
                    "the helper {} is tickbus {version}, and this is tickbus {VERSION}; name the right one as \
                     `helper` in the driver.cfg",
                    self.program.display()
                )));
            }
            Some(other) => return Err(self.out_of_turn(&other)),
        }
        let what = Waiting::For("tickbus_open");
        let open = Request::Open {
            setup: bus.setup.clone(),
            grace_ms: u64::try_from(self.grace.0 / 1_000_000).unwrap_or(0),
        };
        match self.ask(Some(&open), what, limit, stop)? {
            None => Ok(false),
            Some(Answer::Opened) => Ok(true),
            Some(other) => Err(self.out_of_turn(&other)),
        }
    }

    /// Sends a request, if any, and waits for the answer; `None` if stopped. A failure in the library is an
    /// error.
    fn ask(
        &mut self,
        request: Option<&Request>,
        what: Waiting,
        limit: Nanos,
        stop: &Stop,
    ) -> Result<Option<Answer>, BusError> {
        let begun = self.clock.now();
        let request = request.map(Request::write).unwrap_or_default();
        let mut unsent = &request[..];
        loop {
            unsent = self.send(unsent, what)?;
            match self.inbox.take() {
                Ok(None) => {}
                Ok(Some(Answer::Failed(error))) => return Err(error),
                Ok(answer) => return Ok(answer),
                Err(error) => {
                    return Err(BusError::Protocol(format!(
                        "{}: the helper process answered with {error}; the library has damaged it: tell the \
                         library's maker",
                        self.library
                    )));
                }
            }
            if stop.is_stopped() {
                return Ok(None);
            }
            let waited = self.clock.now() - begun;
            if waited > limit {
                return Err(self.hung(what, waited, limit));
            }
            let interest = if unsent.is_empty() {
                Interest::Read
            } else {
                Interest::ReadWrite
            };
            // A little past the limit, so that the wait does not end just before it.
            let deadline = begun + limit + Nanos(1);
            let waited = self.wait(interest, deadline);
            waited.map_err(|error| BusError::Link(format!("waiting for the helper: {error}")))?;
            if self.set.ready().iter().any(|ready| ready.is_readable) {
                self.read(what)?;
            }
        }
    }

    fn wait(&mut self, interest: Interest, deadline: Nanos) -> io::Result<()> {
        if interest != self.interest {
            self.set.change(0, &self.line, interest)?;
            self.interest = interest;
        }
        self.set.wait(&*self.clock, deadline)
    }

    /// Sends as much as the socket accepts at once; returns the rest.
    fn send<'b>(&mut self, mut bytes: &'b [u8], what: Waiting) -> Result<&'b [u8], BusError> {
        while !bytes.is_empty() {
            match send_quietly(&self.line, bytes) {
                Ok(count) => bytes = &bytes[count..],
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(self.lost(what, &error.to_string())),
            }
        }
        Ok(bytes)
    }

    fn read(&mut self, what: Waiting) -> Result<(), BusError> {
        let mut bytes = [0; 4096];
        match self.line.read(&mut bytes) {
            Ok(0) => Err(self.lost(what, "")),
            Ok(count) => {
                self.inbox.push(&bytes[..count]);
                Ok(())
            }
            Err(error)
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) =>
            {
                Ok(())
            }
            Err(error) => Err(self.lost(what, &error.to_string())),
        }
    }

    /// The helper's end of the socket is closed: the helper has died, or the library has closed a descriptor
    /// that is not its own.
    fn lost(&mut self, what: Waiting, detail: &str) -> BusError {
        // If the helper has died already, it keeps its exit status.
        let _ = self.child.kill();
        let status = self.child.wait();
        let right = if matches!(&status, Ok(status) if helper::was_killed(*status)) {
            "see who did that; the system does when memory is short"
        } else {
            "tell the library's maker"
        };
        let how = match status {
            Ok(status) => helper::ending(status),
            Err(error) => format!("ended: {error}"),
        };
        log::debug!("the helper process of {} {how} {detail}", self.library);
        BusError::Link(match what {
            Waiting::ForHello => format!(
                "the helper process {} {how} before it said hello; check that it is the tickbus command",
                self.program.display()
            ),
            Waiting::For(function) => format!(
                "{}: its helper process {how} in {function}; {right}",
                self.library
            ),
        })
    }

    fn hung(&mut self, what: Waiting, waited: Nanos, limit: Nanos) -> BusError {
        let _ = self.child.kill();
        let waited = waited.rounded();
        BusError::Link(match what {
            Waiting::ForHello => format!(
                "the helper process {} has said nothing for {waited}, and was ended; check that it is the \
                 tickbus command",
                self.program.display()
            ),
            Waiting::For(function) => format!(
                "{}: {function} has not returned for {waited} (it may take {limit}), and its helper process \
                 was ended",
                self.library
            ),
        })
    }

    fn out_of_turn(&self, answer: &Answer) -> BusError {
        BusError::Protocol(format!(
            "{}: the helper process answered with {} out of turn; the library has damaged it: tell the \
             library's maker",
            self.library,
            answer.name()
        ))
    }

    /// Asks the helper to end, and waits for that; `false` if it has not ended in time.
    fn ends_by_itself(&mut self) -> io::Result<bool> {
        self.line.shutdown(Shutdown::Write)?;
        self.line.set_nonblocking(false)?;
        let grace = self.grace.to_duration();
        self.line.set_read_timeout(Some(grace))?;
        // At most the answer to the last request is still to come.
        for _ in 0..3 {
            match self.line.read(&mut [0; 4096]) {
                Ok(0) => return Ok(true),
                Ok(_) => {}
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
                {
                    return Ok(false);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(false)
    }
}

impl Drop for Helper {
    fn drop(&mut self) {
        let has_ended = matches!(self.child.try_wait(), Ok(Some(_)));
        if !has_ended && !self.ends_by_itself().unwrap_or(false) {
            log::warn!(
                "{}: the helper process has not ended by itself within {}, and is ended",
                self.library,
                self.grace
            );
        }
        // If the helper has ended on its own, it keeps its exit status.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
