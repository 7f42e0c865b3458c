//! A server for many clients, for any protocol that implements [`Service`].

mod held;
mod service;

use std::collections::{BTreeSet, VecDeque};
use std::io::{self, Read as _, Write as _};
use std::net::SocketAddr;

use crate::{BusError, Port};
use tickbus_base::net::TcpStream;
use tickbus_base::os::{Interest, PollSet, Ready};
use tickbus_base::time::{Nanos, Stop};

use tickbus_net::{Acceptor, Address, close_by_reset, close_gracefully, is_for_later, prepare};

use super::{listen, no_wait, not_accepted};
use held::Held;
pub use service::{Limits, Service};

/// Serves all clients until `stop`. No client affects another one.
///
/// # Errors
///
/// The address cannot be listened on, or the system cannot wait.
pub fn serve<S: Service>(
    address: &Address,
    service: &mut S,
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    // A client may connect as soon as the system listens, before this thread runs again.
    let since = port.clock().now();
    let Some((listener, bound)) = listen(address, port, stop)? else {
        return Ok(());
    };
    let set = PollSet::new(stop);
    let mut server = Server {
        limits: service.limits(),
        service,
        waiting: format!("listening on {bound}"),
        acceptor: Acceptor::new(listener, Acceptor::KEY),
        set,
        clients: Clients::default(),
        buffer: vec![0; BUFFER].into(),
        reply: Vec::with_capacity(BUFFER),
        ready: Vec::new(),
        gone: None,
        now: port.clock().now(),
    };
    let limit = server.limits.telegram;
    assert!(limit <= BUFFER, "a telegram fits into one read");
    port.opening(&server.waiting);
    server.watch(since)?;
    port.begin_to_look(since);
    while !stop.is_stopped() {
        server.turn(port)?;
    }
    if port.leaves_old_values() {
        for (_, client) in server.clients.iter() {
            close_by_reset(&client.stream);
        }
    }
    Ok(())
}

/// At most this many answers to a client are held back.
const HELD: usize = 1000;

/// At most this many bytes are read from a client per turn, before others are served.
const BUFFER: usize = 4096;

struct Server<'a, S: Service> {
    limits: Limits,
    service: &'a mut S,
    waiting: String,
    acceptor: Acceptor,
    set: PollSet,
    /// A client's key in the set is its place.
    clients: Clients<S::Client>,
    /// The receive buffer, shared by all clients.
    buffer: Box<[u8]>,
    /// The answer to the current client.
    reply: Vec<u8>,
    ready: Vec<Ready>,
    /// When and why the last client that had spoken left, for as long as it may come back: some clients reconnect for
    /// every request, and that is no broken line.
    gone: Option<(Nanos, BusError)>,
    /// The time of the last turn.
    now: Nanos,
}

/// The clients, each at an index; indices are reused.
struct Clients<C> {
    places: Vec<Option<Client<C>>>,
    free: Vec<usize>,
    /// The number of clients.
    count: usize,
    /// The number of clients that have sent a valid telegram.
    speakers: usize,
    awaited: Awaited,
    /// The clients with answers that a fault holds back: when the first of them is due, and their places.
    held: Awaited,
}

/// The clients that owe something, the rest of a telegram or the reading of an answer: since when, and their places. A
/// turn looks at the first one only.
type Awaited = BTreeSet<(Nanos, usize)>;

struct Client<C> {
    stream: TcpStream,
    peer: SocketAddr,
    state: C,
    /// When the client was last heard from: its last complete telegram, or its connection.
    heard: Nanos,
    speaks: bool,
    /// Bytes of an incomplete telegram.
    begun: Vec<u8>,
    /// Bytes of an answer that the system has not accepted yet.
    unsent: Vec<u8>,
    /// The time since which either of them has been waiting.
    waits_since: Option<Nanos>,
    /// Answers that a fault holds back, in the order of their requests, each with its time.
    held: VecDeque<Held>,
    /// The entry in [`Clients::held`].
    held_until: Option<Nanos>,
}

impl<C> Default for Clients<C> {
    fn default() -> Self {
        Self {
            places: Vec::new(),
            free: Vec::new(),
            count: 0,
            speakers: 0,
            awaited: Awaited::new(),
            held: Awaited::new(),
        }
    }
}

impl<C> Clients<C> {
    fn insert(&mut self, client: Client<C>) -> usize {
        self.count += 1;
        let place = self.free.pop().unwrap_or_else(|| {
            self.places.push(None);
            self.places.len() - 1
        });
        self.places[place] = Some(client);
        place
    }

    fn remove(&mut self, place: usize) -> Option<Client<C>> {
        let client = self.places.get_mut(place)?.take()?;
        self.free.push(place);
        self.count -= 1;
        self.speakers -= usize::from(client.speaks);
        if let Some(since) = client.waits_since {
            self.awaited.remove(&(since, place));
        }
        if let Some(due) = client.held_until {
            self.held.remove(&(due, place));
        }
        Some(client)
    }

    /// Notes when the next answer of a client is due.
    fn note_held(&mut self, place: usize) {
        let Some(client) = self.places.get_mut(place).and_then(Option::as_mut) else {
            return;
        };
        let due = client.held.front().map(|held| held.due);
        let before = std::mem::replace(&mut client.held_until, due);
        if before == due {
            return;
        }
        if let Some(before) = before {
            self.held.remove(&(before, place));
        }
        if let Some(due) = due {
            self.held.insert((due, place));
        }
    }

    fn iter(&self) -> impl Iterator<Item = (usize, &Client<C>)> {
        let places = self.places.iter().enumerate();
        places.filter_map(|(place, client)| Some((place, client.as_ref()?)))
    }

    /// The client that has been silent for the longest time.
    fn most_silent(&self) -> Option<(usize, Nanos)> {
        let times = self.iter().map(|(place, client)| (place, client.heard));
        times.min_by_key(|(_, heard)| *heard)
    }
}

impl<S: Service> Server<'_, S> {
    /// Waits for clients, except during a pause.
    fn watch(&mut self, now: Nanos) -> Result<(), BusError> {
        let watched = self.acceptor.watch(now, &mut self.set);
        watched.map_err(|error| no_wait(&error))
    }

    fn turn(&mut self, port: &mut Port) -> Result<(), BusError> {
        let deadline = self.deadline(port);
        let waited = self.set.wait_after(self.now, &**port.clock(), deadline);
        waited.map_err(|error| no_wait(&error))?;
        let now = port.clock().now();
        self.now = now;
        port.look_at_line(now);
        self.ready.clear();
        self.ready.extend_from_slice(self.set.ready());
        for index in 0..self.ready.len() {
            let Ready {
                key, is_writable, ..
            } = self.ready[index];
            if key == Acceptor::KEY {
                self.accept(now, port);
            } else if let Err(error) = self.serve_client(key, is_writable, now, port) {
                self.drop_client(key, &error, port);
            }
        }
        self.send_held(now, port);
        self.check_timeouts(now, port);
        self.watch(now)?;
        let max_age = port.max_age();
        if let Some((_, error)) = self.gone.take_if(|(since, _)| now - *since >= max_age) {
            port.lost(&error, &self.waiting);
        }
        port.observe(now);
        Ok(())
    }

    /// The next time at which something is due even without traffic.
    fn deadline(&self, port: &Port) -> Nanos {
        let mut deadline = port
            .due()
            .min(port.next_look())
            .min(self.acceptor.deadline());
        if self.clients.speakers > 0 {
            deadline = deadline.min(port.stale_at(self.now));
        }
        if let Some((since, _)) = self.gone {
            deadline = deadline.min(since + port.max_age());
        }
        if let Some((due, _)) = self.clients.held.first() {
            deadline = deadline.min(*due);
        }
        if let Some((since, _)) = self.clients.awaited.first() {
            deadline = deadline.min(*since + self.limits.patience);
        }
        deadline
    }

    /// Reads from a client and answers it, or continues an answer that had to wait.
    fn serve_client(
        &mut self,
        place: usize,
        is_writable: bool,
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        let Some(client) = self.clients.places.get_mut(place).and_then(Option::as_mut) else {
            return Ok(());
        };
        if !client.unsent.is_empty() {
            if is_writable && client.write_on(port)? {
                // The incomplete telegram is timed from now on, since the server did not read from the client before.
                let since = (!client.begun.is_empty()).then_some(now);
                client.owes_since(since, place, &mut self.clients.awaited);
                let client = &*client;
                let heard = self.set.change(place, &client.stream, Interest::Read);
                heard.map_err(|error| no_wait(&error))?;
            }
            // The server does not read from a client that does not read its answers.
            return Ok(());
        }
        let count = match client.stream.read(&mut self.buffer) {
            Ok(0) => return Err(client.left()),
            Ok(count) => count,
            Err(error) if is_for_later(&error) => return Ok(()),
            Err(error) => return Err(client.broke(&error)),
        };
        port.read(0, count);
        if count == self.buffer.len() {
            port.look_leaves_some();
        }
        if !port.is_up(now) {
            // The line is down: nothing arrives, and half a telegram is useless.
            client.begun.clear();
            client.owes_since(None, place, &mut self.clients.awaited);
            self.service.lost(&mut client.state, &self.buffer[..count]);
            self.service.unheard(&mut client.state, now, port);
            return Ok(());
        }
        self.reply.clear();
        let heard = client.hear(
            &self.buffer[..count],
            self.limits.telegram,
            self.service,
            now,
            &mut self.reply,
            port,
        );
        if !client.held.is_empty() {
            self.clients.note_held(place);
        }
        let Some(client) = self.clients.places[place].as_mut() else {
            return Ok(());
        };
        let (telegrams, error) = match heard {
            Ok(telegrams) => (telegrams, None),
            Err((telegrams, error)) => (telegrams, Some(error)),
        };
        if telegrams > 0 {
            client.heard = now;
            // The incomplete part belongs to another telegram, which has its own time.
            let since = client.waits_since.map(|_| now);
            client.owes_since(since, place, &mut self.clients.awaited);
            if !client.speaks && self.service.speaks(&client.state) {
                client.speaks = true;
                self.gone = None;
                self.clients.speakers += 1;
                let peer = client.peer;
                port.running(&match self.clients.speakers {
                    1 => format!("serving {peer}"),
                    count => format!("serving {count} clients, {peer} among them"),
                });
            }
        }
        let sent = self.send(place, now, port);
        match error {
            Some(error) => Err(error),
            None => sent,
        }
    }

    /// Sends the answers, and updates what the client owes.
    fn send(&mut self, place: usize, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let Some(client) = self.clients.places[place].as_mut() else {
            return Ok(());
        };
        if !self.reply.is_empty() {
            let whole = self.reply.len();
            let taken = match client.stream.write(&self.reply) {
                Ok(count) => count,
                Err(error) if is_for_later(&error) => 0,
                Err(error) => return Err(client.broke(&error)),
            };
            if taken > 0 {
                port.wrote(0, taken, taken == whole);
            }
            if taken == whole {
                // The service does not distinguish the answers that wait.
                if client.held.is_empty() {
                    self.service.replied(&mut client.state, port);
                }
            } else {
                client.unsent.extend_from_slice(&self.reply[taken..]);
                let change = self.set.change(place, &client.stream, Interest::Write);
                change.map_err(|error| no_wait(&error))?;
            }
        }
        let waits = !client.begun.is_empty() || !client.unsent.is_empty();
        if waits != client.waits_since.is_some() {
            client.owes_since(waits.then_some(now), place, &mut self.clients.awaited);
        }
        Ok(())
    }

    /// Sends the answers that were held back and are due.
    fn send_held(&mut self, now: Nanos, port: &mut Port) {
        while let Some((due, place)) = self.clients.held.first().copied() {
            if due > now {
                break;
            }
            self.reply.clear();
            let client = self.clients.places[place].as_mut();
            let client = client.expect("its answers are held back");
            while client.held.front().is_some_and(|held| held.due <= now) {
                let held = client.held.pop_front().expect("it was just there");
                if held.is_lost(now, port) {
                    let stations = &held.stations;
                    self.service
                        .unanswered(&mut client.state, stations, now, port);
                } else {
                    self.reply.extend_from_slice(&held.answer);
                }
            }
            if !client.unsent.is_empty() {
                client.unsent.append(&mut self.reply);
            }
            self.clients.note_held(place);
            if port.is_up(now) {
                if let Err(error) = self.send(place, now, port) {
                    self.drop_client(place, &error, port);
                }
            } else if let Some(client) = self.clients.places[place].as_mut() {
                // What would go out over a line that is down is lost.
                self.service.unheard(&mut client.state, now, port);
            }
        }
    }

    /// Disconnects clients that have kept the server waiting too long.
    fn check_timeouts(&mut self, now: Nanos, port: &mut Port) {
        let patience = self.limits.patience;
        while let Some((since, place)) = self.clients.awaited.first().copied() {
            if now - since < patience {
                break;
            }
            let client = self.clients.places[place].as_ref();
            let error = client.expect("it owes something").too_slow(patience);
            self.drop_client(place, &error, port);
        }
    }

    fn accept(&mut self, now: Nanos, port: &mut Port) {
        while let Some(accepted) = self.acceptor.accept(now, &mut self.set) {
            let (stream, peer) = match accepted {
                Ok(accepted) => accepted,
                Err(error) => {
                    not_accepted(&error, port);
                    continue;
                }
            };
            if self.clients.count >= self.limits.clients && !self.make_room(now, port) {
                port.count("clients.turned_away");
                let most = self.limits.clients;
                port.log(
                    log::Level::Warn,
                    "turned away",
                    format_args!("{peer} was turned away: {most} clients are served, and no more"),
                );
                continue;
            }
            self.welcome(stream, peer, now, port);
        }
    }

    fn welcome(&mut self, stream: TcpStream, peer: SocketAddr, now: Nanos, port: &mut Port) {
        // A connection that cannot be prepared is gone already.
        if let Err(error) = prepare(stream.os(), self.limits.patience) {
            log::debug!("the connection with {peer} broke at once: {error}");
            return;
        }
        let place = self.clients.insert(Client {
            stream,
            peer,
            state: self.service.welcome(peer, now),
            heard: now,
            speaks: false,
            begun: Vec::new(),
            unsent: Vec::new(),
            waits_since: None,
            held: VecDeque::new(),
            held_until: None,
        });
        let client = self.clients.places[place]
            .as_ref()
            .expect("it was just put there");
        if let Err(error) = self.set.add(place, &client.stream, Interest::Read) {
            port.log(
                log::Level::Warn,
                "not served",
                format_args!("{peer} cannot be served: {}", no_wait(&error)),
            );
            self.clients.remove(place);
            return;
        }
        port.count("clients.accepted");
        // The client's bytes wait for the next look, and may have waited as long as its connection.
        port.look_leaves_some();
        self.tell(port);
        if self.clients.speakers == 0 && self.gone.is_none() {
            port.opening(&format!(
                "{peer} has connected; waiting for its first telegram"
            ));
        }
        log::debug!("{peer} has connected");
    }

    /// Disconnects the client that has been silent for the longest time, if that is long enough.
    fn make_room(&mut self, now: Nanos, port: &mut Port) -> bool {
        let Some((place, heard)) = self.clients.most_silent() else {
            return false;
        };
        let silence = now - heard;
        if silence < self.limits.patience {
            return false;
        }
        let error = BusError::Link(format!(
            "it has been silent for {} and another client wants its place",
            silence.rounded()
        ));
        self.drop_client(place, &error, port);
        true
    }

    fn drop_client(&mut self, place: usize, error: &BusError, port: &mut Port) {
        let speakers = self.clients.speakers;
        let Some(client) = self.clients.remove(place) else {
            return;
        };
        self.set.remove(place, &client.stream);
        close_gracefully(&client.stream);
        if !matches!(error, BusError::Left(_)) {
            port.count("clients.dropped");
        }
        self.tell(port);
        let is_left = matches!(error, BusError::Left(_));
        let nobody = self.clients.speakers == 0;
        if nobody && speakers > 0 && is_left {
            self.gone = Some((self.now, error.clone()));
        } else if nobody
            && (speakers > 0 || self.clients.count == 0)
            && !(is_left && self.gone.is_some())
        {
            self.gone = None;
            port.line_ended();
            port.lost(error, &self.waiting);
        } else {
            port.log(
                log::Level::Info,
                "dropped",
                format_args!("{error}; {} clients are served on", self.clients.count),
            );
        }
    }

    fn tell(&self, port: &Port) {
        port.tell("clients", &self.clients.count.to_string());
    }
}

impl<C> Client<C> {
    /// The client at `place` owes something since then, or nothing any more.
    fn owes_since(&mut self, since: Option<Nanos>, place: usize, awaited: &mut Awaited) {
        let before = std::mem::replace(&mut self.waits_since, since);
        if before == since {
            return;
        }
        if let Some(before) = before {
            awaited.remove(&(before, place));
        }
        if let Some(since) = since {
            awaited.insert((since, place));
        }
    }

    /// Takes in `bytes` and answers the telegrams that they complete into `reply`. Returns the number of
    /// telegrams.
    fn hear<S: Service<Client = C>>(
        &mut self,
        bytes: &[u8],
        longest: usize,
        service: &mut S,
        now: Nanos,
        reply: &mut Vec<u8>,
        port: &mut Port,
    ) -> Result<usize, (usize, BusError)> {
        // Clients usually send whole telegrams, which need not be copied.
        let mut begun = std::mem::take(&mut self.begun);
        let bytes = if begun.is_empty() {
            bytes
        } else {
            begun.extend_from_slice(bytes);
            &begun
        };
        let mut rest = bytes;
        let mut telegrams = 0;
        while !rest.is_empty() {
            let begin = reply.len();
            match service.telegram(&mut self.state, now, rest, reply, port) {
                Ok(0) => break,
                Ok(count) => rest = &rest[count..],
                Err(error) => return Err((telegrams, error.of_peer(self.peer))),
            }
            telegrams += 1;
            let (late, pause) = (port.take_lateness(), port.take_pause());
            let waits = late.max(pause) > Nanos::ZERO || !self.held.is_empty();
            if waits && reply.len() > begin {
                if self.held.len() == HELD {
                    let error = BusError::Protocol(format!(
                        "{} has asked {HELD} times without waiting for an answer",
                        self.peer
                    ));
                    return Err((telegrams, error));
                }
                let before = self.held.back();
                let held = Held::new(before, reply.split_off(begin), (now, late), port);
                self.held.extend(held.apart(pause));
            }
        }
        if rest.len() > longest {
            let error = BusError::Protocol(format!(
                "{} sent {} bytes that are no telegram; the longest has {longest}",
                self.peer,
                rest.len()
            ));
            return Err((telegrams, error));
        }
        self.begun = rest.to_vec();
        Ok(telegrams)
    }

    /// Continues an answer; returns true if all of it was sent.
    fn write_on(&mut self, port: &Port) -> Result<bool, BusError> {
        match self.stream.write(&self.unsent) {
            Ok(count) => {
                port.wrote(0, count, count == self.unsent.len());
                self.unsent.drain(..count);
                Ok(self.unsent.is_empty())
            }
            Err(error) if is_for_later(&error) => Ok(false),
            Err(error) => Err(self.broke(&error)),
        }
    }

    fn left(&self) -> BusError {
        let peer = self.peer;
        if self.begun.is_empty() {
            return BusError::Left(format!("{peer} closed the connection"));
        }
        BusError::Protocol(format!(
            "{peer} left in the middle of a telegram, after {} bytes of it",
            self.begun.len()
        ))
    }

    fn broke(&self, error: &io::Error) -> BusError {
        let peer = self.peer;
        BusError::Link(format!(
            "the connection with {peer} broke ({error}); see whether the peer still runs"
        ))
    }

    fn too_slow(&self, patience: Nanos) -> BusError {
        let peer = self.peer;
        if self.unsent.is_empty() {
            return BusError::Protocol(format!(
                "{peer} began a telegram and did not complete it within {patience}: {} bytes have come",
                self.begun.len()
            ));
        }
        BusError::Link(format!(
            "{peer} does not read its answers: {} bytes have waited for {patience}",
            self.unsent.len()
        ))
    }
}

#[cfg(test)]
mod tests;
