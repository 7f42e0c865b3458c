//! The dispatcher on a TCP port: one thread for all connections.

use std::fmt;
use std::io::{self, Read as _, Write as _};
use std::net::SocketAddr;
use std::thread;

use tickbus_base::net::{TcpListener, TcpStream};
use tickbus_base::os::{Interest, PollSet, Ready, peer_silence};
use tickbus_base::time::{Clock, Nanos, Simulation, Stop};
use tickbus_net::{Acceptor, Address, bind, close_gracefully, is_for_later, prepare, watch_peer};

use crate::dispatcher::Dispatcher;
use crate::door::Door;
use crate::patch_file::PatchFile;
use crate::post::Post;
use crate::saver::Saver;
use crate::trickle::Trickle;

/// At most this many bytes are read from a client per turn, before others are served.
const BUFFER: usize = 64 * 1024;

/// How often to check for peers that have not confirmed sent bytes.
const LOOK: Nanos = Nanos::from_secs(1);

/// A computer that has confirmed nothing for this long is gone.
const SILENCE: Nanos = Nanos::from_secs(3);

/// How long the system keeps bytes that a client does not read. This is not the dispatcher's limit: it disconnects
/// clients that are silent for 60 s, and clients that only send need not read.
const PATIENCE: Nanos = Nanos::from_secs(3600);

/// A listening port.
pub struct Listener {
    socket: TcpListener,
    address: SocketAddr,
    post: Option<Box<dyn Post>>,
}

impl fmt::Debug for Listener {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Listener")
            .field("address", &self.address)
            .finish_non_exhaustive()
    }
}

/// The environment of a dispatcher on a port.
pub struct Hosting<'h> {
    /// The clock.
    pub clock: &'h dyn Clock,
    /// Ends the dispatcher.
    pub stop: &'h Stop,
    /// The way in for other threads, if any; made for the same `stop`.
    pub door: Option<&'h Door>,
    /// The file that keeps the patch, if any.
    pub patch_file: Option<&'h PatchFile>,
    /// Takes news for an operator, one line each.
    pub news: &'h mut dyn FnMut(&str),
}

impl Listener {
    /// Listens on `address`; port 0 lets the system choose one.
    ///
    /// # Errors
    ///
    /// The host is unknown, or the address cannot be listened on.
    pub fn bind(address: &Address) -> io::Result<Self> {
        Self::bind_in(address, None)
    }

    /// Like [`bind`](Self::bind), on the network of `simulation` if there is one.
    ///
    /// # Errors
    ///
    /// The same as for `bind`.
    pub fn bind_in(address: &Address, simulation: Option<&dyn Simulation>) -> io::Result<Self> {
        let (socket, address) = bind(address, simulation)?;
        let post = None;
        Ok(Self {
            socket,
            address,
            post,
        })
    }

    /// The transport of letters, for a dispatcher that is one of several.
    #[must_use]
    pub fn with_post(mut self, post: Box<dyn Post>) -> Self {
        self.post = Some(post);
        self
    }

    /// The address on which it listens.
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves all clients until stopped.
    ///
    /// # Errors
    ///
    /// The system cannot wait for sockets.
    pub fn run(self, dispatcher: &mut Dispatcher, hosting: Hosting<'_>) -> io::Result<()> {
        let mut set = PollSet::new(hosting.stop);
        let mut acceptor = Acceptor::new(self.socket, Acceptor::KEY);
        acceptor.watch(Nanos::ZERO, &mut set)?;
        let mut host = Host {
            dispatcher,
            hosting,
            acceptor,
            post: self.post,
            set,
            connections: Vec::new(),
            buffer: vec![0; BUFFER].into(),
            ready: Vec::new(),
            trickle: Trickle::default(),
            next_look: Nanos::MAX,
            saver: None,
            unsaved: None,
        };
        if let Some(file) = host.hosting.patch_file {
            host.saver = Some(Saver::start(file.clone(), host.hosting.stop.clone())?);
        }
        let mut outcome = Ok(());
        while outcome.is_ok() && !host.hosting.stop.is_stopped() {
            outcome = host.turn();
        }
        if let Some(door) = host.hosting.door {
            door.close();
        }
        host.save_the_rest();
        for seat in 0..host.connections.len() {
            host.close(seat);
        }
        outcome
    }
}

struct Connection {
    stream: TcpStream,
    /// The events that the poll set waits for; `None` while the connection is not in the set.
    interest: Option<Interest>,
    /// Bytes were written since the peer last confirmed everything.
    is_unconfirmed: bool,
}

impl Connection {
    /// Waits for different events from now on.
    fn watch(
        &mut self,
        set: &mut PollSet,
        seat: usize,
        wanted: Option<Interest>,
    ) -> io::Result<()> {
        match (self.interest, wanted) {
            (before, after) if before == after => return Ok(()),
            (Some(_), Some(interest)) => set.change(seat, &self.stream, interest)?,
            (None, Some(interest)) => set.add(seat, &self.stream, interest)?,
            // Clearing the interest is not enough: the system would keep reporting a broken connection.
            (_, None) => set.remove(seat, &self.stream),
        }
        self.interest = wanted;
        Ok(())
    }
}

struct Host<'d, 'h> {
    dispatcher: &'d mut Dispatcher,
    hosting: Hosting<'h>,
    acceptor: Acceptor,
    post: Option<Box<dyn Post>>,
    set: PollSet,
    /// By seats, which are their keys in the set.
    connections: Vec<Option<Connection>>,
    /// The receive buffer, shared by all clients.
    buffer: Box<[u8]>,
    ready: Vec<Ready>,
    trickle: Trickle,
    /// When to check next for peers that have not confirmed sent bytes.
    next_look: Nanos,
    /// Saves the patch, if there is a file; `unsaved` is why saving failed last.
    saver: Option<Saver>,
    unsaved: Option<String>,
}

impl Host<'_, '_> {
    fn turn(&mut self) -> io::Result<()> {
        let accept = self.acceptor.deadline();
        let deadline = self.dispatcher.deadline().min(accept).min(self.next_look);
        self.set.wait(self.hosting.clock, deadline)?;
        let now = self.hosting.clock.now();
        self.dispatcher.woke(now);
        self.ready.clear();
        self.ready.extend_from_slice(self.set.ready());
        for at in 0..self.ready.len() {
            let ready = self.ready[at];
            if ready.key == Acceptor::KEY {
                self.accept(now)?;
                continue;
            }
            if ready.is_readable {
                self.read(now, ready.key)?;
            }
            if ready.is_writable {
                self.write(ready.key)?;
            }
        }
        if let Some(door) = self.hosting.door {
            door.serve(self.dispatcher, now);
        }
        self.dispatcher.tick(now);
        if now >= self.next_look {
            self.look(now);
        }
        self.save(false);
        while let Some(seat) = self.dispatcher.next_touched() {
            self.write(seat)?;
        }
        if let Some(post) = &mut self.post {
            while post.has_room()
                && let Some((to, letter)) = self.dispatcher.next_letter()
            {
                post.send(to, letter);
            }
        }
        while let Some(news) = self.dispatcher.next_news() {
            (self.hosting.news)(&news);
        }
        self.acceptor.watch(now, &mut self.set)?;
        if self.trickle.turn(now, self.dispatcher.traffic().lines) {
            thread::yield_now();
        }
        Ok(())
    }

    /// Saves the patch. All authors of changes wait for the disk, with one write for all; values do not wait.
    fn save(&mut self, waits: bool) {
        let Some(saver) = &mut self.saver else {
            if self.dispatcher.unsaved().is_some() {
                self.dispatcher.saved(&Ok(()));
            }
            return;
        };
        if let Some(saved) = saver.outcome(waits) {
            self.dispatcher.saved(&saved);
            match (saved.err(), &mut self.unsaved) {
                (None, None) => {}
                (None, before) => {
                    *before = None;
                    (self.hosting.news)("the patch is saved again");
                }
                (Some(why), before) if before.as_ref() == Some(&why) => {}
                (Some(why), before) => {
                    (self.hosting.news)(&format!(
                        "the patch could not be saved ({why}); what changes now is lost at the end"
                    ));
                    *before = Some(why);
                }
            }
        }
        if let Some(patch) = self.dispatcher.unsaved()
            && saver.save(patch)
        {
            self.dispatcher.saving();
        }
    }

    /// Saves and answers all changes before the end.
    fn save_the_rest(&mut self) {
        if self.saver.is_none() {
            return;
        }
        // First the save that is under way, then the changes since.
        for _ in 0..3 {
            self.save(true);
        }
        while let Some(seat) = self.dispatcher.next_touched() {
            // The end does not wait for clients.
            let _ = self.write(seat);
        }
    }

    /// Closes connections whose other computer has gone without a word.
    fn look(&mut self, now: Nanos) {
        self.next_look = Nanos::MAX;
        for seat in 0..self.connections.len() {
            let Some(connection) = self.connections[seat]
                .as_mut()
                .filter(|it| it.is_unconfirmed)
            else {
                continue;
            };
            match connection.stream.os().and_then(peer_silence) {
                Some(silence) if silence >= SILENCE => {
                    self.drop_client(seat);
                    continue;
                }
                Some(_) => {}
                None => connection.is_unconfirmed = false,
            }
            self.next_look = now + LOOK;
        }
    }

    fn read(&mut self, now: Nanos, seat: usize) -> io::Result<()> {
        let Some(connection) = self.connections.get_mut(seat).and_then(Option::as_mut) else {
            return Ok(());
        };
        if !self.dispatcher.wants_bytes(seat) {
            // The client waits for an answer, perhaps from another host. Lines that arrive meanwhile must not keep this
            // thread awake. The end of the wait touches the seat, and `write` then waits for bytes again.
            let wanted = match connection.interest {
                Some(Interest::ReadWrite | Interest::Write) => Some(Interest::Write),
                Some(Interest::Read) | None => None,
            };
            return connection.watch(&mut self.set, seat, wanted);
        }
        match connection.stream.read(&mut self.buffer) {
            Ok(0) => self.drop_client(seat),
            Ok(count) => self.dispatcher.arrived(now, seat, &self.buffer[..count]),
            Err(error) if is_for_later(&error) => {}
            Err(_) => self.drop_client(seat),
        }
        Ok(())
    }

    /// Writes as much as the system accepts, and closes after the last byte if asked to.
    fn write(&mut self, seat: usize) -> io::Result<()> {
        let Some(connection) = self.connections.get_mut(seat).and_then(Option::as_mut) else {
            return Ok(());
        };
        let mut is_blocked = false;
        while !is_blocked {
            let bytes = self.dispatcher.to_write(seat);
            if bytes.is_empty() {
                break;
            }
            let length = bytes.len();
            match connection.stream.write(bytes) {
                Ok(count) if count > 0 => {
                    self.dispatcher.wrote(seat, count);
                    connection.is_unconfirmed = true;
                    if self.next_look == Nanos::MAX {
                        self.next_look = self.hosting.clock.now() + LOOK;
                    }
                    is_blocked = count < length;
                }
                Err(error) if is_for_later(&error) => is_blocked = true,
                Ok(_) | Err(_) => {
                    self.drop_client(seat);
                    return Ok(());
                }
            }
        }
        if self.dispatcher.is_closing(seat) {
            // A client that does not read misses the last lines.
            self.close(seat);
            return Ok(());
        }
        let wanted = match (is_blocked, self.dispatcher.wants_bytes(seat)) {
            (false, true) => Some(Interest::Read),
            (false, false) => None,
            (true, true) => Some(Interest::ReadWrite),
            (true, false) => Some(Interest::Write),
        };
        connection.watch(&mut self.set, seat, wanted)
    }

    /// Removes a client whose connection is gone.
    fn drop_client(&mut self, seat: usize) {
        if let Some(mut connection) = self.connections[seat].take() {
            // Clearing an interest cannot fail.
            let _ = connection.watch(&mut self.set, seat, None);
            self.dispatcher.gone(seat);
        }
    }

    /// Closes the connection of a seat.
    fn close(&mut self, seat: usize) {
        if let Some(connection) = &self.connections[seat] {
            close_gracefully(&connection.stream);
            self.drop_client(seat);
        }
    }

    fn accept(&mut self, now: Nanos) -> io::Result<()> {
        while let Some(accepted) = self.acceptor.accept(now, &mut self.set) {
            let (stream, peer) = match accepted {
                Ok(accepted) => accepted,
                Err(error) => {
                    (self.hosting.news)(&error.to_string());
                    continue;
                }
            };
            // A client whose connection broke at once will connect again.
            if prepare(stream.os(), PATIENCE).is_err() || watch_peer(stream.os()).is_err() {
                continue;
            }
            let seat = match self.dispatcher.connected(now, peer) {
                Ok(seat) => seat,
                Err(refusal) => {
                    // A new connection has room for one line. If it is gone already, so is the line.
                    let _ = (&stream).write(format!("{refusal}\r\n").as_bytes());
                    close_gracefully(&stream);
                    continue;
                }
            };
            self.set.add(seat, &stream, Interest::Read)?;
            if seat >= self.connections.len() {
                self.connections.resize_with(seat + 1, || None);
            }
            let interest = Some(Interest::Read);
            self.connections[seat] = Some(Connection {
                stream,
                interest,
                is_unconfirmed: false,
            });
        }
        Ok(())
    }
}
