//! The helper process: `tickbus plugin-helper`, which calls a library on behalf of its host.
//!
//! The host passes a line for messages, and the shared memory with the image.

use std::io::{self, Read as _, Write as _};
use std::sync::mpsc;
use std::time::Duration;

use super::VERSION;
use super::answer::Answer;
use super::library::{Bus, Library};
use super::request::Request;
use super::setup::Setup;
use tickbus_base::os::helper::{self, Line};
use tickbus_base::os::{MemoryFile, SharedMemory, flush_log};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::BusError;
use tickbus_net::{Inbox, Message};

/// Serves the host on stdin until it ends.
///
/// # Errors
///
/// This process was not started as a helper, or the host has gone.
pub fn serve() -> io::Result<()> {
    let (mut host, memory) = Host::take_over()?;
    host.tell(&Answer::Hello {
        version: VERSION.to_owned(),
    })?;
    let Some(Request::Open { setup, grace_ms }) = host.next()? else {
        return Ok(());
    };
    let _guardian = guard(&host.line, Duration::from_millis(grace_ms))?;
    let memory = SharedMemory::open(&memory, memory_bytes(&setup))?;
    let library = match Library::load(setup.library.as_ref()) {
        Ok(library) => library,
        Err(error) => return host.refuse(error),
    };
    let bus = match library.open(&setup) {
        Ok(bus) => bus,
        Err(error) => return host.refuse(error),
    };
    host.tell(&Answer::Opened)?;
    exchange(&mut host, &setup, &memory, bus)
}

/// Size of the shared memory: `in`, then `out` from the next whole word on.
pub(super) fn memory_bytes(setup: &Setup) -> usize {
    out_word(setup) * size_of::<u64>() + setup.rx()
}

/// The first word of `out` in the shared memory.
pub(super) fn out_word(setup: &Setup) -> usize {
    SharedMemory::words_for(setup.tx())
}

fn exchange(
    host: &mut Host,
    setup: &Setup,
    memory: &SharedMemory,
    mut bus: Bus<'_>,
) -> io::Result<()> {
    while let Some(request) = host.next()? {
        let Request::Exchange = request else {
            return Err(io::Error::other("the host opened twice"));
        };
        memory.read(0, bus.input());
        let answer = match bus.exchange(setup.timeout_ms) {
            Ok(outcome) => {
                if outcome.is_fresh() {
                    memory.write(out_word(setup), bus.output());
                }
                Answer::Done(outcome)
            }
            Err(error) => Answer::Failed(error),
        };
        host.tell(&answer)?;
    }
    Ok(())
}

/// The host as its helper sees it.
struct Host {
    line: Line,
    inbox: Inbox,
}

impl Host {
    fn take_over() -> io::Result<(Self, MemoryFile)> {
        let purpose = "this command is for tickbus itself, which starts it for a driver.cfg with kind = \"plugin\" and \
                       isolated = true";
        let (line, memory) = helper::take_over(true, purpose)?;
        let memory = memory.ok_or_else(|| io::Error::other(purpose))?;
        let inbox = Inbox::new();
        Ok((Self { line, inbox }, memory))
    }

    fn tell(&mut self, answer: &Answer) -> io::Result<()> {
        self.line.write_all(&answer.write())
    }

    /// The host's next request; `None` if the host asks the helper to end.
    fn next<M: Message>(&mut self) -> io::Result<Option<M>> {
        loop {
            if let Some(message) = self.inbox.take().map_err(io::Error::other)? {
                return Ok(Some(message));
            }
            let mut bytes = [0; 4096];
            match self.line.read(&mut bytes) {
                Ok(0) => return Ok(None),
                Ok(count) => self.inbox.push(&bytes[..count]),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Reports why there is no bus, and waits for the host to end this process.
    fn refuse(&mut self, error: BusError) -> io::Result<()> {
        self.tell(&Answer::Failed(error))?;
        while self.next::<Request>()?.is_some() {}
        Ok(())
    }
}

/// Kills this process if its host has gone and the library does not let the process end within `grace`: nothing else
/// would. Dropping the returned sender cancels that.
fn guard(line: &Line, grace: Duration) -> io::Result<mpsc::Sender<()>> {
    let line = line.try_clone()?;
    let (ended, end) = mpsc::channel();
    std::thread::Builder::new()
        .name("guard".to_owned())
        .spawn(move || {
            helper::wait_for_end(&line);
            if end.recv_timeout(grace) == Err(mpsc::RecvTimeoutError::Timeout) {
                log::error!("the host has gone away, and the library does not end: ending it");
                flush_log(Nanos::from_millis(100));
                helper::kill_this_process();
            }
        })?;
    Ok(ended)
}
