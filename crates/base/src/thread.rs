//! Threads of drivers, of the operating system or of a [simulation](crate::time::Simulation).

use std::io;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, TryRecvError};
use std::thread::JoinHandle;

use crate::time::{Clock, Nanos};

/// A thread of a driver, whose end can be waited for with a limit.
#[derive(Debug)]
pub struct Thread {
    /// Disconnected when the thread has dropped all that it had.
    ended: Receiver<()>,
    /// `None` in a simulation.
    handle: Option<JoinHandle<()>>,
}

impl Thread {
    /// Starts a thread.
    ///
    /// # Errors
    ///
    /// The system has no further one.
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

    /// Whether it is still running.
    pub fn is_running(&self) -> bool {
        self.ended.try_recv() == Err(TryRecvError::Empty)
    }

    /// Waits for its end; after `limit` it is left behind with everything it uses. Returns whether it has ended.
    pub fn join_within(self, clock: &dyn Clock, limit: Nanos) -> bool {
        let has_ended = self.ends_within(clock, limit);
        if has_ended {
            // A panic was reported where it happened.
            self.join();
        }
        has_ended
    }

    /// Waits for its end; returns whether that came within `limit`.
    pub fn ends_within(&self, clock: &dyn Clock, limit: Nanos) -> bool {
        wait_for(clock, &self.ended, limit)
    }

    /// Waits for its end without a limit; returns false if it panicked.
    pub fn join(self) -> bool {
        self.handle.is_none_or(|handle| handle.join().is_ok())
    }
}

/// Waits until there is news on `receiver`, or its sender is gone; returns whether that was within `limit`.
pub fn wait_for(clock: &dyn Clock, receiver: &Receiver<()>, limit: Nanos) -> bool {
    match clock.simulation() {
        Some(simulation) => simulation.wait_for(limit, &mut || {
            receiver.try_recv() != Err(TryRecvError::Empty)
        }),
        None => receiver.recv_timeout(limit.to_duration()) != Err(RecvTimeoutError::Timeout),
    }
}
