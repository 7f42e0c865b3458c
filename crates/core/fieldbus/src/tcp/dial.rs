//! A connection with one peer, for any protocol that implements [`Caller`].

use std::io;
use std::net::SocketAddr;

use crate::{BusError, Port};
use tickbus_base::net::TcpStream;
use tickbus_base::os::{Interest, PollSet};
use tickbus_base::time::{Nanos, Stop};

use tickbus_net::{Address, Stream, is_for_later};

use super::{connect, no_wait};

/// At most this many bytes are read at once.
const BUFFER: usize = 16 * 1024;

/// At most this many consecutive reads, before anything else is done.
const READS: usize = 64;

/// A protocol as one end of a connection speaks it: bytes in, bytes out, and the image behind the port. A caller does
/// no I/O.
///
/// In each turn a [`Call`] passes received bytes to [`hear`](Self::hear), and calls [`turn`](Self::turn) for everything
/// that is due. Then it writes [`to_write`](Self::to_write) until that is empty or the system accepts no more, and
/// reports each piece to [`wrote`](Self::wrote). Finally it calls [`check`](Self::check) to ask if the connection may
/// continue, and waits for the peer until [`deadline`](Self::deadline). The first error of any of these calls ends the
/// connection.
pub trait Caller {
    /// `bytes` have arrived, at least one; any part of a telegram, or several.
    ///
    /// # Errors
    ///
    /// The peer violates the protocol, or refuses.
    fn hear(&mut self, now: Nanos, bytes: &[u8], port: &mut Port) -> Result<(), BusError>;

    /// Does what is due at `now`. Called in every turn, with or without new bytes.
    ///
    /// # Errors
    ///
    /// The connection must end.
    fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError>;

    /// The bytes to be written at `now`, if any.
    fn to_write(&self, now: Nanos) -> &[u8];

    /// The system has accepted the first `count` bytes of [`to_write`](Self::to_write), at least one. The caller may
    /// make more bytes at once: they are written in the same turn.
    fn wrote(&mut self, now: Nanos, count: usize, port: &mut Port);

    /// Checks the time-outs at `now`, at the end of the turn. After a delay of this process, the peer thus gets credit
    /// for the bytes that it has sent or taken in the meantime.
    ///
    /// # Errors
    ///
    /// The peer has taken too long.
    fn check(&mut self, _now: Nanos, _port: &mut Port) -> Result<(), BusError> {
        Ok(())
    }

    /// The time until which to wait if nothing arrives and nothing can be written; the port has its own [due
    /// time](Port::due). A time in the past means no wait.
    fn deadline(&self, port: &Port) -> Nanos;

    /// The error that ends the connection, now that the peer has closed it.
    fn left(&mut self) -> BusError;

    /// The error that ends the connection, now that reading or writing has failed.
    fn broke(&mut self, error: &io::Error) -> BusError;
}

/// Connects to `address`, for a [`Caller`] that is made once the peer is known; `None` if `stop` came first. The peer
/// may leave sent data unacknowledged for `patience`.
///
/// # Errors
///
/// The host is unknown, or does not answer.
pub fn dial(
    address: &Address,
    patience: Nanos,
    port: &mut Port,
    stop: &Stop,
) -> Result<Option<(Call<TcpStream>, SocketAddr)>, BusError> {
    let since = port.clock().now();
    let reached = connect(address, patience, port, stop)?;
    Ok(reached.map(|(stream, peer)| {
        let mut call = Call::new(stream);
        call.since = Some(since);
        (call, peer)
    }))
}

/// A connection with one peer: transfers bytes between a stream and a [`Caller`]. Dropping the call closes the
/// connection properly. After an [end](Self::end) without the last values, dropping it resets the connection instead,
/// so that outdated values do not reach the peer.
#[derive(Debug)]
pub struct Call<S: Stream> {
    stream: S,
    buffer: Box<[u8]>,
    /// True if the system has not accepted all bytes to be written.
    blocked: bool,
    /// When connecting began, until the first look: bytes from the peer may have waited since then.
    since: Option<Nanos>,
    /// True if bytes that the peer has not received yet must no longer reach it.
    ends_by_reset: bool,
    /// The station whose line this is, for the statistics; 0 for a bus with one line.
    line: usize,
}

impl<S: Stream> Call<S> {
    /// A call over a stream that never blocks.
    pub fn new(stream: S) -> Self {
        Self {
            stream,
            buffer: vec![0; BUFFER].into(),
            blocked: false,
            since: None,
            ends_by_reset: false,
            line: 0,
        }
    }

    /// The same call on the line of this station, for a bus with several lines.
    #[must_use]
    pub fn of_station(mut self, station: usize) -> Self {
        self.line = station;
        self
    }

    /// Transfers bytes until the connection ends or `stop` comes.
    ///
    /// # Errors
    ///
    /// The reason why the connection has ended.
    pub fn run(
        &mut self,
        caller: &mut impl Caller,
        port: &mut Port,
        stop: &Stop,
    ) -> Result<(), BusError> {
        let mut set = PollSet::new(stop);
        let mut interest = self.interest();
        let added = set.add(0, &self.stream, interest);
        added.map_err(|error| no_wait(&error))?;
        let mut readable = false;
        let mut now = port.clock().now();
        port.begin_to_look(self.since.take().unwrap_or(now));
        let mut is_first = true;
        while !stop.is_stopped() {
            port.look_at_line(now);
            if std::mem::take(&mut is_first) {
                // The first turn reads nothing, because the system has not reported any bytes yet.
                port.look_leaves_some();
            }
            self.turn(now, readable, caller, port)?;
            let deadline = caller.deadline(port).min(port.due()).min(port.next_look());
            if interest != self.interest() {
                interest = self.interest();
                let changed = set.change(0, &self.stream, interest);
                changed.map_err(|error| no_wait(&error))?;
            }
            let waited = set.wait_after(now, &**port.clock(), deadline);
            waited.map_err(|error| no_wait(&error))?;
            now = port.clock().now();
            readable = set.ready().iter().any(|ready| ready.is_readable);
        }
        self.end(port);
        Ok(())
    }

    /// Called when the driver closes: the connection ends although nothing has failed.
    pub fn end(&mut self, port: &Port) {
        self.ends_by_reset = port.leaves_old_values();
    }

    /// The stream to wait for.
    pub fn stream(&self) -> &S {
        &self.stream
    }

    /// The events to wait for before the next [`turn`](Self::turn).
    pub fn interest(&self) -> Interest {
        if self.blocked {
            Interest::ReadWrite
        } else {
            Interest::Read
        }
    }

    /// One turn of `caller`, for an owner that waits for several streams and has [looked](Port::look_at_line) at these at
    /// `now`; see [`run`](Self::run).
    ///
    /// # Errors
    ///
    /// The reason why the connection has ended.
    pub fn turn(
        &mut self,
        now: Nanos,
        readable: bool,
        caller: &mut impl Caller,
        port: &mut Port,
    ) -> Result<(), BusError> {
        if readable {
            self.read(now, caller, port)?;
        }
        caller.turn(now, port)?;
        self.write(now, caller, port)?;
        caller.check(now, port)?;
        port.observe(now);
        Ok(())
    }

    /// Reads everything that has arrived.
    ///
    /// # Errors
    ///
    /// The reason why the connection has ended.
    pub fn read_all(&mut self, caller: &mut impl Caller, port: &mut Port) -> Result<(), BusError> {
        let now = port.clock().now();
        for _ in 0..READS {
            if !self.read(now, caller, port)? {
                break;
            }
        }
        Ok(())
    }

    /// Reads once; returns true if there was anything.
    fn read(
        &mut self,
        now: Nanos,
        caller: &mut impl Caller,
        port: &mut Port,
    ) -> Result<bool, BusError> {
        match self.stream.read(&mut self.buffer) {
            Ok(0) => Err(caller.left()),
            Ok(count) => {
                port.read(self.line, count);
                if count == self.buffer.len() {
                    port.look_leaves_some();
                }
                caller.hear(now, &self.buffer[..count], port).map(|()| true)
            }
            Err(error) if is_for_later(&error) => Ok(false),
            Err(error) => Err(caller.broke(&error)),
        }
    }

    /// Writes as much as the system accepts.
    fn write(
        &mut self,
        now: Nanos,
        caller: &mut impl Caller,
        port: &mut Port,
    ) -> Result<(), BusError> {
        self.blocked = false;
        while !self.blocked {
            let rest = caller.to_write(now);
            if rest.is_empty() {
                break;
            }
            match self.stream.write(rest) {
                Ok(0) => self.blocked = true,
                Ok(count) => {
                    port.wrote(self.line, count, count == rest.len());
                    caller.wrote(now, count, port);
                }
                Err(error) if is_for_later(&error) => self.blocked = true,
                Err(error) => {
                    // A peer that has closed may have sent its last values first.
                    let _ = self.read_all(caller, port);
                    return Err(caller.broke(&error));
                }
            }
        }
        Ok(())
    }
}

impl<S: Stream> Drop for Call<S> {
    fn drop(&mut self) {
        if self.ends_by_reset {
            self.stream.close_by_reset();
        } else {
            self.stream.close();
        }
    }
}

#[cfg(test)]
mod tests;
