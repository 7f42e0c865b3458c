//! One connection and its socket: transfers bytes between the socket, the session and the port.

use std::io::{self, Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};

use tickbus_base::os::Interest;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::tcp::{bow_out, is_for_later, prepare};
use tickbus_fieldbus::{BusError, Port};

use super::{Frames, Session, Terms};

/// At most this many reads per turn, before anything else is done.
const READS: usize = 64;

/// One connection.
#[derive(Debug)]
pub(super) struct Connection {
    stream: TcpStream,
    peer: SocketAddr,
    session: Session,
    /// Whether the peer's presence was reported.
    announced: bool,
    /// How many skipped cycles were reported to the port.
    skipped: u64,
}

impl Connection {
    /// Takes over a connection that was established just now.
    pub(super) fn new(
        stream: TcpStream,
        peer: SocketAddr,
        terms: Terms,
        port: &Port,
    ) -> Result<Self, BusError> {
        prepare(&stream, Session::patience(terms.max_age)).map_err(|error| {
            BusError::Link(format!("the connection with {peer} broke at once: {error}"))
        })?;
        log::debug!("connected with {peer}");
        Ok(Self {
            stream,
            peer,
            session: Session::new(terms, port.clock().now()),
            announced: false,
            skipped: 0,
        })
    }

    /// The peer's address.
    pub(super) fn peer(&self) -> SocketAddr {
        self.peer
    }

    /// The socket to wait for.
    pub(super) fn stream(&self) -> &TcpStream {
        &self.stream
    }

    /// What to wait for.
    pub(super) fn interest(&self) -> Interest {
        if self.session.to_write().is_empty() {
            Interest::Read
        } else {
            Interest::ReadWrite
        }
    }

    /// Until when to wait for it.
    pub(super) fn deadline(&self) -> Nanos {
        self.session.deadline()
    }

    /// How long the peer has been silent, if its data are stale because of that.
    pub(super) fn stale_for(&self, now: Nanos) -> Option<Nanos> {
        self.session
            .is_stale(now)
            .then(|| self.session.silence(now))
    }

    /// Does what is due: reads if `readable`, sends, checks the time-outs.
    ///
    /// # Errors
    ///
    /// Why the connection has ended.
    pub(super) fn turn(
        &mut self,
        (readable, writable): (bool, bool),
        port: &mut Port,
        frames: &mut Frames,
    ) -> Result<(), BusError> {
        let now = port.clock().now();
        if readable {
            self.read(now, port, frames)?;
        }
        self.send(now, writable, port, frames)?;
        self.session
            .check(now)
            .map_err(|fault| fault.of(self.peer))?;
        self.report(now, port, frames);
        Ok(())
    }

    /// Reads everything that has arrived.
    ///
    /// # Errors
    ///
    /// The peer has closed the connection, or it broke.
    pub(super) fn read_all(
        &mut self,
        port: &mut Port,
        frames: &mut Frames,
    ) -> Result<(), BusError> {
        let now = port.clock().now();
        for _ in 0..READS {
            if !self.read(now, port, frames)? {
                break;
            }
        }
        Ok(())
    }

    /// Reads once; returns whether there was anything.
    fn read(&mut self, now: Nanos, port: &mut Port, frames: &mut Frames) -> Result<bool, BusError> {
        let count = match self.stream.read(self.session.space()) {
            Ok(0) => return Err(self.session.left().of(self.peer)),
            Ok(count) => count,
            Err(error) if is_for_later(&error) => return Ok(false),
            Err(error) => return Err(self.broken(&error)),
        };
        self.session.arrived(now, count);
        while let Some(record) = self.session.take() {
            frames
                .received(now, record, port)
                .map_err(|what| BusError::Protocol(format!("of {}, {what}", self.peer)))?;
        }
        Ok(true)
    }

    /// Makes the records that are due, and writes as much as the system accepts.
    fn send(
        &mut self,
        now: Nanos,
        writable: bool,
        port: &mut Port,
        frames: &mut Frames,
    ) -> Result<(), BusError> {
        let mut may_write = writable || self.session.to_write().is_empty();
        loop {
            if let Some(space) = self.session.due(now) {
                frames.fill(now, space, port);
                let goes = self
                    .session
                    .made(now, |before, now| frames.differ(before, now));
                // A check that sends nothing cannot be lost.
                if goes && !port.sends_of(frames.stations(), now) {
                    self.session.lost();
                }
            }
            let rest = self.session.to_write();
            if rest.is_empty() || !may_write {
                return Ok(());
            }
            match self.stream.write(rest) {
                Ok(count) => {
                    if self.session.wrote(count) {
                        frames.sent(port);
                    } else {
                        may_write = false;
                    }
                }
                Err(error) if is_for_later(&error) => may_write = false,
                Err(error) => return Err(self.broken(&error)),
            }
        }
    }

    /// What to report about the connection, once: that the peer is there.
    pub(super) fn news(&mut self) -> Option<String> {
        if self.announced || !self.session.has_heard() {
            return None;
        }
        self.announced = true;
        Some(format!("connected with {}", self.peer))
    }

    /// Reports the state of the connection to the port.
    fn report(&mut self, now: Nanos, port: &mut Port, frames: &Frames) {
        for station in frames.stations() {
            // A peer with nothing to send counts as alive as long as the connection is up.
            if port.sizes(station).1 == 0 {
                port.touch(station, now);
            }
        }
        while self.skipped < self.session.skipped() {
            self.skipped += 1;
            port.count("socket.skipped");
        }
        port.observe(now);
    }

    fn broken(&self, error: &io::Error) -> BusError {
        let within = match self.session.partial() {
            Some(partial) => format!(" in the middle of a record: {partial} had come"),
            None => String::new(),
        };
        let right = if self.session.has_heard() {
            "see whether the peer still runs"
        } else {
            "see whether the peer runs, and if it serves another client, end that one"
        };
        let peer = self.peer;
        BusError::Link(format!(
            "the connection with {peer} broke{within} ({error}); {right}"
        ))
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        bow_out(&self.stream);
    }
}
