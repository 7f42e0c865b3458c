//! The server: the signals as nodes, for PLCs and other programs that are OPC UA clients.

mod image;
mod manager;
mod peers;
mod setup;
mod space;
mod units;

use std::collections::BTreeSet;
use std::sync::Arc;

use socket2::SockRef;
use tokio::sync::Notify;

use crate::fieldbus::{BusError, Free, Port, Role, tcp};
use crate::signal::SignalTable;
use crate::time::{Nanos, Pace, Stop};

use super::pki::Pki;
use super::reactor::{Inbox, Reactor};
use super::{Line, Policy, ServerOptions};
use image::Image;
use manager::{News, Visitor, Watched};
use peers::{Peers, Seen};

/// How long clients are given to hear of the end, in real time.
const FAREWELL: std::time::Duration = std::time::Duration::from_millis(200);

/// How often the folder of rejected certificates is looked at.
const LOOK: Nanos = Nanos::from_secs(1);

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

impl Free for Server {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        if self.is_secure() {
            self.pki.prepare()?;
        }
        let login = self.pki.login()?;
        let Some((listener, bound)) = tcp::listen(&self.options.address, port, stop)? else {
            return Ok(());
        };
        // Every connection inherits it: an answer waits for no other.
        let at_once = SockRef::from(&listener).set_tcp_nodelay(true);
        at_once.map_err(|error| tcp::no_wait(&error))?;
        let reactor = Reactor::new(stop)?;
        let inbox: Inbox<News> = reactor.inbox();
        let watched = Watched::default();
        let signals = manager::Signals::new(
            Arc::clone(&self.table),
            self.role.areas().1,
            watched.clone(),
            inbox.clone(),
        );
        let (server, handle) = setup::build(self, login, bound, signals)?;
        let nodes = handle.node_managers().get_of_type();
        let nodes = nodes.expect("it was handed to the server");
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
        let subscriptions = Arc::clone(handle.subscriptions());
        let image = Image::new(&self.table, self.role, port, nodes, subscriptions, watched);
        let service = Service {
            image,
            peers: Peers::default(),
            waiting: format!("listening on {bound}, and nobody has written yet"),
            rejected: self.pki.rejected(),
            pki: self.is_secure().then_some(&self.pki),
            look: port.clock().now() + LOOK,
            // Where nothing is written, readers are the peers.
            receives: (0..port.stations()).any(|station| port.sizes(station).1 > 0),
        };
        let served = service.serve(&reactor, &inbox, self.cycle, port, stop);
        handle.cancel();
        reactor.farewell(FAREWELL, ended.notified());
        served
    }
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
        mut self,
        reactor: &Reactor,
        inbox: &Inbox<News>,
        cycle: Nanos,
        port: &mut Port,
        stop: &Stop,
    ) -> Result<(), BusError> {
        port.opening(&self.waiting);
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
                self.image.show(port, now);
            }
            port.observe(now);
            reactor.wait(&*clock, pace.due().min(port.due()));
        }
        Ok(())
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
