//! The steps of an examination that are OPC UA's own: endpoints, certificates, the session, and each signal's node.

use std::sync::Arc;

use opcua::client::Session;
use opcua::types::{
    AttributeId, DataValue, EndpointDescription, NodeId, ReadValueId, StatusCode, VariableId,
    Variant,
};

use super::connect::{self, Login, Unopened};
use super::dial::Dial;
use super::feed::{Notification, state};
use super::nodes::{self, ATTRIBUTES, READS, Server};
use super::{Field, fields};
use crate::pki::{Pki, meaning};
use crate::reactor::{Driven, Inbox, Reactor};
use crate::{ClientOptions, Policy, hello};
use tickbus_base::time::{Clock, Nanos};
use tickbus_fieldbus::PlcState;
use tickbus_fieldbus::examine::{Examination, Peer, Round};

/// The time for a server to answer a question; with certificates it computes for a while.
const PATIENCE: Nanos = Nanos::from_secs(10);

/// The most signals that are read one by one, besides those that have to change.
const SINGLES: usize = 500;

/// The most nodes of one request while values are watched: small servers refuse more.
const TOGETHER: usize = 100;

/// Where a conversation with a server stands.
pub(super) struct Line<'a> {
    options: &'a ClientOptions,
    peer: Peer,
    pki: Pki,
    client: opcua::client::Client,
    login: Login,
    pub(super) reactor: Reactor,
    /// The news of the session.
    pub(super) inbox: Inbox<Notification>,
    pub(super) clock: Arc<dyn Clock>,
}

/// A session with a server.
pub(super) struct Met<'a> {
    pub(super) line: Line<'a>,
    endpoint: EndpointDescription,
    pub(super) session: Arc<Session>,
    pub(super) server: Server,
}

impl Line<'_> {
    fn dial(&self) -> Option<Dial> {
        let stream = self.peer.dial().ok()?.socket().ok()?;
        stream.set_nonblocking(true).ok()?;
        Some(Dial::new(stream, &self.options.url.to_string()))
    }

    /// Runs `future` to its end; `None` if that takes longer than [`PATIENCE`], or was stopped.
    pub(super) fn drive<T>(&self, future: impl Future<Output = T>) -> Option<T> {
        match self
            .reactor
            .drive(&*self.clock, self.clock.now() + PATIENCE, future)
        {
            Driven::Done(done) => Some(done),
            Driven::Late | Driven::Stopped => None,
        }
    }
}

/// Examines the line of a client.
pub(crate) fn examine(options: &ClientOptions, examination: &mut Examination<'_>) {
    let Some(met) = meet(options, examination) else {
        return;
    };
    let Met {
        line,
        endpoint,
        session,
        server,
    } = met;
    let identity = connect::identity(&endpoint, &server.product);
    examination.compare_identity(&identity, options.write_to.as_deref());
    examination.sizes("the server reports changes");
    if let Ok(fields) = fields(options, &examination.setup) {
        let nodes = addresses(&line, examination, (&session, &server), &fields);
        if let Some(nodes) = nodes
            && run_state(&line, examination, &session)
            && !nodes.is_empty()
        {
            examination.watch_values(|| round(&line, &session, &nodes, fields.len()));
        }
    }
    line.reactor
        .farewell(connect::FAREWELL, connect::close(session));
}

/// Opens a session, step by step; `None` if one has failed.
pub(super) fn meet<'a>(
    options: &'a ClientOptions,
    examination: &mut Examination<'_>,
) -> Option<Met<'a>> {
    let (peer, mut wire) = examination.reach(&options.url.address)?;
    if !hello::says_hello(examination, &mut wire, &options.url) {
        return None;
    }
    drop(wire);
    let line = prepare(options, examination, peer)?;
    let endpoint = endpoint(&line, examination)?;
    let (session, server) = open(&line, examination, &endpoint)?;
    Some(Met {
        line,
        endpoint,
        session,
        server,
    })
}

/// The step `certificates`: the files of this end.
fn prepare<'a>(
    options: &'a ClientOptions,
    examination: &mut Examination<'_>,
    peer: Peer,
) -> Option<Line<'a>> {
    let pki = Pki::new(&options.credentials, &examination.setup);
    let ready = match options.security {
        Policy::None => Ok(()),
        _ => pki.prepare(),
    };
    let login = ready.and_then(|()| pki.login());
    let (login, reactor) =
        match login.and_then(|login| Ok((login, Reactor::new(examination.stop)?))) {
            Ok(ready) => ready,
            Err(error) => {
                let next = "correct the folder pki, or the place of the password";
                examination.fail("files", "certificate-files", error.to_string(), next);
                return None;
            }
        };
    let client = connect::client(options, &pki, examination.setup.max_age);
    Some(Line {
        options,
        peer,
        pki,
        client,
        login,
        inbox: reactor.inbox(),
        reactor,
        clock: Arc::clone(examination.setup.clock),
    })
}

/// The steps `endpoints` and `certificate`.
fn endpoint(line: &Line<'_>, examination: &mut Examination<'_>) -> Option<EndpointDescription> {
    let asked = line
        .dial()
        .and_then(|dial| line.drive(line.client.get_endpoints(dial, &[], &[])));
    let endpoints = match asked {
        Some(Ok(endpoints)) => endpoints,
        other => {
            let why = other
                .and_then(Result::err)
                .map_or("no answer".to_owned(), |error| error.to_string());
            let next = "see whether the server is busy, and its log";
            examination.fail(
                "endpoints",
                "not-opcua",
                format!("the server lists no endpoints ({why})"),
                next,
            );
            return None;
        }
    };
    let endpoint = match connect::choose(&endpoints, line.options, &line.login) {
        Ok(endpoint) => endpoint,
        Err(none) => {
            let (told, next) = none
                .text
                .rsplit_once("; ")
                .unwrap_or((&none.text, "see the server's settings"));
            examination.fail("endpoints", none.cause, told, next);
            return None;
        }
    };
    let name = endpoint.server.application_name.text.as_ref();
    examination.ok(
        "endpoints",
        format!("\"{name}\" has {}", connect::shown(&endpoint)),
    );
    if line.options.security == Policy::None {
        return Some(endpoint);
    }
    let uri = endpoint.server.application_uri.as_ref();
    match line
        .pki
        .judge(&endpoint.server_certificate, line.options.security, uri)
    {
        Ok(()) => {
            examination.ok("certificate", "the certificate of the server is trusted");
            Some(endpoint)
        }
        Err(error) => {
            let next = "if it is the right server, move its certificate to the folder \"trusted\" below pki";
            examination.fail(
                "certificate",
                "certificate-unknown",
                error.to_string(),
                next,
            );
            None
        }
    }
}

/// The step `session`.
fn open(
    line: &Line<'_>,
    examination: &mut Examination<'_>,
    endpoint: &EndpointDescription,
) -> Option<(Arc<Session>, Server)> {
    let dial = line.dial()?;
    let inbox = line.inbox.clone();
    let opened = line.drive(async {
        let login = line.login.clone();
        let session = connect::open(
            &line.client,
            endpoint.clone(),
            dial,
            login,
            &line.pki,
            inbox,
        )
        .await?;
        let server = nodes::ask(&session).await.map_err(|error| Unopened {
            status: StatusCode::BadUnexpectedError,
            error,
        })?;
        Ok::<_, Unopened>((session, server))
    });
    match opened {
        Some(Ok(opened)) => {
            examination.ok("session", "the server has opened a session");
            Some(opened)
        }
        Some(Err(Unopened { status, error })) => {
            let (cause, next) = refused(status, line);
            let why = format!("{error} ({status})");
            examination.fail("session", cause, why, next);
            None
        }
        None => {
            let next = "see whether the server is busy, and its log";
            examination.fail(
                "session",
                "silent",
                format!("no session within {PATIENCE}"),
                next,
            );
            None
        }
    }
}

/// The cause behind the status with which a server refuses a session, and the next thing to try.
fn refused(status: StatusCode, line: &Line<'_>) -> (&'static str, &'static str) {
    match status {
        StatusCode::BadTooManySessions
        | StatusCode::BadMaxConnectionsReached
        | StatusCode::BadTcpServerTooBusy => (
            "too-many-sessions",
            "end other clients, or raise the number of sessions in the server",
        ),
        StatusCode::BadIdentityTokenRejected
        | StatusCode::BadIdentityTokenInvalid
        | StatusCode::BadUserAccessDenied
        | StatusCode::BadUserSignatureInvalid => match line.login {
            None => ("user-required", "add user and password_file"),
            Some(_) => (
                "user-refused",
                "check the user and the password, and the rights of the user in the server",
            ),
        },
        _ if line.options.security != Policy::None => (
            "certificate-refused",
            "let the server trust the certificate of this driver: it is in the folder pki, and perhaps among those that \
             the server has rejected",
        ),
        _ => ("session-refused", "see the server's log"),
    }
}

/// The trouble with a signal.
struct Trouble {
    cause: &'static str,
    what: String,
}

/// The step `addresses`; returns the nodes that can be read, with the positions of their signals. `None` if the server has
/// fallen silent.
fn addresses(
    line: &Line<'_>,
    examination: &mut Examination<'_>,
    (session, server): (&Session, &Server),
    fields: &[Field],
) -> Option<Vec<(usize, NodeId)>> {
    let mut good = Vec::new();
    let mut troubles = Vec::new();
    let watched: Vec<usize> = examination.watched.iter().map(|(of, _)| *of).collect();
    for (signal, field) in fields.iter().enumerate() {
        if signal >= SINGLES && !watched.contains(&signal) {
            continue;
        }
        match look(line, (session, server), field) {
            Ok(node) => good.push((signal, node)),
            Err(lost) if lost.cause == "connection-lost" => {
                // The others would be asked in vain, each with a time-out.
                let next = "see whether the server restarts, or closes connections, and its log";
                examination.fail("addresses", lost.cause, lost.what, next);
                return None;
            }
            Err(trouble) => troubles.push(trouble),
        }
    }
    let Some(first) = troubles.first() else {
        let rest = if fields.len() > SINGLES {
            format!("; the first {SINGLES} were read one by one")
        } else {
            String::new()
        };
        let told = format!(
            "all nodes exist, have the right type, and can be read if the driver reads them{rest}"
        );
        examination.ok("addresses", told);
        return Some(good);
    };
    let next = match first.cause {
        "namespace-unknown" | "wrong-namespace" => {
            "correct the namespace; write its URI (nsu=…;s=…), which does not change when the server is extended"
        }
        "node-unknown" => "compare the node id with the one that a client such as UaExpert shows",
        "type-differs" => "write the type of the server at the signal",
        "access-denied" => "give this user the right to read the node, or log in as another one",
        _ => "see the server's log",
    };
    let evidence = format!(
        "{} of {} nodes cannot be used",
        troubles.len(),
        fields.len()
    );
    let details = troubles
        .iter()
        .take(10)
        .map(|trouble| trouble.what.clone())
        .collect();
    examination
        .fail("addresses", first.cause, evidence, next)
        .details = details;
    Some(good)
}

/// Reads one signal's node.
fn look(
    line: &Line<'_>,
    (session, server): (&Session, &Server),
    field: &Field,
) -> Result<NodeId, Trouble> {
    let known = server.node(&field.node).map_err(|why| Trouble {
        cause: "namespace-unknown",
        what: format!("\"{}\" is {}, but {why}", field.name, field.node),
    });
    let node = known?;
    let values = attributes(line, session, &node).ok_or_else(|| Trouble {
        cause: "connection-lost",
        what: format!("\"{}\": the server does not answer", field.name),
    })?;
    let [value, kind, access] = &values[..] else {
        return Ok(node);
    };
    let judged = nodes::judge(field, &values, false).err();
    let may_read = !matches!(access.value, Some(Variant::Byte(access)) if access & READS == 0);
    let is_denied = |status: StatusCode| {
        matches!(
            status,
            StatusCode::BadUserAccessDenied | StatusCode::BadNotReadable
        )
    };
    let cannot_read = is_denied(value.status()) || (!may_read && !kind.status().is_bad());
    // A node may be for writing only; the driver then does not read it either.
    let cause = if is_denied(kind.status()) || (field.is_read && cannot_read) {
        "access-denied"
    } else if kind.status().is_bad() {
        missing(line, (session, server), &node)
    } else if judged.is_some() {
        "type-differs"
    } else {
        return Ok(node);
    };
    let status = if kind.status().is_bad() {
        kind.status()
    } else {
        value.status()
    };
    let usual = format!(
        "\"{}\" is {}, which cannot be read ({})",
        field.name,
        field.node,
        meaning(status)
    );
    let mut what = judged.unwrap_or(usual);
    if let ("wrong-namespace", Some(other)) = (cause, elsewhere(line, (session, server), &node)) {
        what = format!("{what}; namespace {other} has such a node");
    }
    Err(Trouble { cause, what })
}

fn attributes(line: &Line<'_>, session: &Session, node: &NodeId) -> Option<Vec<DataValue>> {
    let wanted = ATTRIBUTES.map(|attribute| ReadValueId::new(node.clone(), attribute));
    line.drive(nodes::read(session, &wanted))?.ok()
}

/// The cause behind a node that does not exist.
fn missing(line: &Line<'_>, (session, server): (&Session, &Server), node: &NodeId) -> &'static str {
    if usize::from(node.namespace) >= server.namespaces.len() {
        "namespace-unknown"
    } else if elsewhere(line, (session, server), node).is_some() {
        "wrong-namespace"
    } else {
        "node-unknown"
    }
}

/// Another namespace that has a node of the same name.
fn elsewhere(
    line: &Line<'_>,
    (session, server): (&Session, &Server),
    node: &NodeId,
) -> Option<u16> {
    let others = (1..server.namespaces.len()).filter_map(|other| u16::try_from(other).ok());
    let others: Vec<u16> = others.filter(|other| *other != node.namespace).collect();
    let wanted = others.iter().map(|other| {
        let node = NodeId {
            namespace: *other,
            ..node.clone()
        };
        ReadValueId::new(node, AttributeId::DataType)
    });
    let wanted: Vec<ReadValueId> = wanted.collect();
    let values = line.drive(nodes::read(session, &wanted))?.ok()?;
    let found = others
        .iter()
        .zip(values)
        .find(|(_, value)| !value.status().is_bad());
    found.map(|(other, _)| *other)
}

/// The step `run`. False if the server does not answer.
fn run_state(line: &Line<'_>, examination: &mut Examination<'_>, session: &Session) -> bool {
    let wanted = [ReadValueId::new_value(
        VariableId::Server_ServerStatus_State.into(),
    )];
    let read = line
        .drive(nodes::read(session, &wanted))
        .and_then(Result::ok);
    let Some(value) = read.and_then(|values| values.into_iter().next()) else {
        examination.fail(
            "run",
            "connection-lost",
            "the server does not answer when it is asked whether it runs",
            "see whether the server restarts, or closes connections, and its log",
        );
        return false;
    };
    match state(&value) {
        Some(PlcState::Stop) => {
            examination.fail(
                "run",
                "plc-stop",
                "the server says that it does not run: the driver reports its values as stale",
                "switch the PLC to RUN",
            );
        }
        Some(PlcState::Run) if !value.status().is_bad() => {
            examination.ok("run", "the server says that it runs");
        }
        _ => {
            let step = examination.ok("run", "the server does not say whether it runs");
            "name a signal that has to change: alive = { signal = \"...\", within = \"500ms\" }"
                .clone_into(&mut step.next);
        }
    }
    true
}

fn round(
    line: &Line<'_>,
    session: &Session,
    nodes: &[(usize, NodeId)],
    signals: usize,
) -> Option<Round> {
    let begin = line.clock.now();
    let wanted = nodes
        .iter()
        .map(|(_, node)| ReadValueId::new_value(node.clone()));
    let wanted: Vec<ReadValueId> = wanted.collect();
    let mut read = Vec::new();
    for wanted in wanted.chunks(TOGETHER) {
        read.extend(line.drive(nodes::read(session, wanted))?.ok()?);
    }
    let mut values = vec![Vec::new(); signals];
    for ((signal, _), value) in nodes.iter().zip(read) {
        values[*signal] = format!("{:?}", value.value).into_bytes();
    }
    Some(Round {
        begin,
        took: line.clock.now() - begin,
        values,
    })
}
