//! The operating system's part in a fully simulated run: threads, connections and waiting, all on one clock.
//!
//! A program that simulates whole runs implements [`Simulation`] and passes it in with its [`Clock`](super::Clock).
//! Adapters and supervision then run unchanged: they spawn, connect, listen and wait through this trait if the clock
//! has one, and otherwise through the operating system. No product has one.

use std::fmt;
use std::fs::File;
use std::io::{self, Write as _};
use std::net::SocketAddr;
use std::path::Path;

use super::{Nanos, Stop};

/// The events to wait for on a socket.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interest {
    /// There is something to read, the peer has closed, or an error is pending.
    Read,
    /// There is room to write, or an error is pending.
    Write,
    /// Either.
    ReadWrite,
}

/// A socket that is ready.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ready {
    /// The key by which the waiting thread knows the socket.
    pub key: usize,
    /// A read would not block.
    pub is_readable: bool,
    /// A write would not block.
    pub is_writable: bool,
}

/// The replacement of the operating system.
pub trait Simulation {
    /// Starts a thread.
    fn spawn(&self, name: &str, body: Box<dyn FnOnce() + Send>);

    /// Lets other threads run until `done` holds, or for `limit`; returns whether it held in time.
    fn wait_for(&self, limit: Nanos, done: &mut dyn FnMut() -> bool) -> bool;

    /// Waits until one of these sockets (key, [identity](SimulatedSocket::identity), interest) is ready, until
    /// `deadline`, or until `stop` is stopped or woken, and adds the ready sockets.
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
    /// No address is free.
    fn listen(&self, addresses: &[SocketAddr]) -> io::Result<Box<dyn SimulatedListener>>;

    /// Begins to connect: the stream becomes writable once the outcome is known;
    /// [`take_error`](SimulatedStream::take_error) then returns the error, if any.
    ///
    /// # Errors
    ///
    /// The connection fails at once.
    fn connect(&self, address: SocketAddr) -> io::Result<Box<dyn SimulatedStream>>;

    /// Opens the serial port that the system calls `device`. Its characters are read in the code of
    /// [`Marks`](crate::os::Marks).
    ///
    /// # Errors
    ///
    /// The simulation has no such port.
    fn open_serial(&self, device: &str) -> io::Result<Box<dyn SimulatedStream>> {
        let _ = device;
        Err(io::ErrorKind::NotFound.into())
    }

    /// Writes to a file, as [`std::io::Write::write`]: the disk may be full, and a killed process writes nothing.
    ///
    /// # Errors
    ///
    /// The same as of a file of the operating system.
    fn write(&self, mut file: &File, path: &Path, bytes: &[u8]) -> io::Result<usize> {
        let _ = path;
        file.write(bytes)
    }
}

/// A socket of a [`Simulation`].
pub trait SimulatedSocket: Send + Sync + fmt::Debug {
    /// The identity for [`Simulation::poll`].
    fn identity(&self) -> u64;

    /// The socket's own address.
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
    /// As of a socket of the operating system; `WouldBlock` if no connection waits.
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

    /// Waits until the socket is ready, or for `limit`; returns whether it is.
    fn wait(&self, interest: Interest, limit: Nanos) -> bool;

    /// Closes the sending direction.
    ///
    /// # Errors
    ///
    /// As of a socket of the operating system.
    fn shutdown_write(&self) -> io::Result<()>;

    /// Makes closing break the connection, and drop everything that the other end has not received.
    fn close_by_reset(&self);

    /// The address of the other end.
    ///
    /// # Errors
    ///
    /// As of a socket of the operating system.
    fn peer_addr(&self) -> io::Result<SocketAddr>;

    /// The error of connecting, returned once.
    ///
    /// # Errors
    ///
    /// As of a socket of the operating system.
    fn take_error(&self) -> io::Result<Option<io::Error>>;
}
