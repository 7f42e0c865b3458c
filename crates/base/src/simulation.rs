//! The operating system's part in a run that is simulated as a whole: threads, connections and waiting, all on one clock.
//!
//! A program that simulates whole runs implements [`Simulation`] and hands it in with its [`Clock`](crate::time::Clock).
//! Adapters and supervision then run unchanged: they spawn, connect, listen and wait through this trait where the clock has
//! one, and through the operating system where it has none. No product has one.

use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, TryRecvError};
use std::thread::JoinHandle;

use crate::os::{Interest, Ready};
use crate::time::{Clock, Nanos, Stop};

/// What replaces the operating system.
pub trait Simulation {
    /// Starts a thread.
    fn spawn(&self, name: &str, body: Box<dyn FnOnce() + Send>);

    /// Lets other threads run until `done` holds, or for `limit`; returns whether it held in time.
    fn wait_for(&self, limit: Nanos, done: &mut dyn FnMut() -> bool) -> bool;

    /// Waits until one of these sockets (key, [identity](SimulatedSocket::identity), interest) is ready, until `deadline`, or
    /// until `stop` is stopped or woken, and adds the sockets that are ready.
    fn poll(
        &self,
        sockets: &[(usize, u64, Interest)],
        deadline: Nanos,
        stop: &Stop,
        ready: &mut Vec<Ready>,
    );

    /// Begins to listen on the first of `addresses` that is free; port 0 is any free one.
    ///
    /// # Errors
    ///
    /// None of them is.
    fn listen(&self, addresses: &[SocketAddr]) -> io::Result<Box<dyn SimulatedListener>>;

    /// Begins to connect: the stream is writable once that is decided, and then tells by
    /// [`take_error`](SimulatedStream::take_error) whether it failed.
    ///
    /// # Errors
    ///
    /// The failure is known at once.
    fn connect(&self, address: SocketAddr) -> io::Result<Box<dyn SimulatedStream>>;
}

/// A socket of a [`Simulation`].
pub trait SimulatedSocket: Send + Sync + fmt::Debug {
    /// What [`Simulation::poll`] knows it by.
    fn identity(&self) -> u64;

    /// Its own address.
    ///
    /// # Errors
    ///
    /// As of a socket of the operating system.
    fn local_addr(&self) -> io::Result<SocketAddr>;
}

/// A listening socket, which never blocks.
pub trait SimulatedListener: SimulatedSocket {
    /// The next connection.
    ///
    /// # Errors
    ///
    /// As of a socket of the operating system; `WouldBlock` if none waits.
    fn accept(&self) -> io::Result<(Box<dyn SimulatedStream>, SocketAddr)>;
}

/// A connection, which never blocks. Dropping it closes it.
pub trait SimulatedStream: SimulatedSocket {
    /// As [`std::io::Read::read`].
    ///
    /// # Errors
    ///
    /// As of a socket of the operating system.
    fn read(&self, buffer: &mut [u8]) -> io::Result<usize>;

    /// As [`std::io::Write::write`].
    ///
    /// # Errors
    ///
    /// As of a socket of the operating system.
    fn write(&self, bytes: &[u8]) -> io::Result<usize>;

    /// Closes the sending direction.
    ///
    /// # Errors
    ///
    /// As of a socket of the operating system.
    fn shutdown_write(&self) -> io::Result<()>;

    /// The address of the other end.
    ///
    /// # Errors
    ///
    /// As of a socket of the operating system.
    fn peer_addr(&self) -> io::Result<SocketAddr>;

    /// The error of connecting, once.
    ///
    /// # Errors
    ///
    /// As of a socket of the operating system.
    fn take_error(&self) -> io::Result<Option<io::Error>>;
}

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
        let has_ended = wait_for(clock, &self.ended, limit);
        if has_ended && let Some(handle) = self.handle {
            // A panic was reported where it happened.
            let _ = handle.join();
        }
        has_ended
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
