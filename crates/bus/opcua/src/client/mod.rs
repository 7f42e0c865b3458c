//! The client: reads a PLC that is an OPC UA server through a subscription, and writes to it by Write.

mod browse;
mod connect;
mod dial;
mod examine;
mod feed;
mod nodes;
mod readings;
mod search;
mod session;
mod writings;

use std::net::TcpStream;
use std::sync::Arc;

use opcua::types::EndpointDescription;

use tickbus_base::Mistake;
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::tcp;
use tickbus_fieldbus::{BusError, BusSetup, CYCLE, Free, Port, Role, WriteGuard};
use tickbus_image::signal::{Area, DataType, Signal, SignalTable};

use super::pki::Pki;
use super::reactor::{Driven, Reactor};
use super::{ClientOptions, NodeName, Policy};
pub(crate) use browse::browse;
use connect::Login;
use dial::Dial;
pub(crate) use examine::examine;
use feed::Rhythm;
use readings::Readings;
pub(crate) use search::identity as found;
use session::ClientSession;
use writings::Writings;

/// The time for a server to list its endpoints, and again to open a session and have it checked. Within that, the crate
/// gives up single requests after some seconds of real time.
const PATIENCE: Nanos = Nanos::from_secs(60);

/// A server that accepts no bytes for this many times `max_age` is given up.
const SILENCE: i64 = 4;

/// The bus of kind `opcua-client`.
#[derive(Debug)]
pub struct Client {
    options: ClientOptions,
    pki: Pki,
    fields: Vec<Field>,
    table: SignalTable,
    role: Role,
    cycle: Nanos,
    guard: WriteGuard,
}

/// The bus's data of a signal.
#[derive(Clone, Debug)]
struct Field {
    name: String,
    data_type: DataType,
    /// True if the edges must not be lost.
    latched: bool,
    /// True if the signal is read rather than written.
    is_read: bool,
    node: NodeName,
}

impl Client {
    /// The bus that `options` describe, for `line`.
    ///
    /// # Errors
    ///
    /// Node ids and signals do not match.
    pub fn new(options: &ClientOptions, setup: &BusSetup<'_>) -> Result<Self, Mistake> {
        Ok(Self {
            options: options.clone(),
            pki: Pki::new(&options.credentials, setup),
            fields: fields(options, setup)?,
            table: setup.table.clone(),
            role: setup.role,
            cycle: setup.cycle.unwrap_or(CYCLE),
            guard: WriteGuard::of(setup.role, options.write_to.as_deref()),
        })
    }

    /// Connects; `None` if `stop` came first.
    fn dial(&self, port: &mut Port, stop: &Stop) -> Result<Option<Dial>, BusError> {
        let stream = self.stream(port, stop)?;
        Ok(stream.map(|stream| Dial::new(stream, &self.options.url.to_string())))
    }

    fn stream(&self, port: &mut Port, stop: &Stop) -> Result<Option<TcpStream>, BusError> {
        let patience = port.max_age().times(SILENCE);
        let reached = tcp::connect(&self.options.url.address, patience, port, stop)?;
        let stream = reached.map(|(stream, _)| stream.into_os());
        stream.transpose().map_err(|error| tcp::no_wait(&error))
    }

    /// The server's endpoint that matches the options.
    fn endpoint(
        &self,
        client: &opcua::client::Client,
        login: &Login,
        port: &mut Port,
        stop: &Stop,
    ) -> Result<Option<EndpointDescription>, BusError> {
        let Some(dial) = self.dial(port, stop)? else {
            return Ok(None);
        };
        port.opening(&format!("asking {} for its endpoints", self.options.url));
        let reactor = Reactor::new(stop)?;
        let asked = connect::endpoint(client, dial, &self.options, login);
        let deadline = port.clock().now() + PATIENCE;
        let endpoint = match reactor.drive(&**port.clock(), deadline, asked) {
            Driven::Done(endpoint) => endpoint?,
            Driven::Late => return Err(self.late("named its endpoints")),
            Driven::Stopped => return Ok(None),
        };
        if self.options.security != Policy::None {
            let uri = endpoint.server.application_uri.as_ref();
            let certificate = &endpoint.server_certificate;
            self.pki.judge(certificate, self.options.security, uri)?;
        }
        Ok(Some(endpoint))
    }

    fn late(&self, what: &str) -> BusError {
        BusError::Link(format!(
            "{} has not {what} within {PATIENCE}; check that it is an OPC UA server, and not busy",
            self.options.url
        ))
    }
}

impl Free for Client {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        self.guard.part();
        let secure = self.options.security != Policy::None;
        if secure {
            self.pki.prepare()?;
        }
        let login = self.pki.login()?;
        if login.is_some() && !secure {
            log::warn!(
                "the password goes to {} over an unencrypted connection; write another security than \"None\"",
                self.options.url
            );
        }
        let client = connect::client(&self.options, &self.pki, port.max_age());
        let Some(endpoint) = self.endpoint(&client, &login, port, stop)? else {
            return Ok(());
        };
        let Some(dial) = self.dial(port, stop)? else {
            return Ok(());
        };
        port.opening(&format!("opening a session with {}", self.options.url));
        let reactor = Reactor::new(stop)?;
        let inbox = reactor.inbox();
        let clock = Arc::clone(port.clock());
        let deadline = clock.now() + PATIENCE;
        let opened = async {
            let (pki, login) = (&self.pki, login.clone());
            let dialled = (endpoint.clone(), dial);
            let session =
                connect::open(&client, dialled.0, dialled.1, login, pki, inbox.clone()).await?;
            let server = nodes::ask(&session).await?;
            Ok::<_, BusError>((session, server))
        };
        let (session, server) = match reactor.drive(&*clock, deadline, opened) {
            Driven::Done(opened) => opened?,
            Driven::Late => return Err(self.late("opened a session")),
            Driven::Stopped => return Ok(()),
        };
        let writes = self.guard.meet(
            port,
            0..port.stations(),
            &connect::identity(&endpoint, &server.product),
        );
        let publishing = self.options.publishing_interval.unwrap_or(self.cycle);
        let rhythm = Rhythm {
            publishing: publishing.max(Nanos::from_millis(1)),
            sampling: self.options.sampling_interval,
            max_age: port.max_age(),
        };
        let checked = async {
            let nodes = nodes::check(&session, &server, &self.fields, writes).await?;
            let subscribed =
                feed::subscribe(&session, &self.fields, &nodes, rhythm, inbox.clone()).await?;
            Ok((nodes, subscribed))
        };
        let ended = match reactor.drive(&*clock, deadline, checked) {
            Driven::Done(Ok((nodes, publishing))) => {
                port.tell("publishing_interval", &publishing.to_string());
                let (tx, rx) = self.role.areas();
                let talk = ClientSession {
                    session: Arc::clone(&session),
                    reactor: &reactor,
                    inbox,
                    fields: &self.fields,
                    table: &self.table,
                    nodes,
                    readings: Readings::new(&self.table, rx, port),
                    writings: writes.then(|| Writings::new(&self.table, tx)),
                    most_writes: server.most_writes,
                    cycle: self.cycle,
                    running: format!("in session with {}", self.options.url),
                };
                port.opening("waiting for the first values");
                talk.serve(port, stop)
            }
            Driven::Done(Err(error)) => Err(error),
            Driven::Late => Err(self.late("answered all questions about its nodes")),
            Driven::Stopped => Ok(()),
        };
        reactor.farewell(connect::FAREWELL, connect::close(session));
        ended
    }
}

/// The node of each signal.
fn fields(options: &ClientOptions, setup: &BusSetup<'_>) -> Result<Vec<Field>, Mistake> {
    let read: Area = setup.role.areas().1;
    let field = |signal: &Signal| {
        let node = options.node(signal, &setup.table.stations[signal.station]);
        Ok(Field {
            name: signal.name.clone(),
            data_type: signal.data_type,
            latched: signal.latch.is_some(),
            is_read: signal.area == read,
            node: node.map_err(|Mistake { what, right }| {
                Mistake::new(format!("signal \"{}\": {what}", signal.name), right)
            })?,
        })
    };
    setup.table.signals.iter().map(field).collect()
}
