//! One connection without its socket: the session, and its transfers to and from the port.

use std::io;
use std::net::SocketAddr;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::tcp::Caller;
use tickbus_fieldbus::{BusError, Port, Receipt};
use tickbus_net::begins_like_browser;

use super::connection_states::ConnectionStates;
use super::{ConnectionFrames, EndReason, Session, SessionParameters};

/// One connection.
#[derive(Debug)]
pub(super) struct Connection {
    peer: SocketAddr,
    session: Session,
    /// The receipt for the record on its way.
    receipt: Option<Receipt>,
    /// True if the rest of a record has to wait: a fault has cut off its stations.
    is_cut: bool,
    /// True if the peer's presence was reported.
    announced: bool,
    /// The number of skipped cycles that were reported to the port.
    skipped: u64,
}

impl Connection {
    /// A connection that was established just now.
    pub(super) fn new(peer: SocketAddr, terms: SessionParameters, port: &Port) -> Self {
        log::debug!("connected with {peer}");
        Self {
            peer,
            session: Session::new(terms, port.clock().now()),
            receipt: None,
            is_cut: false,
            announced: false,
            skipped: 0,
        }
    }

    /// The peer's address.
    pub(super) fn peer(&self) -> SocketAddr {
        self.peer
    }

    /// How long to wait for the connection.
    pub(super) fn deadline(&self) -> Nanos {
        self.session.deadline()
    }

    /// How long the peer has been silent, if its data are stale because of that.
    pub(super) fn stale_for(&self, now: Nanos) -> Option<Nanos> {
        self.session
            .is_stale(now)
            .then(|| self.session.silence(now))
    }
}

/// A connection with the frames that it transfers, and the line whose state it reports.
pub(super) struct Transfer<'a> {
    pub(super) connection: &'a mut Connection,
    pub(super) frames: &'a mut ConnectionFrames,
    pub(super) line: usize,
    pub(super) lines: &'a mut ConnectionStates,
}

impl Transfer<'_> {
    /// Makes the record if one is due.
    fn make(&mut self, now: Nanos, port: &mut Port) {
        let session = &mut self.connection.session;
        let stations = self.frames.stations();
        let mut is_up = || {
            let mut all = stations.clone();
            all.any(|station| port.is_station_up(station, now))
        };
        self.connection.is_cut = session.is_within_record() && !is_up();
        if self.connection.is_cut {
            session.held_back(now);
        }
        if let Some(space) = session.due(now) {
            let is_up = is_up();
            let frames = is_up.then(|| port.look(stations.clone(), now)).flatten();
            let Some(mut frames) = frames else {
                // The line is down, or all its stations are: the record stays unchanged, and changes are sent when the
                // line is back.
                session.made(now, |_, _| false);
                session.withdraw();
                return;
            };
            self.frames.fill(space, &mut frames);
            // The receipt of these frames: the driver may begin to close now.
            let receipt = frames.receipt();
            // A check that sends nothing cannot be lost.
            if session.made(now, |before, now| self.frames.differ(before, now)) {
                let taken = port.take(stations, now);
                self.connection.receipt = taken.map(|_| receipt);
                if self.connection.receipt.is_none() {
                    session.lost();
                }
            }
        }
    }

    /// Reports the state of the connection: once that the peer is there, and the cycles skipped since.
    fn report(&mut self, now: Nanos, port: &mut Port) {
        let Connection {
            peer,
            session,
            announced,
            skipped,
            ..
        } = &mut *self.connection;
        for station in self.frames.stations() {
            // A peer with nothing to send counts as alive as long as the connection is up.
            if port.sizes(station).1 == 0 {
                port.touch(station, now);
            }
        }
        while *skipped < session.skipped() {
            *skipped += 1;
            port.count("socket.skipped");
        }
        if !*announced && session.has_heard() {
            *announced = true;
            let news = format!("connected with {peer}");
            self.lines.running(self.line, &news, port);
        }
    }
}

impl Caller for Transfer<'_> {
    fn hear(&mut self, now: Nanos, bytes: &[u8], port: &mut Port) -> Result<(), BusError> {
        let Connection { peer, session, .. } = &mut *self.connection;
        // A browser sends the beginning of its request at once.
        if !session.has_heard() && session.partial().is_none() && begins_like_browser(bytes) {
            return Err(EndReason::Browser.of(*peer));
        }
        let mut bytes = bytes;
        while !bytes.is_empty() {
            let space = session.space();
            let (part, rest) = bytes.split_at(space.len().min(bytes.len()));
            space[..part.len()].copy_from_slice(part);
            session.arrived(now, part.len());
            while let Some(record) = session.take() {
                self.frames
                    .received(now, record, port)
                    .map_err(|what| BusError::Protocol(format!("of {peer}, {what}")))?;
            }
            bytes = rest;
        }
        Ok(())
    }

    fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        self.make(now, port);
        Ok(())
    }

    fn to_write(&self, _now: Nanos) -> &[u8] {
        if self.connection.is_cut {
            return &[];
        }
        self.connection.session.to_write()
    }

    fn wrote(&mut self, now: Nanos, count: usize, port: &mut Port) {
        if self.connection.session.wrote(count) {
            if let Some(receipt) = self.connection.receipt.take() {
                self.frames.sent(&receipt, port);
            }
            self.make(now, port);
        }
    }

    fn check(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let Connection { peer, session, .. } = &mut *self.connection;
        session.check(now).map_err(|fault| fault.of(*peer))?;
        self.report(now, port);
        Ok(())
    }

    fn deadline(&self, _port: &Port) -> Nanos {
        self.connection.deadline()
    }

    fn left(&mut self) -> BusError {
        let Connection { peer, session, .. } = &*self.connection;
        session.left().of(*peer)
    }

    fn broke(&mut self, error: &io::Error) -> BusError {
        let Connection { peer, session, .. } = &*self.connection;
        let within = match session.partial() {
            Some(partial) => format!(" in the middle of a record: {partial} had come"),
            None => String::new(),
        };
        let right = if session.has_heard() {
            "see whether the peer still runs"
        } else {
            "see whether the peer runs, and if it serves another client, end that one"
        };
        BusError::Link(format!(
            "the connection with {peer} broke{within} ({error}); {right}"
        ))
    }
}
