//! Threads of drivers, of the operating system or of a [simulation](crate::time::Simulation).

use std::io;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, TryRecvError};
use std::thread::JoinHandle;

use crate::time::{Clock, Nanos};

/// A driver's thread, whose end can be awaited with a time limit.
#[derive(Debug)]
pub struct Thread {
    /// Disconnected once the thread has dropped everything that it had.
    ended: Receiver<()>,
    /// `None` in a simulation.
    handle: Option<JoinHandle<()>>,
}

impl Thread {
    /// Starts a thread.
    ///
    /// # Errors
    ///
    /// The system could not start a thread.
    pub fn spawn(
        clock: &dyn Clock,
        name: &str,
        body: impl FnOnce() + Send + 'static,
    ) -> io::Result<Self> {
        let (end, ended) = mpsc::channel();
        let body = move || {
            let _end: mpsc::Sender<()> = end;
            body();
        };
        let handle = match clock.simulation() {
            Some(simulation) => {
                simulation.spawn(name, Box::new(body));
                None
            }
            None => Some(
                std::thread::Builder::new()
                    .name(name.to_owned())
                    .spawn(body)?,
            ),
        };
        Ok(Self { ended, handle })
    }

    /// True if the thread is still running.
    pub fn is_running(&self) -> bool {
        self.ended.try_recv() == Err(TryRecvError::Empty)
    }

    /// Waits for the end of the thread; returns whether it came within `limit`. Otherwise the thread is abandoned with
    /// everything it uses.
    pub fn join_within(self, clock: &dyn Clock, limit: Nanos) -> bool {
        let has_ended = self.ends_within(clock, limit);
        if has_ended {
            // A panic was reported where it happened.
            self.join();
        }
        has_ended
    }

    /// Waits for the end of the thread; returns whether it came within `limit`.
    pub fn ends_within(&self, clock: &dyn Clock, limit: Nanos) -> bool {
        wait_for(clock, &self.ended, limit)
    }

    /// Waits for the end of the thread without a limit; returns false if the thread panicked.
    pub fn join(self) -> bool {
        self.handle.is_none_or(|handle| handle.join().is_ok())
    }
}

/// Waits for news on `receiver`, or the loss of its sender; returns whether that came within `limit`.
pub fn wait_for(clock: &dyn Clock, receiver: &Receiver<()>, limit: Nanos) -> bool {
    match clock.simulation() {
        Some(simulation) => simulation.wait_for(limit, &mut || {
            receiver.try_recv() != Err(TryRecvError::Empty)
        }),
        None => receiver.recv_timeout(limit.to_duration()) != Err(RecvTimeoutError::Timeout),
    }
}
