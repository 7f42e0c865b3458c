//! The end that waits for connections and serves one at a time.

use std::net::{SocketAddr, TcpListener};

use crate::fieldbus::tcp::{self, Address, bow_out, is_of_the_client, no_wait};
use crate::fieldbus::{BusError, Port};
use crate::os::{Interest, Poller, Source};
use crate::time::{Nanos, Stop};

use super::connection::Connection;
use super::{Comparison, Terms};

/// For how long nobody is accepted beside the served one after the system could not.
const PAUSE: Nanos = Nanos::from_secs(1);

/// Serves one client after the other until `stop`. The listener stays while clients come and go.
///
/// # Errors
///
/// The address cannot be listened on, or the system gives no more sockets.
pub(super) fn listen(
    address: &Address,
    terms: Terms,
    comparison: &mut Comparison,
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    let Some((listener, bound)) = tcp::listen(address, port, stop)? else {
        return Ok(());
    };
    let mut server = Server {
        listener,
        waiting: format!("listening on {bound}"),
        terms,
        served: None,
        deaf_until: Nanos(i64::MIN),
        told: false,
    };
    port.opening(&server.waiting);
    let mut poller = Poller::new(stop).map_err(|error| no_wait(&error))?;
    while !stop.is_stopped() {
        server.turn(&mut poller, comparison, port)?;
    }
    Ok(())
}

struct Server {
    listener: TcpListener,
    waiting: String,
    terms: Terms,
    served: Option<Connection>,
    /// Until when nobody is accepted beside the served one, after the system could not.
    deaf_until: Nanos,
    /// Whether the log knows that clients are turned away while this one is served.
    told: bool,
}

impl Server {
    fn turn(
        &mut self,
        poller: &mut Poller,
        comparison: &mut Comparison,
        port: &mut Port,
    ) -> Result<(), BusError> {
        let knocked = match &mut self.served {
            None => {
                let mut sources = [Source::new(&self.listener, Interest::Read)];
                poller
                    .wait(&**port.clock(), Nanos::MAX, &mut sources)
                    .map_err(|error| no_wait(&error))?;
                sources[0].is_readable()
            }
            Some(served) => {
                let clock = port.clock();
                let mut deadline = served.deadline().min(port.due());
                let mut sources = [served.source(), Source::new(&self.listener, Interest::Read)];
                let mut sources = &mut sources[..];
                if clock.now() < self.deaf_until {
                    deadline = deadline.min(self.deaf_until);
                    sources = &mut sources[..1];
                }
                poller
                    .wait(&**clock, deadline, sources)
                    .map_err(|error| no_wait(&error))?;
                let ready = (sources[0].is_readable(), sources[0].is_writable());
                let knocked = sources.get(1).is_some_and(Source::is_readable);
                let mut turned = served.turn(ready, port, comparison);
                if turned.is_ok() && knocked {
                    // Whoever knocks may be the served one, back again: all of its farewell has to be
                    // read before the newcomer is judged.
                    turned = served.read_all(port);
                }
                if let Err(error) = turned {
                    self.served = None;
                    port.lost(&error, &self.waiting);
                }
                knocked
            }
        };
        if knocked { self.accept(port) } else { Ok(()) }
    }

    /// Takes the next client from the queue: serves it, or turns it away.
    fn accept(&mut self, port: &mut Port) -> Result<(), BusError> {
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
            port.lost(&error, &format!("{peer} takes its place"));
        }
        match Connection::new(stream, peer, self.terms, port) {
            Ok(connection) => {
                port.opening(&format!(
                    "{peer} has connected; waiting for its first record"
                ));
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
