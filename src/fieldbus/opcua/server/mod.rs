//! The server: the signals as nodes, for PLCs and other programs that are OPC UA clients.

mod image;
mod manager;
mod peers;
mod setup;
mod space;
mod units;

use std::collections::BTreeSet;
use std::net::TcpListener;
use std::sync::Arc;

use opcua::server::ServerHandle;
use socket2::SockRef;
use tokio::sync::Notify;

use crate::fieldbus::{BusError, Free, Port, Role, tcp};
use crate::signal::SignalTable;
use crate::time::{Nanos, Pace, Stop};

use super::pki::Pki;
use super::reactor::{Inbox, Reactor};
use super::{Line, Policy, ServerOptions};
use image::{Image, Show};
use manager::{News, Visitor, Watched};
use peers::{Peers, Seen};

/// How long clients are given to hear of the end, in real time.
const FAREWELL: std::time::Duration = std::time::Duration::from_millis(200);

/// How often the folder of rejected certificates is looked at.
const LOOK: Nanos = Nanos::from_secs(1);

/// The crate's server does not forget subscriptions to nodes when the subscription as a whole is deleted. When so
/// many are left behind and nobody is there, it is made anew; the listener stays.
const WORN: usize = 30;

/// The bus of kind `opcua-server`.
#[derive(Debug)]
pub struct Server {
    options: ServerOptions,
    pki: Pki,
    name: String,
    table: Arc<SignalTable>,
    role: Role,
    cycle: Nanos,
}

impl Server {
    /// The bus that `options` describe, for `line`.
    pub fn new(options: &ServerOptions, line: Line<'_>) -> Self {
        Self {
            options: options.clone(),
            pki: Pki::new(&options.credentials, line),
            name: line.name.to_owned(),
            table: Arc::new(line.table.clone()),
            role: line.role,
            cycle: line.cycle(),
        }
    }

    fn is_secure(&self) -> bool {
        self.options
            .security
            .iter()
            .any(|policy| *policy != Policy::None)
    }
}

impl Server {
    /// Starts the crate's server on `listener`.
    fn start(
        &self,
        reactor: &Reactor,
        max_age: Nanos,
        listener: TcpListener,
    ) -> Result<Started, BusError> {
        let bound = listener
            .local_addr()
            .map_err(|error| tcp::no_wait(&error))?;
        let inbox: Inbox<News> = reactor.inbox();
        let watched = Watched::default();
        let signals = manager::Signals::new(
            Arc::clone(&self.table),
            self.role.areas().1,
            watched.clone(),
            inbox.clone(),
        );
        let login = self.pki.login()?;
        let (server, handle) =
            reactor.within(|| setup::build(self, max_age, login, bound, signals))?;
        let nodes = handle.node_managers().get_of_type();
        let show = Show {
            nodes: nodes.expect("it was handed to the server"),
            subscriptions: Arc::clone(handle.subscriptions()),
            watched,
        };
        let ended = Arc::new(Notify::new());
        reactor.spawn({
            let (inbox, ended) = (inbox.clone(), Arc::clone(&ended));
            async move {
                let why = match tokio::net::TcpListener::from_std(listener) {
                    Ok(listener) => server.run_with(listener).await.err(),
                    Err(error) => Some(error.to_string()),
                };
                inbox.push(News::Ended(why.unwrap_or_default()));
                ended.notify_one();
            }
        });
        Ok(Started {
            inbox,
            handle,
            ended,
            show,
        })
    }
}

/// The crate's server, running.
struct Started {
    inbox: Inbox<News>,
    handle: ServerHandle,
    /// Told when it has ended.
    ended: Arc<Notify>,
    show: Show,
}

impl Free for Server {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        if self.is_secure() {
            self.pki.prepare()?;
        }
        let Some((listener, bound)) = tcp::listen(&self.options.address, port, stop)? else {
            return Ok(());
        };
        // Every connection inherits it: an answer waits for no other.
        let refused = |error: std::io::Error| tcp::no_wait(&error);
        SockRef::from(&listener)
            .set_tcp_nodelay(true)
            .map_err(refused)?;
        let waiting = format!("listening on {bound}, and nobody has written yet");
        port.opening(&waiting);
        let mut service: Option<Service<'_>> = None;
        loop {
            let reactor = Reactor::new(stop)?;
            let Started {
                inbox,
                handle,
                ended,
                show,
            } = self.start(
                &reactor,
                port.max_age(),
                listener.try_clone().map_err(refused)?,
            )?;
            let service = match &mut service {
                Some(service) => {
                    service.image.move_to(show);
                    service
                }
                None => service.insert(Service {
                    image: Image::new(&self.table, self.role, port, show, self.options.every_write),
                    peers: Peers::default(),
                    waiting: waiting.clone(),
                    rejected: self.pki.rejected(),
                    pki: self.is_secure().then_some(&self.pki),
                    look: port.clock().now() + LOOK,
                    // Where nothing is written, readers are the peers.
                    receives: (0..port.stations()).any(|station| port.sizes(station).1 > 0),
                }),
            };
            let served = service.serve(&reactor, &inbox, self.cycle, port, stop);
            handle.cancel();
            reactor.farewell(FAREWELL, ended.notified());
            match served? {
                Served::Stopped => return Ok(()),
                Served::Worn => log::debug!("the server begins anew, as nobody is there"),
            }
        }
    }
}

/// How serving ended.
enum Served {
    Stopped,
    /// The crate's server remembers too much of clients that are gone.
    Worn,
}

/// The server while it runs, as its bus sees it.
struct Service<'a> {
    image: Image,
    peers: Peers,
    waiting: String,
    /// The certificates that were turned away, as the log knows them.
    rejected: BTreeSet<String>,
    pki: Option<&'a Pki>,
    /// When they are looked at again.
    look: Nanos,
    /// Whether clients write anything.
    receives: bool,
}

impl Service<'_> {
    fn serve(
        &mut self,
        reactor: &Reactor,
        inbox: &Inbox<News>,
        cycle: Nanos,
        port: &mut Port,
        stop: &Stop,
    ) -> Result<Served, BusError> {
        let clock = Arc::clone(port.clock());
        let mut pace = Pace::new(clock.now(), cycle);
        let mut news = Vec::new();
        while !stop.is_stopped() {
            let now = clock.now();
            inbox.take(&mut news);
            for news in news.drain(..) {
                self.hear(port, now, news)?;
            }
            if pace.take(now) {
                self.look(port, now);
                if self.peers.count() == 0 && self.image.left_behind() >= WORN {
                    return Ok(Served::Worn);
                }
                self.image.show(port, now);
            }
            port.observe(now);
            reactor.wait(&*clock, pace.due().min(port.due()));
        }
        Ok(Served::Stopped)
    }

    fn hear(&mut self, port: &mut Port, now: Nanos, news: News) -> Result<(), BusError> {
        match news {
            News::Written(visitor, lists) => {
                for list in lists {
                    self.image.received(port, now, &list);
                }
                self.meet(port, visitor);
            }
            News::Reads(visitor, signals, done) => {
                self.image.show_to_reader(port, now, &signals);
                if !self.receives {
                    self.meet(port, visitor);
                }
                // The reader may be gone.
                let _ = done.send(());
            }
            News::Ended(why) => {
                return Err(BusError::Link(format!(
                    "the server ended by itself ({why})"
                )));
            }
        }
        Ok(())
    }

    /// A client is a peer from now on.
    fn meet(&mut self, port: &mut Port, visitor: Visitor) {
        if let Some(name) = self.peers.add(visitor) {
            port.running(&format!("serving \"{name}\""));
            port.tell("clients", &self.peers.count().to_string());
        }
    }

    fn look(&mut self, port: &mut Port, now: Nanos) {
        match self.peers.look() {
            Seen::Alive => (0..port.stations()).for_each(|station| port.touch(station, now)),
            Seen::Silent => {}
            Seen::Gone => {
                port.tell("clients", "0");
                let error = BusError::Left("the last client closed its session".to_owned());
                port.lost(&error, &self.waiting);
            }
        }
        if let Some(pki) = self.pki
            && now >= self.look
        {
            self.look = now + LOOK;
            for file in pki.rejected() {
                if !self.rejected.contains(&file) {
                    let folder = pki.folder.display();
                    log::warn!(
                        "a client with an unknown certificate was turned away; to trust it, move \
                         \"{folder}/rejected/{file}\" to \"{folder}/trusted\""
                    );
                    port.count("opcua.rejected_certificates");
                    self.rejected.insert(file);
                }
            }
        }
    }
}
