//! The server: the signals as nodes, for PLCs and other programs that are OPC UA clients.

mod content;
mod image;
mod manager;
mod nodeset;
mod parts;
mod peers;
mod sampling;
mod setup;
mod space;
mod standard;
mod structure;
mod units;
mod verdict;
mod visitor;
mod watched;
mod whole;
mod writers;

use std::net::TcpListener;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use opcua::types::{StatusCode, VariableId, Variant};
use opcua_server::ServerHandle;
use socket2::SockRef;
use tokio::sync::Notify;

use tickbus_base::Mistake;
use tickbus_base::time::{Nanos, Pace, Stop};
use tickbus_fieldbus::{BusError, BusSetup, CYCLE, Events, Free, Port, Rarely, Role, tcp};
use tickbus_image::signal::SignalTable;

use super::looks::TaskLooks;
use super::pki::Pki;
use super::reactor::{Inbox, Reactor};
use super::rejects::Rejects;
use super::{Policy, ServerOptions, Trust};
use image::{Image, Show};
use manager::{Own, Visit};
use peers::{Peers, Seen};
use space::Places;
use verdict::Verdict;
use visitor::Visitor;
use watched::Watched;
use writers::Writers;

/// The time for clients to learn of the end, in real time.
const FAREWELL: std::time::Duration = std::time::Duration::from_millis(200);

/// How often the folder of rejected certificates is checked, in real time.
const LOOK: std::time::Duration = std::time::Duration::from_secs(1);

/// The function codes by which faults of answers distinguish the services Read and Write.
const READ: u8 = 4;
const WRITE: u8 = 5;

/// The most sessions at the same time.
const SESSIONS: usize = 100;

/// async-opcua 0.19 retains the monitored items of a subscription that ends as a whole, up to 200 bytes each. If at
/// least this many have ended and no client is connected, the crate's server is recreated; the listener stays.
const WORN: usize = 10;

/// The bus of kind `opcua-server`.
#[derive(Debug)]
pub struct Server {
    options: ServerOptions,
    pki: Pki,
    name: String,
    table: Arc<SignalTable>,
    places: Arc<Places>,
    role: Role,
    cycle: Nanos,
    events: Events,
}

impl Server {
    /// The bus that `options` describe, for `line`.
    ///
    /// # Errors
    ///
    /// A mistake in a `NodeSet2` file.
    pub fn new(options: &ServerOptions, setup: &BusSetup<'_>) -> Result<Self, Mistake> {
        let mut pki = Pki::new(&options.credentials, setup);
        pki.host.clone_from(&options.host);
        let identity = &options.identity;
        if let Some(name) = &identity.application {
            pki.application.clone_from(name);
        }
        if let Some(uri) = &identity.uri {
            pki.uri.clone_from(uri);
        }
        let places = Places::new(options, setup.table, setup.folder);
        let places = places.map_err(|mistakes| {
            let mut mistakes = mistakes.into_iter();
            mistakes.next().expect("at least one").1
        })?;
        Ok(Self {
            options: options.clone(),
            pki,
            name: setup.name.to_owned(),
            places: Arc::new(places),
            table: Arc::new(setup.table.clone()),
            role: setup.role,
            cycle: setup.cycle.unwrap_or(CYCLE),
            events: setup.events,
        })
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
        port: &Port,
        listener: TcpListener,
        rejects: &Arc<Mutex<Rejects>>,
    ) -> Result<Started, BusError> {
        let bound = listener
            .local_addr()
            .map_err(|error| tcp::no_wait(&error))?;
        let inbox: Inbox<Visit> = reactor.inbox();
        let (watched, tasks_alone) = (Watched::default(), Arc::default());
        let wall = self.pki.wall;
        let max_age = port.max_age();
        let writers = Arc::new(Writers::new(
            self.options.is_single_writer,
            self.table.signals.len(),
            (Arc::clone(port.clock()), max_age),
        ));
        let own = Own {
            reads: self.role.areas().1,
            watched: watched.clone(),
            writers: Arc::clone(&writers),
            inbox: inbox.clone(),
            wall,
            checks_applications: self.pki.trust == Trust::Listed,
            tasks_alone: Arc::clone(&tasks_alone),
        };
        let signals = manager::Signals::new(Arc::clone(&self.table), &self.places, own);
        let login = self.pki.login()?;
        let (server, handle) =
            reactor.within(|| setup::build(self, max_age, login, bound, signals))?;
        let nodes = handle.node_managers().get_of_type();
        let show = Show {
            nodes: nodes.expect("it was handed to the server"),
            subscriptions: Arc::clone(handle.subscriptions()),
            watched,
            writers,
            wall,
        };
        if self.is_secure() {
            reactor.spawn(look_after(Arc::clone(rejects), inbox.clone()));
        }
        let ended = Arc::new(Notify::new());
        reactor.spawn({
            let (inbox, ended) = (inbox.clone(), Arc::clone(&ended));
            async move {
                let why = match tokio::net::TcpListener::from_std(listener) {
                    Ok(listener) => server.run_with(listener).await.err(),
                    Err(error) => Some(error.to_string()),
                };
                inbox.push(Visit::Ended(why.unwrap_or_default()));
                ended.notify_one();
            }
        });
        Ok(Started {
            inbox,
            handle,
            ended,
            show,
            tasks_alone,
        })
    }
}

/// The mistakes in `NodeSet2` files and in the lines that name nodes in them, with their offsets in the driver.cfg.
pub(crate) fn check_nodesets(
    options: &ServerOptions,
    folder: &Path,
    table: &SignalTable,
) -> Vec<(usize, Mistake)> {
    Places::new(options, table, folder)
        .err()
        .unwrap_or_default()
}

/// Checks the folder of rejected certificates outside the bus thread, because file operations may be slow.
async fn look_after(rejects: Arc<Mutex<Rejects>>, inbox: Inbox<Visit>) {
    loop {
        tokio::time::sleep(LOOK).await;
        let rejects = Arc::clone(&rejects);
        let look = move || {
            // The list is consistent after every change, so a poisoned lock is safe to use.
            let mut rejects = rejects.lock().unwrap_or_else(PoisonError::into_inner);
            rejects.look()
        };
        match tokio::task::spawn_blocking(look).await {
            Ok(found) if found.count > 0 => {
                inbox.push(Visit::Rejected(found.files, found.count));
            }
            Ok(_) => {}
            // The bus is closing.
            Err(_) => return,
        }
    }
}

/// The crate's server, running.
struct Started {
    inbox: Inbox<Visit>,
    handle: ServerHandle,
    /// Notified when the server has ended.
    ended: Arc<Notify>,
    show: Show,
    /// The number of the server's tasks without any connection.
    tasks_alone: Arc<AtomicUsize>,
}

impl Started {
    /// True if there is no connection, not even one without a session so far, and no session waits for its client to
    /// return.
    fn is_alone(&self, reactor: &Reactor) -> bool {
        let sessions =
            VariableId::Server_ServerDiagnostics_ServerDiagnosticsSummary_CurrentSessionCount;
        let sessions = self.handle.info().diagnostics.get(sessions);
        let none = Some(Variant::UInt32(0));
        reactor.tasks() <= self.tasks_alone.load(Ordering::Relaxed)
            && sessions.is_some_and(|sessions| sessions.value == none)
    }
}

impl Free for Server {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        if self.is_secure() {
            self.pki.prepare()?;
        }
        let Some((listener, bound)) = tcp::listen(&self.options.address, port, stop)? else {
            return Ok(());
        };
        let refused = |error: std::io::Error| tcp::no_wait(&error);
        let listener = listener.into_os().map_err(refused)?;
        // All connections inherit this: answers are sent at once, without waiting for more.
        SockRef::from(&listener)
            .set_tcp_nodelay(true)
            .map_err(refused)?;
        let waiting = format!("listening on {bound}, and nobody has written yet");
        port.opening(&waiting);
        let rejects = Rejects::new(self.pki.folder.join("rejected"));
        let rejects = Arc::new(Mutex::new(rejects));
        let mut service: Option<Service<'_>> = None;
        loop {
            let reactor = Reactor::new(stop)?;
            let listener = listener.try_clone().map_err(refused)?;
            // A client may connect at once, before this thread continues.
            port.begin_to_look(port.clock().now());
            let mut started = self.start(&reactor, port, listener, &rejects)?;
            let show = started.show.clone();
            let service = match &mut service {
                Some(service) => {
                    service.image.move_to(show);
                    service
                }
                None => service.insert(Service {
                    image: Image::new(
                        &self.table,
                        &self.places,
                        self.role,
                        port,
                        show,
                        self.events == Events::Writes,
                    ),
                    peers: Peers::default(),
                    table: &self.table,
                    waiting: waiting.clone(),
                    pki: &self.pki,
                    is_single_writer: self.options.is_single_writer,
                    turned_away: Rarely::default(),
                }),
            };
            match service.serve(&reactor, &mut started, self.cycle, port, stop) {
                // No client is connected; new ones wait at the listener.
                Ok(Served::Worn) => port.count("opcua.begun_anew"),
                ended => {
                    started.handle.cancel();
                    reactor.farewell(FAREWELL, started.ended.notified());
                    return ended.map(|_| ());
                }
            }
        }
    }
}

/// The outcome of serving.
enum Served {
    Stopped,
    /// The crate's server retains too much data of clients that have gone.
    Worn,
}

/// The running server as its bus sees it.
struct Service<'a> {
    image: Image,
    peers: Peers,
    table: &'a SignalTable,
    waiting: String,
    pki: &'a Pki,
    is_single_writer: bool,
    /// Clients rejected because their certificate is unknown or not their own.
    turned_away: Rarely,
}

impl Service<'_> {
    fn serve(
        &mut self,
        reactor: &Reactor,
        started: &mut Started,
        cycle: Nanos,
        port: &mut Port,
        stop: &Stop,
    ) -> Result<Served, BusError> {
        let clock = Arc::clone(port.clock());
        let mut pace = Pace::new(clock.now(), cycle);
        let mut news = Vec::new();
        let mut looks = TaskLooks::new();
        while !stop.is_stopped() {
            let now = clock.now();
            let has_waited = looks.look(port, now);
            started.inbox.take(&mut news);
            for news in news.drain(..) {
                self.hear(port, now, news)?;
            }
            // Signs of life that waited are as old as all other waiting input.
            if pace.take(now) || has_waited {
                self.look(port, now);
                if self.image.left_behind() >= WORN && started.is_alone(reactor) {
                    return Ok(Served::Worn);
                }
                self.image.show(port, now);
                if port.is_ending() && started.is_alone(reactor) {
                    port.line_ended();
                }
            }
            port.observe(now);
            reactor.wait(&*clock, pace.due().min(port.due()).min(port.next_look()));
        }
        Ok(Served::Stopped)
    }

    fn hear(&mut self, port: &mut Port, now: Nanos, news: Visit) -> Result<(), BusError> {
        match news {
            Visit::Written(visitor, lists) => {
                for list in &lists {
                    self.image.received(port, now, list);
                }
                let table = self.table;
                let written = lists.iter().flatten();
                let stations = written.map(|(signal, _)| table.signals[*signal].station);
                self.meet(port, visitor, stations);
            }
            Visit::Reads(visitor, mut signals, is_read, done) => {
                let mut verdict = Verdict::default();
                if is_read {
                    verdict = self.judge(port, now, &signals, READ);
                    // A refused value is not shown, so a pulse in it waits for the next Read.
                    let is_refused = |signal: &usize| {
                        let station = self.table.signals[*signal].station;
                        verdict.refused.iter().any(|(of, _)| *of == station)
                    };
                    signals.retain(|signal| !is_refused(signal));
                }
                self.image.show_to_reader(port, now, &signals);
                // If no station is writable, the reading clients are the peers.
                let stations = signals.iter().map(|at| self.table.signals[*at].station);
                let fed: Vec<usize> = stations
                    .filter(|station| port.sizes(*station).1 == 0)
                    .collect();
                if !fed.is_empty() {
                    self.meet(port, visitor, fed);
                }
                // The reader may have gone.
                let _ = done.send(verdict);
            }
            Visit::Writes(signals, done) => {
                let verdict = self.judge(port, now, &signals, WRITE);
                // The writer may have gone.
                let _ = done.send(verdict);
            }
            Visit::SecondWriter(writer, other) => {
                let clients = (&writer as _, &other as _);
                tcp::report_second(port, "opcua.second_writer", clients, self.is_single_writer);
            }
            Visit::Impostor(why) => {
                port.count("opcua.refused_applications");
                if let Some(times) = self.turned_away.count(("opcua", "application")) {
                    log::warn!(
                        "a client gets no values, as its certificate is not its own ({why}); give it a \
                         certificate for its ApplicationUri, or write trust = \"any\"{times}"
                    );
                }
            }
            Visit::Rejected(files, count) => {
                let folder = self.pki.folder.display();
                for file in files {
                    if let Some(times) = self.turned_away.count(("opcua", "certificate")) {
                        log::warn!(
                            "a client with an unknown certificate was turned away; to trust it, move \
                             \"{folder}/rejected/{file}\" to \"{folder}/trusted\"{times}"
                        );
                    }
                }
                for _ in 0..count {
                    port.count("opcua.rejected_certificates");
                }
            }
            Visit::Ended(why) => {
                return Err(BusError::Link(format!(
                    "the server ended by itself ({why})"
                )));
            }
        }
        Ok(())
    }

    /// How faults change the answer to a request that concerns these signals.
    fn judge(&self, port: &mut Port, now: Nanos, signals: &[usize], function: u8) -> Verdict {
        let stations = signals.iter().map(|at| self.table.signals[*at].station);
        let mut stations: Vec<usize> = stations.collect();
        stations.sort_unstable();
        stations.dedup();
        let refused = stations.into_iter().filter_map(|station| {
            let code = port.answer_status(station, function, now)?;
            Some((station, StatusCode::from(code)))
        });
        let refused = refused.collect();
        Verdict {
            refused,
            late: port.take_lateness(),
        }
    }

    /// From now on a client is a peer of these stations.
    fn meet(
        &mut self,
        port: &mut Port,
        visitor: Visitor,
        stations: impl IntoIterator<Item = usize>,
    ) {
        if let Some(name) = self.peers.add(visitor, stations) {
            port.running(&format!("serving \"{name}\""));
            port.tell("clients", &self.peers.count().to_string());
        }
    }

    fn look(&mut self, port: &mut Port, now: Nanos) {
        let seen = self.peers.look(|station| port.touch(station, now));
        if seen != Seen::Same {
            self.image.forget_writers_that_left();
            port.tell("clients", &self.peers.count().to_string());
        }
        if seen == Seen::Gone {
            let error = BusError::Left("the last client closed its session".to_owned());
            port.lost(&error, &self.waiting);
        }
    }
}
