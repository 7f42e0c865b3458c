//! The end that waits for connections: one peer at a time for each address that it listens on.

use std::net::{SocketAddr, TcpListener};

use crate::fieldbus::tcp::{self, Address, bow_out, is_of_the_client, no_wait};
use crate::fieldbus::{BusError, Port};
use crate::os::{Interest, Poller, Source};
use crate::time::{Nanos, Stop};

use super::connection::Connection;
use super::lines::Lines;
use super::{Frames, Terms};

/// For how long nobody is accepted beside the served one after the system could not.
const PAUSE: Nanos = Nanos::from_secs(1);

/// What is served at one address.
#[derive(Debug)]
pub(super) struct Place<'a> {
    pub(super) address: &'a Address,
    /// The name of its station; empty where one address serves all.
    pub(super) name: String,
    pub(super) terms: Terms,
    pub(super) frames: &'a mut Frames,
}

/// Serves one client after the other at each of the `places` until `stop`. The listeners stay while clients come
/// and go.
///
/// # Errors
///
/// An address cannot be listened on, or the system gives no more sockets.
pub(super) fn listen(places: Vec<Place<'_>>, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
    let mut lines = Lines::new(places.iter().map(|place| place.name.clone()));
    let mut servers = Vec::new();
    for (line, place) in places.into_iter().enumerate() {
        let Some((listener, bound)) = tcp::listen(place.address, port, stop)? else {
            return Ok(());
        };
        servers.push(Server {
            line,
            listener,
            bound,
            waiting: format!("listening on {bound}"),
            terms: place.terms,
            frames: place.frames,
            served: None,
            deaf_until: Nanos(i64::MIN),
            told: false,
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
    let mut poller = Poller::new(stop).map_err(|error| no_wait(&error))?;
    while !stop.is_stopped() {
        turn(&mut servers, &mut lines, &mut poller, port)?;
    }
    Ok(())
}

/// Waits for all servers, and lets each do what there is to do.
fn turn(
    servers: &mut [Server<'_>],
    lines: &mut Lines,
    poller: &mut Poller,
    port: &mut Port,
) -> Result<(), BusError> {
    let now = port.clock().now();
    let mut deadline = Nanos::MAX;
    let mut sources = Vec::with_capacity(2 * servers.len());
    for server in &*servers {
        if let Some(served) = &server.served {
            deadline = deadline.min(served.deadline()).min(port.due());
            sources.push(served.source());
        }
        if server.is_deaf(now) {
            deadline = deadline.min(server.deaf_until);
        } else {
            sources.push(Source::new(&server.listener, Interest::Read));
        }
    }
    poller
        .wait(&**port.clock(), deadline, &mut sources)
        .map_err(|error| no_wait(&error))?;
    let mut ready = sources
        .iter()
        .map(|source| (source.is_readable(), source.is_writable()));
    let ready: Vec<(Option<(bool, bool)>, bool)> = servers
        .iter()
        .map(|server| {
            let served = server.served.as_ref().and_then(|_| ready.next());
            let knocked = !server.is_deaf(now) && ready.next().is_some_and(|ready| ready.0);
            (served, knocked)
        })
        .collect();
    for (server, (ready, knocked)) in servers.iter_mut().zip(ready) {
        if let Some(ready) = ready {
            server.serve(ready, knocked, lines, port);
        }
        if knocked {
            server.accept(lines, port)?;
        }
    }
    Ok(())
}

struct Server<'a> {
    /// Its number among the lines.
    line: usize,
    listener: TcpListener,
    bound: SocketAddr,
    waiting: String,
    terms: Terms,
    frames: &'a mut Frames,
    served: Option<Connection>,
    /// Until when nobody is accepted beside the served one, after the system could not.
    deaf_until: Nanos,
    /// Whether the log knows that clients are turned away while this one is served.
    told: bool,
}

impl Server<'_> {
    fn is_deaf(&self, now: Nanos) -> bool {
        self.served.is_some() && now < self.deaf_until
    }

    /// Lets the connection do what there is to do.
    fn serve(&mut self, ready: (bool, bool), knocked: bool, lines: &mut Lines, port: &mut Port) {
        let Some(served) = &mut self.served else {
            return;
        };
        let mut turned = served.turn(ready, port, self.frames);
        if turned.is_ok()
            && let Some(news) = served.news()
        {
            lines.running(self.line, &news, port);
        }
        if turned.is_ok() && knocked {
            // Whoever knocks may be the served one, back again: all of its farewell has to be
            // read before the newcomer is judged.
            turned = served.read_all(port, self.frames);
        }
        if let Err(error) = turned {
            self.served = None;
            lines.lost(self.line, &error, &self.waiting, port);
        }
    }

    /// Takes the next client from the queue: serves it, or turns it away.
    fn accept(&mut self, lines: &mut Lines, port: &mut Port) -> Result<(), BusError> {
        let now = port.clock().now();
        let (stream, peer) = match self.listener.accept() {
            Ok(accepted) => accepted,
            Err(error) if is_of_the_client(&error) => return Ok(()),
            Err(error) if self.served.is_some() => {
                log::warn!("a client could not be accepted: {error}");
                self.deaf_until = now + PAUSE;
                return Ok(());
            }
            Err(error) => {
                return Err(BusError::Link(format!(
                    "a client could not be accepted ({error}); close other programs or raise the \
                     limit of open files"
                )));
            }
        };
        if let Some(served) = &self.served {
            let Some(silence) = served.stale_for(now) else {
                let served = served.peer();
                if stream.set_nonblocking(true).is_ok() {
                    bow_out(&stream);
                }
                self.turn_away(peer, served, port);
                return Ok(());
            };
            let error = BusError::Link(format!(
                "{} has been silent for {}",
                served.peer(),
                silence.rounded()
            ));
            self.served = None;
            lines.lost(self.line, &error, &format!("{peer} takes its place"), port);
        }
        match Connection::new(stream, peer, self.terms, port) {
            Ok(connection) => {
                let reason = format!("{peer} has connected; waiting for its first record");
                lines.opening(self.line, &reason, port);
                self.frames.begin();
                self.served = Some(connection);
                self.told = false;
            }
            // Gone again before it was there.
            Err(error) => log::debug!("{error}"),
        }
        Ok(())
    }

    /// Tells that `peer`, whose connection is closed, was not served.
    fn turn_away(&mut self, peer: SocketAddr, served: SocketAddr, port: &Port) {
        port.count("socket.turned_away");
        // A client that comes again and again shall not fill the log.
        let level = if std::mem::replace(&mut self.told, true) {
            log::Level::Debug
        } else {
            log::Level::Warn
        };
        log::log!(
            level,
            "{peer} was turned away, since one client is served at a time, and that is {served}; end \
             that one first"
        );
    }
}
