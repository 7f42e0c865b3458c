//! The server: one thread for all connections.

use std::io;
use std::net::SocketAddr;

#[cfg(unix)]
use tickbus_base::net::LocalListener;
use tickbus_base::net::TcpListener;
use tickbus_base::os::{Interest, PollSet};
use tickbus_base::time::{Nanos, Simulation};
use tickbus_net::{Acceptor, Address, LocalAddress, bind};

use super::connection::{BLOCKED, Connection};
use super::inbox::Arrived;
use crate::hosting::{Hosting, hear, keep};
use crate::local::Locals;
use crate::server::ToClient;
use crate::{Cause, Ended, Logic, Outcome, Participant, Settings, server};

/// The most connections at a time; further ones are closed at once.
const MOST: usize = if cfg!(test) { 3 } else { 1100 };

/// How often to do everything else while steps follow each other.
const ROUND: Nanos = Nanos::from_millis(10);

/// The least time for a client's machine to acknowledge data: the system repeats lost packets.
const ACKNOWLEDGED: Nanos = Nanos::from_secs(10);

/// The most bytes of values that the server keeps of a client that is ahead, well above a window.
const MOST_AHEAD: usize = 1 << 21;

/// The time for a client to read the end of the run.
const FAREWELL: Nanos = Nanos::from_secs(1);

/// A server that listens for its clients.
#[derive(Debug)]
pub struct Listener {
    socket: TcpListener,
    address: SocketAddr,
    place: String,
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
        Ok(Self {
            socket,
            address,
            place: address.to_string(),
        })
    }

    /// Like [`bind`](Self::bind), at a Unix socket. The file is removed when the run ends; that of a server that was
    /// killed is replaced.
    ///
    /// # Errors
    ///
    /// Another server listens there, a file that is no socket is there, or the system refuses the path or has no Unix
    /// sockets.
    #[cfg(unix)]
    pub fn bind_local(address: &LocalAddress) -> io::Result<Self> {
        let socket = TcpListener::Local(LocalListener::bind(address.path())?);
        Ok(Self {
            address: socket.local_addr()?,
            socket,
            place: address.to_string(),
        })
    }

    /// As on other systems.
    ///
    /// # Errors
    ///
    /// Always: this system has no Unix sockets.
    #[cfg(not(unix))]
    pub fn bind_local(_: &LocalAddress) -> io::Result<Self> {
        Err(super::no_unix_sockets())
    }

    /// The TCP address on which it listens; 0.0.0.0:0 at a Unix socket.
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// The address on which it listens, as clients write it: `HOST:PORT` or `unix:PATH`.
    pub fn place(&self) -> &str {
        &self.place
    }

    /// Waits for the clients and runs until the end.
    ///
    /// # Errors
    ///
    /// Why there was no run, or why it was broken off.
    pub fn run(
        self,
        settings: Settings,
        logic: Logic<'_>,
        hosting: Hosting<'_>,
    ) -> Result<Outcome, Ended> {
        self.run_with(settings, logic, hosting, Vec::new())
    }

    /// Like [`run`](Self::run), with `locals` as clients on the server's own thread. They run while the others do,
    /// without messages.
    ///
    /// # Errors
    ///
    /// The same as for [`run`](Self::run).
    pub fn run_with(
        self,
        settings: Settings,
        logic: Logic<'_>,
        hosting: Hosting<'_>,
        locals: Vec<&mut dyn Participant>,
    ) -> Result<Outcome, Ended> {
        let cannot = |error: io::Error| {
            let reason = format!("the system cannot wait for sockets: {error}");
            Ended::before(Cause::System, reason)
        };
        let now = hosting.clock.now();
        let patience = settings.hang;
        let mut server = server::Server::new(settings, logic, now)
            .map_err(|mistake| Ended::before(Cause::Configuration, mistake.to_string()))?;
        let locals = Locals::join(&mut server, now, locals);
        let mut set = PollSet::new(hosting.controls.stop());
        let mut acceptor = Acceptor::new(self.socket, Acceptor::KEY);
        acceptor.watch(now, &mut set).map_err(cannot)?;
        let mut host = Host {
            server,
            hosting,
            locals,
            acceptor,
            set,
            patience,
            connections: Vec::new(),
            leaving: Vec::new(),
            was_full: false,
            looked: now,
        };
        let outcome = host.run();
        for seat in 0..host.connections.len() {
            host.leave(seat, now);
        }
        outcome
    }
}

struct Host<'l, 'h, 'p> {
    server: server::Server<'l>,
    hosting: Hosting<'h>,
    locals: Locals<'p>,
    acceptor: Acceptor,
    set: PollSet,
    patience: Nanos,
    /// By seats, which are their keys in the set.
    connections: Vec<Option<Connection>>,
    /// Connections with last words to write, and the time when the server gives up.
    leaving: Vec<(Connection, Nanos)>,
    /// The last client that came was turned away.
    was_full: bool,
    /// When all sockets were last checked.
    looked: Nanos,
}

impl Host<'_, '_, '_> {
    fn run(&mut self) -> Result<Outcome, Ended> {
        loop {
            let now = self.hosting.clock.now();
            self.send(now);
            if self.leaving.is_empty()
                && let Some(outcome) = self.server.outcome()
            {
                return outcome.clone();
            }
            // Clients that exchange their values are not waited for one by one.
            let awaited = (self.server.awaited()).filter(|_| !self.server.is_direct());
            if self.leaving.is_empty() && now - self.looked < ROUND {
                if self.locals.run(&mut self.server, now) {
                    self.server.sent(self.hosting.clock.now());
                    continue;
                }
                // While answers are due, read one with a blocking call: all of them are needed anyway.
                if let Some(seat) = awaited {
                    self.read(seat);
                    continue;
                }
            }
            let is_busy = awaited.is_some() || !self.leaving.is_empty();
            if let Err(error) = self.look(is_busy) {
                let reason = format!("the system cannot wait for sockets: {error}");
                self.server.abort(Cause::System, &reason);
            }
        }
    }

    /// Sends all messages.
    fn send(&mut self, now: Nanos) {
        let mut has_asked = false;
        keep(&mut self.server, &mut self.hosting);
        loop {
            while let Some(line) = self.server.news() {
                (self.hosting.news)(&line);
            }
            let Some((seat, message)) = self.server.poll() else {
                break;
            };
            has_asked |= !matches!(message, ToClient::End(_) | ToClient::Waiting(_));
            if self.locals.take(seat, &message) {
                continue;
            }
            let Some(connection) = &mut self.connections[seat] else {
                continue;
            };
            let is_last = matches!(message, ToClient::End(_));
            if is_last {
                connection.never_block();
            }
            let sent = connection.send(&message);
            if is_last {
                self.leave(seat, now);
            } else if let Err(error) = sent {
                self.lose(seat, &error.to_string());
            }
        }
        if has_asked {
            self.server.sent(self.hosting.clock.now());
        }
    }

    /// Reads from a client, and passes on complete frames.
    fn read(&mut self, seat: usize) {
        let Some(connection) = &mut self.connections[seat] else {
            return;
        };
        match connection.read() {
            Arrived::Something => {}
            Arrived::NothingYet => {
                // The client is in no hurry; there is time for the others.
                self.looked = Nanos(i64::MIN);
                return;
            }
            Arrived::Gone(reason) => return self.lose(seat, &reason),
        }
        self.take(seat);
        self.follow();
    }

    /// Passes on the values of clients that are ahead of the server, as far as it can follow.
    fn follow(&mut self) {
        if !self.server.is_direct() {
            return;
        }
        while let Some(seat) = self.server.awaited()
            && self.take(seat)
        {}
    }

    /// Passes on the complete frames of a client, except for values that are ahead of the server; false if there are
    /// none.
    fn take(&mut self, seat: usize) -> bool {
        let now = self.hosting.clock.now();
        let mut has_taken = false;
        while let Some(connection) = self.connections.get_mut(seat).and_then(Option::as_mut) {
            if self.server.is_direct() && connection.has_values() && !self.server.takes(seat) {
                if connection.waiting() > MOST_AHEAD {
                    self.server.violated(seat, "ran ahead of the other clients");
                }
                return has_taken;
            }
            match connection.frame() {
                Ok(None) => return has_taken,
                Ok(Some(frame)) => hear(&mut self.server, now, seat, frame),
                Err(why) => {
                    self.server.violated(seat, &why);
                    return has_taken;
                }
            }
            has_taken = true;
        }
        has_taken
    }

    /// Checks everything: all sockets, controls, time. If `is_busy`, does not wait for long.
    fn look(&mut self, is_busy: bool) -> io::Result<()> {
        let clock = self.hosting.clock;
        let now = clock.now();
        let blocked = self
            .connections
            .iter()
            .flatten()
            .any(Connection::is_blocked);
        let deadline = if is_busy && self.leaving.is_empty() {
            now
        } else if blocked || !self.leaving.is_empty() {
            now + ROUND
        } else {
            self.server.deadline().min(self.acceptor.deadline())
        };
        self.set.wait(clock, deadline)?;
        let now = clock.now();
        self.looked = now;
        for at in 0..self.set.ready().len() {
            let Some(ready) = self.set.ready().get(at).copied() else {
                break;
            };
            match ready.key {
                Acceptor::KEY => self.accept(now)?,
                seat => self.read(seat),
            }
        }
        self.looked = now;
        self.acceptor.watch(now, &mut self.set)?;
        for seat in 0..self.connections.len() {
            if let Some(connection) = &mut self.connections[seat]
                && let Err(error) = connection.write()
            {
                self.lose(seat, &error.to_string());
            }
        }
        self.leaving.retain_mut(|(connection, until)| {
            connection.write().is_ok() && connection.is_blocked() && now < *until
        });
        self.hosting.controls.apply(now, &mut self.server);
        if self.server.is_direct() && now >= self.server.deadline() {
            // Who is waited for depends on what has come from everyone, and on how far the others have come.
            for seat in 0..self.connections.len() {
                self.take(seat);
            }
            for connection in self.connections.iter().flatten() {
                if let Some(step) = connection.last_step() {
                    self.server.is_ahead(step);
                }
            }
        }
        self.server.tick(now);
        self.follow();
        Ok(())
    }

    fn accept(&mut self, now: Nanos) -> io::Result<()> {
        while let Some(accepted) = self.acceptor.accept(now, &mut self.set) {
            let stream = match accepted {
                Ok((stream, _)) => stream,
                Err(error) => {
                    (self.hosting.news)(&error.to_string());
                    continue;
                }
            };
            let is_full = self.connections.iter().flatten().count() + self.leaving.len() >= MOST;
            if is_full && !self.was_full {
                (self.hosting.news)(&format!(
                    "{MOST} clients are connected: further ones are turned away until some have left"
                ));
            }
            self.was_full = is_full;
            if is_full {
                continue;
            }
            // A client whose connection broke at once will connect again.
            let Ok(connection) = Connection::new(stream, self.patience.max(ACKNOWLEDGED)) else {
                continue;
            };
            let seat = self.server.connected(now);
            self.set.add(seat, connection.stream(), Interest::Read)?;
            if seat >= self.connections.len() {
                self.connections.resize_with(seat + 1, || None);
            }
            self.connections[seat] = Some(connection);
        }
        Ok(())
    }

    /// The connection at `seat` is gone.
    fn lose(&mut self, seat: usize, reason: &str) {
        if let Some(connection) = self.connections[seat].take() {
            self.set.remove(seat, connection.stream());
            self.server.lost(seat, reason);
        }
    }

    /// The connection at `seat` has got its last message, or will get it.
    fn leave(&mut self, seat: usize, now: Nanos) {
        if let Some(connection) = self.connections[seat].take() {
            self.set.remove(seat, connection.stream());
            if connection.is_blocked() {
                self.leaving.push((connection, now + FAREWELL));
            }
        }
    }
}

/// A longer block would keep the server from its other clients.
const _: () = assert!(BLOCKED.0 <= 2 * ROUND.0);

#[cfg(test)]
mod tests {
    use std::io::Read as _;
    use std::net::TcpStream;
    use std::sync::Mutex;

    use super::*;
    use crate::server::Control;
    use crate::{Controls, StartCondition};
    use tickbus_base::time::Monotonic;

    #[test]
    fn a_client_that_finds_the_server_full_is_turned_away_and_the_operator_told_once() {
        let settings = Settings::new(Nanos::from_millis(1), StartCondition::Count(1));
        let listener = Listener::bind(&Address::local(0)).expect("a free port");
        let address = listener.address();
        let controls = Controls::default();
        let news = Mutex::new(Vec::new());
        std::thread::scope(|scope| {
            let serving = scope.spawn(|| {
                let hosting = Hosting {
                    clock: &*Monotonic::shared(),
                    controls: &controls,
                    news: &mut |line| news.lock().expect("no panic").push(line.to_owned()),
                };
                listener.run(settings, Logic::new(), hosting)
            });
            let connect = || TcpStream::connect(address).expect("it listens");
            let idle: Vec<_> = (0..MOST).map(|_| connect()).collect();
            for _ in 0..2 {
                // Closed, or reset.
                assert!(matches!(connect().read(&mut [0]), Ok(0) | Err(_)));
            }
            controls.send(Control::Stop);
            serving
                .join()
                .expect("no panic")
                .expect_err("nobody has joined");
            drop(idle);
        });
        let news = news.into_inner().expect("no panic");
        let told = news
            .iter()
            .filter(|line| line.contains("further ones are turned away"));
        assert_eq!(told.count(), 1, "{news:?}");
    }
}
