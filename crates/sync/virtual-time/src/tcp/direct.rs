//! A line to the server that can leave the server's path: the clients of a run send each other their values, and the
//! server gets them in batches.
//!
//! For the client everything stays as it is: this line answers in place of the server.

use tickbus_base::net::TcpStream;
use tickbus_base::os::{Interest, PollSet};
use tickbus_base::time::{Nanos, Stop};

use super::inbox::Arrived;
use super::line::{LOOK, TcpLine};
use super::peers::{Door, Peers};
use crate::client::Line;
use crate::mesh::{Mesh, Next};
use crate::server::ToClient;
use crate::wire::{self, FromServer};
use crate::{Cause, Ended, MemberList};

/// The longest time that values wait before the server gets them, while steps follow each other.
const REPORT: Nanos = Nanos::from_millis(2);

/// The bytes of values that wait at most.
const BATCH: usize = 1 << 14;

/// How long the server may take to end a run that has lost a client, before this client says so.
const GRACE: Nanos = Nanos::from_secs(2);

/// The keys of the server and of a client in the set.
const SERVER: usize = 0;
const PEER: usize = 1;

/// A line of a client that can meet others.
#[derive(Debug)]
pub(super) struct DirectLine {
    server: TcpLine,
    state: State,
    /// The frame that was received last, while not all go straight through.
    frame: Vec<u8>,
}

#[derive(Debug)]
enum State {
    /// Before the start.
    Before,
    /// The server has asked for the address.
    Open(u64, Door),
    /// The other clients are connected; true if the server lets them run.
    Met(Box<Direct>, bool),
    /// The run of clients that exchange their values.
    Direct(Box<Direct>),
    /// The server passes the values on.
    Through,
}

#[derive(Debug)]
struct Direct {
    mesh: Mesh,
    own: usize,
    peers: Peers,
    others: Box<[usize]>,
    /// Values that the server has not got yet.
    report: Vec<u8>,
    reported: Nanos,
    /// Why the run cannot continue, until the server says so.
    broken: Option<String>,
    /// The server has this reason.
    has_told: bool,
    /// The frame of the line is the end of the run.
    has_ended: bool,
}

/// The effect of a frame of the server.
enum Heard {
    Nothing,
    /// The frame is for the client.
    Frame,
}

impl DirectLine {
    pub(super) const fn new(server: TcpLine) -> Self {
        Self {
            server,
            state: State::Before,
            frame: Vec::new(),
        }
    }

    /// Receives a frame of the server, for `limit` at most, and acts on it.
    fn hear_server(&mut self, limit: Nanos) -> Result<Heard, Ended> {
        let frame = self.server.receive(limit)?;
        self.frame.clear();
        self.frame.extend_from_slice(frame);
        let message = wire::from_server(&self.frame);
        match (message, &mut self.state) {
            (Ok(FromServer::Meet(token)), State::Before | State::Open(..) | State::Met(..)) => {
                self.open(token);
                Ok(Heard::Nothing)
            }
            (Ok(FromServer::Members(list)), State::Open(..)) => {
                self.meet(&list);
                Ok(Heard::Nothing)
            }
            // The list of a meeting that was broken off.
            (Ok(FromServer::Members(_)), State::Before | State::Met(..)) => Ok(Heard::Nothing),
            (Ok(FromServer::Until(until)), State::Met(direct, is_let)) => {
                direct.mesh.allow(until);
                *is_let = true;
                Ok(Heard::Nothing)
            }
            (Ok(FromServer::Until(until)), State::Direct(direct)) => {
                direct.mesh.allow(until);
                Ok(Heard::Nothing)
            }
            (Ok(FromServer::Start { .. }), state) => {
                *state = match std::mem::replace(state, State::Through) {
                    State::Met(direct, true) => State::Direct(direct),
                    _ => State::Through,
                };
                Ok(Heard::Frame)
            }
            (Ok(FromServer::End(Ok(outcome))), State::Direct(direct)) => {
                match direct.mesh.outcome() {
                    Some(own) if own.steps == outcome.steps && own.hash != outcome.hash => {
                        let what = format!(
                            "the trace hash of this client is {}, and that of the server {}",
                            own.hash, outcome.hash
                        );
                        Err(Ended::before(Cause::Protocol, what))
                    }
                    _ => Ok(Heard::Frame),
                }
            }
            _ => Ok(Heard::Frame),
        }
    }

    /// Opens a door for the other clients, and tells the server where.
    fn open(&mut self, token: u64) {
        let door = Door::open(self.server.stream());
        let mut out = Vec::new();
        let address = door.as_ref().map_or("", |door| &door.address);
        wire::at(&mut out, token, address);
        self.server.send(&out);
        self.state = door.map_or(State::Before, |door| State::Open(token, door));
    }

    /// Connects with the other clients, and tells the server if that has worked.
    fn meet(&mut self, list: &MemberList) {
        let State::Open(token, door) = std::mem::replace(&mut self.state, State::Before) else {
            return;
        };
        if list.token != token {
            return;
        }
        let met = Mesh::new(list).and_then(|mesh| {
            let peers = Peers::meet(&door, list, self.server.clock())?;
            Ok(Direct {
                mesh,
                own: list.own,
                others: peers.places().collect(),
                peers,
                report: Vec::new(),
                reported: self.server.clock().now(),
                broken: None,
                has_told: false,
                has_ended: false,
            })
        });
        let mut out = Vec::new();
        let reason = met.as_ref().err().map_or("", |reason| reason);
        wire::met(&mut out, token, reason);
        self.server.send(&out);
        if let Ok(direct) = met {
            self.state = State::Met(Box::new(direct), false);
        }
    }

    /// Receives in a run of clients that exchange their values: the next step of this client, or what the server says.
    fn receive_direct(&mut self, limit: Nanos) -> Result<(), Ended> {
        // When the wait for another client began, if that has lasted for a while.
        let mut begun = None;
        loop {
            let State::Direct(direct) = &mut self.state else {
                return Ok(());
            };
            if direct.has_ended {
                return Ok(());
            }
            if direct.broken.is_some() {
                return self.await_end();
            }
            match direct.mesh.advance() {
                Next::Run(step) => {
                    self.frame.clear();
                    let reads = direct.mesh.reads();
                    wire::to_client(&mut self.frame, &ToClient::Step { step, reads });
                    self.frame.drain(..wire::HEADER);
                    return Ok(());
                }
                Next::Server => {
                    direct.flush(&mut self.server);
                    if let Heard::Frame = self.hear_server(limit)? {
                        return Ok(());
                    }
                }
                Next::Wait(client) => match direct.hear(client) {
                    Arrived::Something => begun = None,
                    Arrived::Gone(reason) => direct.broken = Some(reason),
                    Arrived::NothingYet => {
                        direct.flush(&mut self.server);
                        let begun = *begun.get_or_insert_with(|| self.server.clock().now());
                        if let Some(ended) = self.server.impatient(begun, limit) {
                            return Err(ended);
                        }
                        let other = direct.peers.stream(client);
                        let until = self.server.clock().now() + LOOK;
                        if has_sent(&self.server, Some(other), until)
                            && let Heard::Frame = self.hear_server(limit)?
                        {
                            return Ok(());
                        }
                    }
                },
            }
        }
    }

    /// The run cannot continue. The server knows why, or learns it from this client.
    fn await_end(&mut self) -> Result<(), Ended> {
        let State::Direct(direct) = &mut self.state else {
            return Ok(());
        };
        direct.flush(&mut self.server);
        let reason = direct.broken.clone().unwrap_or_default();
        let begun = self.server.clock().now();
        let mut has_told = direct.has_told;
        loop {
            match self.hear_server(GRACE) {
                Ok(Heard::Frame) if wire::is_end(&self.frame) => return Ok(()),
                Err(ended) if ended.cause != Cause::Hung || has_told => return Err(ended),
                Ok(_) | Err(_) => {}
            }
            // Otherwise the reason of the server is the better one: it knows who has gone.
            if !has_told && self.server.clock().now() >= begun + GRACE - LOOK {
                has_told = true;
                let mut out = Vec::new();
                wire::give_up(&mut out, &reason);
                self.server.send(&out);
            }
        }
    }

    /// Sends the values of a step to all.
    fn send_values(&mut self, frame: &[u8]) {
        let State::Direct(direct) = &mut self.state else {
            return self.server.send(frame);
        };
        direct.report.extend_from_slice(frame);
        let is_right = direct.mesh.hear(direct.own, &frame[wire::HEADER..]);
        if is_right.is_err() {
            // The server says so, to everyone.
            direct.broken = Some("its own values are wrong".to_owned());
            return direct.flush(&mut self.server);
        }
        for at in 0..direct.others.len() {
            if !self.send_to(at, frame) {
                return;
            }
        }
        let State::Direct(direct) = &mut self.state else {
            return;
        };
        let now = self.server.clock().now();
        if direct.report.len() >= BATCH || now >= direct.reported + REPORT {
            direct.flush(&mut self.server);
            direct.reported = now;
        }
    }

    /// Sends the values of a step to one of the others; false if the run has ended.
    fn send_to(&mut self, at: usize, frame: &[u8]) -> bool {
        let mut left = frame;
        while !left.is_empty() {
            let State::Direct(direct) = &mut self.state else {
                return false;
            };
            let client = direct.others[at];
            match direct.peers.send(client, left) {
                Ok(0) => {}
                Ok(count) => {
                    left = &left[count..];
                    continue;
                }
                // The next read of this client says so.
                Err(_) => return true,
            }
            // The client does not read. The server may know why.
            direct.flush(&mut self.server);
            let now = self.server.clock().now();
            let ended = match self.server.impatient(now, Nanos::MAX) {
                None if has_sent(&self.server, None, now) => self.hear_server(LOOK).map(|_| ()),
                None => continue,
                Some(ended) => Err(ended),
            };
            let is_end = wire::is_end(&self.frame);
            let State::Direct(direct) = &mut self.state else {
                return false;
            };
            match ended {
                Ok(()) if is_end => direct.has_ended = true,
                Ok(()) => continue,
                Err(ended) => direct.broken = Some(ended.reason),
            }
            return false;
        }
        true
    }
}

/// Waits up to `until` for a frame of the server, or for bytes of another client; true if the server has sent something.
fn has_sent(server: &TcpLine, other: Option<&TcpStream>, until: Nanos) -> bool {
    if server.has_frame() {
        return true;
    }
    // A new set for each call: only those wait here who have been waiting for long.
    let mut set = PollSet::new(&Stop::new());
    let added = set.add(SERVER, server.stream(), Interest::Read);
    let added = added.and_then(|()| match other {
        Some(other) => set.add(PEER, other, Interest::Read),
        None => Ok(()),
    });
    let waited = added.and_then(|()| set.wait(server.clock(), until));
    // If the system cannot wait, reading says why.
    waited.is_err() || set.ready().iter().any(|ready| ready.key == SERVER)
}

impl Direct {
    /// Sends the server all values that it has not got.
    fn flush(&mut self, server: &mut TcpLine) {
        if !self.report.is_empty() {
            server.send(&self.report);
            self.report.clear();
        }
    }

    /// Takes the values of another client, or reads once.
    fn hear(&mut self, client: usize) -> Arrived {
        let violated = |mesh: &Mesh, why: String| {
            Arrived::Gone(format!(
                "\"{}\" violates the protocol: it {why}",
                mesh.name(client)
            ))
        };
        match self.peers.frame(client) {
            Err(why) => violated(&self.mesh, why),
            Ok(Some(frame)) => match self.mesh.hear(client, frame) {
                Ok(()) => Arrived::Something,
                Err(why) => violated(&self.mesh, why),
            },
            Ok(None) => match self.peers.read(client) {
                Arrived::Gone(why) => {
                    let name = self.mesh.name(client);
                    Arrived::Gone(format!("the connection with \"{name}\" was lost: {why}"))
                }
                read => read,
            },
        }
    }
}

impl Line for DirectLine {
    fn send(&mut self, frame: &[u8]) {
        match &mut self.state {
            State::Direct(_) if wire::is_done(&frame[wire::HEADER..]) => self.send_values(frame),
            State::Direct(direct) => {
                // The client gives up: the server says so to all.
                (direct.broken, direct.has_told) = (Some(String::new()), true);
                direct.flush(&mut self.server);
                self.server.send(frame);
            }
            _ => self.server.send(frame),
        }
    }

    fn receive(&mut self, limit: Nanos) -> Result<&[u8], Ended> {
        match &self.state {
            State::Through => return self.server.receive(limit),
            State::Direct(_) => self.receive_direct(limit)?,
            _ => while !matches!(self.hear_server(limit)?, Heard::Frame) {},
        }
        Ok(&self.frame)
    }

    fn leave_within(&mut self, limit: Nanos) {
        self.server.leave_within(limit);
    }
}
