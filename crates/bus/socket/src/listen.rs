//! The end that listens: at each address it serves one peer at a time.

use std::io;
use std::net::SocketAddr;

use tickbus_base::net::TcpStream;
use tickbus_base::os::{Interest, PollSet};
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::tcp::{self, Call, no_wait, not_accepted};
use tickbus_fieldbus::{BusError, Medium, Port};
use tickbus_net::{Acceptor, Address, close_gracefully, prepare};

use super::connection::{Connection, Transfer};
use super::connection_states::ConnectionStates;
use super::{ConnectionFrames, Session, SessionParameters};

/// One address to listen on, and its stations.
#[derive(Debug)]
pub(super) struct Endpoint<'a> {
    pub(super) address: &'a Address,
    /// The name of its station; empty if one address serves all.
    pub(super) name: String,
    pub(super) terms: SessionParameters,
    pub(super) frames: &'a mut ConnectionFrames,
}

/// Serves one client after another at each of the `places` until `stop`. The listeners stay open while
/// clients come and go.
///
/// # Errors
///
/// An address cannot be listened on, or the system cannot wait.
pub(super) fn listen(
    places: Vec<Endpoint<'_>>,
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    let line = |place: &Endpoint<'_>| (place.name.clone(), place.frames.stations());
    let mut lines = ConnectionStates::new(places.iter().map(line));
    let mut servers = Vec::new();
    port.carried_by(Medium::Tcp);
    // A client may connect as soon as the system listens, before this thread continues.
    let since = port.clock().now();
    for (line, place) in places.into_iter().enumerate() {
        let Some((listener, bound)) = tcp::listen(place.address, port, stop)? else {
            return Ok(());
        };
        servers.push(Server {
            line,
            acceptor: Acceptor::new(listener, key(line) + 1).one_per_turn(),
            bound,
            waiting: format!("listening on {bound}"),
            terms: place.terms,
            frames: place.frames,
            served: None,
            watched: None,
        });
    }
    let bound: Vec<String> = servers
        .iter()
        .map(|server| server.bound.to_string())
        .collect();
    port.tell("address", &bound.join(" "));
    for server in &servers {
        lines.opening(server.line, &server.waiting, port);
    }
    let mut set = PollSet::new(stop);
    port.begin_to_look(since);
    let mut now = port.clock().now();
    while !stop.is_stopped() {
        now = turn(now, &mut servers, &mut lines, &mut set, port)?;
    }
    for server in &mut servers {
        if let Some((call, _)) = &mut server.served {
            call.end(port);
        }
    }
    Ok(())
}

/// Waits for all servers, and lets each do its due work. `before` is the time of the turn before; returns that of this one.
fn turn(
    before: Nanos,
    servers: &mut [Server<'_>],
    lines: &mut ConnectionStates,
    set: &mut PollSet,
    port: &mut Port,
) -> Result<Nanos, BusError> {
    // Held-back frames must be passed on in time, even without a client.
    let mut deadline = port.due().min(port.next_look());
    for server in &mut *servers {
        server.watch(before, set).map_err(|error| no_wait(&error))?;
        if let Some((_, served)) = &server.served {
            deadline = deadline.min(served.deadline());
        }
        deadline = deadline.min(server.acceptor.deadline());
    }
    set.wait_after(before, &**port.clock(), deadline)
        .map_err(|error| no_wait(&error))?;
    let now = port.clock().now();
    port.look_at_line(now);
    for server in servers {
        let ready = |key| set.ready().iter().find(|ready| ready.key == key);
        let readable = ready(key(server.line)).is_some_and(|ready| ready.is_readable);
        let knocked = ready(key(server.line) + 1).is_some();
        server.serve(now, readable, knocked, lines, set, port);
        if knocked {
            server.accept(lines, set, port);
        }
    }
    port.observe(now);
    Ok(now)
}

/// The key of a connection in the poll set; its listener's is the next one.
const fn key(line: usize) -> usize {
    2 * line
}

struct Server<'a> {
    /// The index among the lines.
    line: usize,
    acceptor: Acceptor,
    bound: SocketAddr,
    waiting: String,
    terms: SessionParameters,
    frames: &'a mut ConnectionFrames,
    served: Option<(Call<TcpStream>, Connection)>,
    /// The interest in the connection, if there is one.
    watched: Option<Interest>,
}

impl Server<'_> {
    /// Makes `set` wait for what this server needs.
    fn watch(&mut self, now: Nanos, set: &mut PollSet) -> io::Result<()> {
        let key = key(self.line);
        if let Some((call, _)) = &self.served {
            let interest = Some(call.interest());
            if self.watched.is_none() {
                set.add(key, call.stream(), call.interest())?;
            } else if self.watched != interest {
                set.change(key, call.stream(), call.interest())?;
            }
            self.watched = interest;
        }
        self.acceptor.watch(now, set)
    }

    /// Closes the current connection.
    fn part(&mut self, set: &mut PollSet) {
        if let Some((call, _)) = self.served.take()
            && self.watched.take().is_some()
        {
            set.remove(key(self.line), call.stream());
        }
    }

    /// Lets the connection do its due work.
    fn serve(
        &mut self,
        now: Nanos,
        readable: bool,
        knocked: bool,
        lines: &mut ConnectionStates,
        set: &mut PollSet,
        port: &mut Port,
    ) {
        let Some((call, connection)) = &mut self.served else {
            return;
        };
        let mut transfer = Transfer {
            connection,
            frames: self.frames,
            line: self.line,
            lines,
        };
        let mut turned = call.turn(now, readable, &mut transfer, port);
        if turned.is_ok() && knocked {
            // A new client may be the current one, which has reconnected: read the end of its old connection
            // before judging the new one.
            turned = call.read_all(&mut transfer, port);
        }
        if let Err(error) = turned {
            self.part(set);
            lines.lost(self.line, &error, &self.waiting, port);
        }
    }

    /// Takes the next client from the queue: serves it, or turns it away.
    fn accept(&mut self, lines: &mut ConnectionStates, set: &mut PollSet, port: &mut Port) {
        let now = port.clock().now();
        while let Some(accepted) = self.acceptor.accept(now, set) {
            match accepted {
                Ok((stream, peer)) => self.welcome(stream, peer, now, lines, set, port),
                // Peers at other addresses are not affected.
                Err(error) => not_accepted(&error, port),
            }
        }
    }

    fn welcome(
        &mut self,
        stream: TcpStream,
        peer: SocketAddr,
        now: Nanos,
        lines: &mut ConnectionStates,
        set: &mut PollSet,
        port: &mut Port,
    ) {
        if let Some((_, served)) = &self.served {
            let Some(silence) = served.stale_for(now) else {
                let served = served.peer();
                if stream.set_nonblocking().is_ok() {
                    close_gracefully(&stream);
                }
                turn_away(peer, served, port);
                return;
            };
            let error = BusError::Link(format!(
                "{} has been silent for {}",
                served.peer(),
                silence.rounded()
            ));
            self.part(set);
            lines.lost(self.line, &error, &format!("{peer} takes its place"), port);
        }
        let patience = Session::patience(self.terms.max_age);
        // A client whose connection cannot be prepared has gone already.
        if let Err(error) = prepare(stream.os(), patience) {
            log::debug!("the connection with {peer} broke at once: {error}");
            return;
        }
        // Bytes of the client wait for the next look, and may have waited as long as the connection.
        port.look_leaves_some();
        let connection = Connection::new(peer, self.terms, port);
        let reason = format!("{peer} has connected; waiting for its first record");
        lines.opening(self.line, &reason, port);
        self.frames.begin();
        let call = Call::new(stream).of_station(self.frames.stations().start);
        self.served = Some((call, connection));
    }
}

/// Reports that `peer` was not served; its connection is closed.
fn turn_away(peer: SocketAddr, served: SocketAddr, port: &Port) {
    port.count("socket.turned_away");
    port.log(
        log::Level::Warn,
        "turned away",
        format_args!(
            "{peer} was turned away, since one client is served at a time, and that is {served}; end \
             that one first"
        ),
    );
}
