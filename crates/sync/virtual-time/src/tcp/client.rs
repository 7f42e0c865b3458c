//! The client, which blocks while it waits for the server.

use std::io::{self, ErrorKind, Read as _, Write as _};
use std::sync::Arc;

use tickbus_base::net::BlockingStream;
#[cfg(unix)]
use tickbus_base::net::TcpStream;
use tickbus_base::time::{Clock, Monotonic, Nanos, Stop};
use tickbus_net::{Address, LocalAddress, prepare, reach_in};

use super::is_later;
use crate::client::{Client, Connection, Line, client_of, closed, silent};
use crate::{Cause, Ended, Outcome, Participant, wire};

/// How long a read blocks before it checks for a stop.
const LOOK: Nanos = Nanos::from_millis(50);

/// The time without any TCP acknowledgement after which the server's machine counts as lost.
const PATIENCE: Nanos = Nanos::from_secs(10);

/// Runs `participant` in the run of the server at `address`, until its end.
///
/// # Errors
///
/// There is no server, it refuses this client, or the run was broken off.
pub fn join(address: &Address, participant: &mut dyn Participant) -> Result<Outcome, Ended> {
    let client = client_of(participant)?;
    let clock = Monotonic::shared() as _;
    connect(address, client, &clock, &Stop::new())?.run(participant)
}

/// Connects with the server at `address`, and joins; `clock` provides the times. When `stop` is stopped, the client
/// leaves the run.
///
/// # Errors
///
/// There is no server.
pub fn connect(
    address: &Address,
    client: Client,
    clock: &Arc<dyn Clock>,
    stop: &Stop,
) -> Result<Connection, Ended> {
    let stream = open(address, &**clock).map_err(|error| unreachable(address, &error))?;
    Ok(Connection::join(client, TcpLine::new(stream, clock, stop)))
}

/// Like [`join`], at a Unix socket.
///
/// # Errors
///
/// The same as for `join`.
pub fn join_local(
    address: &LocalAddress,
    participant: &mut dyn Participant,
) -> Result<Outcome, Ended> {
    let client = client_of(participant)?;
    let clock = Monotonic::shared() as _;
    connect_local(address, client, &clock, &Stop::new())?.run(participant)
}

/// Like [`connect`], at a Unix socket.
///
/// # Errors
///
/// There is no server, or this system has no Unix sockets.
pub fn connect_local(
    address: &LocalAddress,
    client: Client,
    clock: &Arc<dyn Clock>,
    stop: &Stop,
) -> Result<Connection, Ended> {
    let stream = open_local(address).map_err(|error| unreachable(address, &error))?;
    Ok(Connection::join(client, TcpLine::new(stream, clock, stop)))
}

fn unreachable(address: &dyn std::fmt::Display, error: &io::Error) -> Ended {
    let right = match error.kind() {
        ErrorKind::Unsupported => "use HOST:PORT",
        ErrorKind::PermissionDenied => "the server has to run as the same user",
        _ => "start it first, or correct the address",
    };
    let reason = format!("no server can be reached at {address} ({error}); {right}");
    Ended::before(Cause::Lost, reason)
}

#[cfg(unix)]
fn open_local(address: &LocalAddress) -> io::Result<BlockingStream> {
    TcpStream::connect_local(address.path())?.block(LOOK, None)
}

#[cfg(not(unix))]
fn open_local(_: &LocalAddress) -> io::Result<BlockingStream> {
    Err(super::no_unix_sockets())
}

fn open(address: &Address, clock: &dyn Clock) -> io::Result<BlockingStream> {
    let stream = reach_in(address, clock.simulation())?;
    prepare(stream.os(), PATIENCE)?;
    stream.block(LOOK, None)
}

#[derive(Debug)]
struct TcpLine {
    stream: BlockingStream,
    clock: Arc<dyn Clock>,
    stop: Stop,
    /// When `receive` gives up in any case.
    leaves: Option<Nanos>,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
}

impl TcpLine {
    fn new(stream: BlockingStream, clock: &Arc<dyn Clock>, stop: &Stop) -> Self {
        Self {
            stream,
            clock: Arc::clone(clock),
            stop: stop.clone(),
            leaves: None,
            buffer: vec![0; 4096],
            start: 0,
            end: 0,
        }
    }
}

fn lost(what: impl std::fmt::Display) -> Ended {
    Ended::before(Cause::Lost, format!("the server was lost: {what}"))
}

impl Line for TcpLine {
    fn send(&mut self, frame: &[u8]) {
        // On failure, the next read returns the server's last words, or that the server is lost.
        let _ = (&self.stream).write_all(frame);
    }

    fn receive(&mut self, limit: Nanos) -> Result<&[u8], Ended> {
        // Read the clock only when there is time for that.
        let mut until = None;
        loop {
            let arrived = wire::frame_length(&self.buffer[self.start..self.end]);
            let violated = |what| {
                let reason = format!("the server violates the protocol: it {what}");
                Ended::before(Cause::Protocol, reason)
            };
            if let Some(length) = arrived.map_err(violated)?
                && length <= self.end - self.start
            {
                let frame = self.start + wire::HEADER..self.start + length;
                self.start = frame.end;
                return Ok(&self.buffer[frame]);
            }
            self.buffer.copy_within(self.start..self.end, 0);
            (self.start, self.end) = (0, self.end - self.start);
            if self.end == self.buffer.len() {
                self.buffer.resize(2 * self.end, 0);
            }
            match (&self.stream).read(&mut self.buffer[self.end..]) {
                Ok(0) => return Err(lost("it closed the connection")),
                Ok(count) => self.end += count,
                Err(error) if is_later(&error) => {
                    if self.stop.is_stopped() {
                        return Err(Ended::before(Cause::Stopped, "this client was stopped"));
                    }
                    let now = self.clock.now();
                    if self.leaves.is_some_and(|by| now >= by) {
                        return Err(closed());
                    }
                    if now >= *until.get_or_insert(now + limit - LOOK) {
                        return Err(silent(limit));
                    }
                }
                Err(error) => return Err(lost(error)),
            }
        }
    }

    fn leave_within(&mut self, limit: Nanos) {
        self.leaves = Some(self.clock.now() + limit);
    }
}
