//! The clients' access to the nodes: read, subscribe, write.

use std::collections::{HashMap, VecDeque};
use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use async_trait::async_trait;
use opcua::core::sync::RwLock;
use opcua::types::{AttributeId, DataValue, NodeId, NumericRange, StatusCode, TimestampsToReturn};
use opcua_server::CreateMonitoredItem;
use opcua_server::address_space::{AddressSpace, NodeType};
use opcua_server::diagnostics::NamespaceMetadata;
use opcua_server::node_manager::memory::{InMemoryNodeManager, InMemoryNodeManagerImpl};
use opcua_server::node_manager::{
    MethodCall, MonitoredItemRef, MonitoredItemUpdateRef, ParsedReadValueId, ParsedWriteValue,
    RequestContext, ServerContext, WriteNode,
};
use tokio::sync::oneshot;

use crate::pki::date;
use crate::reactor::Inbox;
use crate::{application, values};
use tickbus_base::time::WallClock;
use tickbus_image::signal::{Area, SignalTable};

use super::SESSIONS;
use super::sampling::{millis, publishing, rhythm};
use super::space::Places;
use super::verdict::Verdict;
use super::visitor::Visitor;
use super::watched::{Variable, Watched};
use super::whole::Written;
use super::writers::Writers;
use crate::namespaces::FIRST;

/// A sampling interval that holds back no change, in milliseconds; the crate does not accept zero.
const UNFILTERED: f64 = 0.001;

/// An action of a client.
pub(super) enum Visit {
    /// Values written in one request. A signal written twice in it starts a new list.
    Written(Visitor, Vec<Vec<(usize, u64)>>),
    /// These signals are about to be read: their nodes must be updated first. With `true` by a Read, whose answer faults
    /// can change.
    Reads(Visitor, Vec<usize>, bool, oneshot::Sender<Verdict>),
    /// These signals are about to be written.
    Writes(Vec<usize>, oneshot::Sender<Verdict>),
    /// The first client writes what the second one wrote within `max_age`.
    SecondWriter(String, String),
    /// A client was refused because its certificate belongs to another application; the text says so.
    Impostor(String),
    /// Certificates were rejected: the new files, and their total number.
    Rejected(Vec<String>, usize),
    /// The server has ended.
    Ended(String),
}

/// The nodes and their values.
pub(super) type Nodes = InMemoryNodeManager<Signals>;

/// The signals, as a node manager of the crate's server.
pub(super) struct Signals {
    table: Arc<SignalTable>,
    /// The URIs of the namespaces from number 2 on.
    uris: Vec<String>,
    by_node: HashMap<NodeId, Variable>,
    places: Arc<Places>,
    /// The signals that are pulses of methods.
    by_method: HashMap<NodeId, usize>,
    own: Own,
    /// The results of checking sessions' applications, the latest last.
    judged: Mutex<VecDeque<(u32, bool)>>,
}

/// The data of the bus that owns the nodes.
pub(super) struct Own {
    /// The area that clients write.
    pub(super) reads: Area,
    pub(super) watched: Watched,
    pub(super) writers: Arc<Writers>,
    pub(super) inbox: Inbox<Visit>,
    pub(super) wall: WallClock,
    /// True if a client's certificate must belong to its application.
    pub(super) checks_applications: bool,
    /// The number of the server's tasks without any connection; set when it starts to listen.
    pub(super) tasks_alone: Arc<AtomicUsize>,
}

/// A value that a client may write.
enum Judged {
    /// All of a signal's variable.
    All([(usize, u64); 1]),
    /// The variable that is known by this signal, or some of its elements.
    Parts(usize, Written),
}

impl Judged {
    /// The signals that it sets, with their bits.
    fn signals(&self) -> &[(usize, u64)] {
        match self {
            Self::All(signal) => signal,
            Self::Parts(_, written) => &written.signals,
        }
    }
}

/// The node with a signal's own value.
const fn variable_of(signal: usize) -> Variable {
    Variable {
        signal,
        is_scaled: false,
    }
}

impl fmt::Debug for Signals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Signals").finish_non_exhaustive()
    }
}

impl Signals {
    /// The signals of `table`.
    pub(super) fn new(table: Arc<SignalTable>, places: &Arc<Places>, own: Own) -> Self {
        let (mut by_node, mut by_method) = (HashMap::new(), HashMap::new());
        for index in 0..table.signals.len() {
            if places.is_method(index) {
                by_method.insert(places.node(index).clone(), index);
                continue;
            }
            if let Some((scaled, _)) = places.scaled(&table, index) {
                let variable = Variable {
                    signal: index,
                    is_scaled: true,
                };
                by_node.insert(scaled, variable);
            }
            // A variable with several signals is known by its first one.
            let first = places.wholes.first(index).unwrap_or(index);
            by_node.insert(places.node(index).clone(), variable_of(first));
        }
        Self {
            table,
            uris: places.uris.clone(),
            by_node,
            places: Arc::clone(places),
            by_method,
            own,
            judged: Mutex::default(),
        }
    }

    /// Checks that the certificate of a client belongs to the application that the client claims to be. The crate
    /// checks everything else about it before there is a session.
    fn admits(&self, context: &RequestContext) -> Result<(), StatusCode> {
        if !self.own.checks_applications {
            return Ok(());
        }
        let verdict = |is_good: bool| {
            is_good
                .then_some(())
                .ok_or(StatusCode::BadCertificateUriInvalid)
        };
        // The list is consistent after every change, so a poisoned lock is safe to use.
        let mut judged = self.judged.lock().unwrap_or_else(PoisonError::into_inner);
        let known = judged.iter().find(|(id, _)| *id == context.session_id);
        if let Some((_, is_good)) = known {
            return verdict(*is_good);
        }
        let session = context.session.read();
        let uri = session.application_description().application_uri.as_ref();
        let checked = match session.client_certificate() {
            Some(certificate) => application::check(certificate, uri),
            // An unprotected session.
            None => Ok(()),
        };
        if judged.len() >= SESSIONS {
            judged.pop_front();
        }
        judged.push_back((context.session_id, checked.is_ok()));
        let is_good = checked.is_ok();
        if let Err(why) = checked {
            self.own.inbox.push(Visit::Impostor(why));
        }
        verdict(is_good)
    }

    /// The values of nodes, brought up to date; `is_read` if the client reads them, so that faults can change the
    /// answer.
    async fn look(
        &self,
        context: &RequestContext,
        address_space: &RwLock<AddressSpace>,
        (nodes, max_age, timestamps): (&[&ParsedReadValueId], f64, TimestampsToReturn),
        is_read: bool,
    ) -> Vec<DataValue> {
        let refused = |status: StatusCode| DataValue {
            status: Some(status),
            ..DataValue::default()
        };
        if let Err(status) = self.admits(context) {
            return vec![refused(status); nodes.len()];
        }
        let signals = nodes.iter().flat_map(|node| self.signals(&node.node_id));
        let signals = signals.collect();
        let (done, ready) = oneshot::channel();
        let visit = Visit::Reads(Visitor::of(context), signals, is_read, done);
        self.own.inbox.push(visit);
        // Fails if the bus has stopped; the nodes then keep their values.
        let verdict = ready.await.unwrap_or_default();
        let read = {
            let space = address_space.read();
            let read = nodes.iter().map(|node| {
                let status = self.refusal(&node.node_id, &verdict);
                status.map_or_else(|| space.read(context, node, max_age, timestamps), refused)
            });
            read.collect()
        };
        verdict.hold().await;
        read
    }

    /// The signals of a node: none, one, or those that are parts of its value.
    fn signals(&self, id: &NodeId) -> Vec<usize> {
        let variable = self.by_node.get(id);
        variable.map_or_else(Vec::new, |variable| {
            self.places.wholes.signals(variable.signal)
        })
    }

    /// The status with which faults refuse a node.
    fn refusal(&self, id: &NodeId, verdict: &Verdict) -> Option<StatusCode> {
        if verdict.refused.is_empty() {
            return None;
        }
        let signals = self.signals(id).into_iter();
        let mut stations = signals.map(|signal| self.table.signals[signal].station);
        stations.find_map(|station| verdict.status(station))
    }

    /// Checks one value that a client writes.
    fn judge(
        &self,
        space: &AddressSpace,
        write: &ParsedWriteValue,
        verdict: &Verdict,
    ) -> Result<Judged, StatusCode> {
        let Some(&variable) = self.by_node.get(&write.node_id) else {
            return Err(if space.node_exists(&write.node_id) {
                StatusCode::BadNotWritable
            } else {
                StatusCode::BadNodeIdUnknown
            });
        };
        let signal = &self.table.signals[variable.signal];
        if let Some(status) = self.refusal(&write.node_id, verdict) {
            return Err(status);
        }
        if write.attribute_id != AttributeId::Value || variable.is_scaled {
            return Err(StatusCode::BadNotWritable);
        }
        if signal.area != self.own.reads {
            return Err(StatusCode::BadUserAccessDenied);
        }
        // A value with a bad status has no meaning for a signal.
        if write.value.status.is_some_and(|status| !status.is_good()) {
            return Err(StatusCode::BadWriteNotSupported);
        }
        let value = write.value.value.as_ref();
        let wholes = &self.places.wholes;
        let range = (&write.index_range, value);
        if let Some(judged) = wholes.judge(&self.table, variable.signal, range) {
            return judged.map(|written| Judged::Parts(variable.signal, written));
        }
        if write.index_range != NumericRange::None {
            return Err(StatusCode::BadWriteNotSupported);
        }
        let bits = value.and_then(|value| values::bits(signal.data_type, value));
        let bits = bits.ok_or(StatusCode::BadTypeMismatch)?;
        Ok(Judged::All([(variable.signal, bits)]))
    }

    /// Writes the values that were accepted.
    fn carry_out(
        &self,
        context: &RequestContext,
        address_space: &RwLock<AddressSpace>,
        nodes_to_write: &mut [&mut WriteNode],
        verdict: &Verdict,
    ) {
        let (writers, session) = (&self.own.writers, context.session_id);
        writers.begin(session, || Visitor::of(context));
        let mut lists: Vec<Vec<(usize, u64)>> = vec![Vec::new()];
        let mut space = address_space.write();
        let now = date((self.own.wall)());
        let judged: Vec<_> = nodes_to_write
            .iter()
            .map(|node| self.judge(&space, node.value(), verdict))
            .collect();
        let signals = judged.iter().flatten().flat_map(Judged::signals);
        let indices = signals.map(|&(index, _)| index);
        let refused = writers.refuses(session, indices);
        let is_refused = refused.is_some();
        let mut second = refused;
        for (node, judged) in nodes_to_write.iter_mut().zip(judged) {
            let judged = match judged {
                Ok(judged) => judged,
                Err(status) => {
                    node.set_status(status);
                    continue;
                }
            };
            if is_refused {
                node.set_status(StatusCode::BadUserAccessDenied);
                continue;
            }
            for &(index, _) in judged.signals() {
                if let Some(other) = writers.write(session, index) {
                    second.get_or_insert(other);
                }
            }
            let signals = judged.signals().to_vec();
            node.set_status(StatusCode::Good);
            let written = &node.value().value;
            let whole = match judged {
                Judged::All(_) => None,
                // Once more, because a write before it in this request may have changed other parts.
                Judged::Parts(first, _) => match self.judge(&space, node.value(), verdict) {
                    Ok(Judged::Parts(_, written)) => self.places.wholes.accept(first, written),
                    _ => None,
                },
            };
            let value = DataValue {
                value: whole.or_else(|| written.value.clone()),
                status: Some(StatusCode::Good),
                source_timestamp: written.source_timestamp.or(Some(now)),
                server_timestamp: Some(now),
                ..DataValue::default()
            };
            let id = &node.value().node_id;
            if let Some(NodeType::Variable(variable)) = space.find_mut(id) {
                variable.set_data_value(value.clone());
            }
            let variable = self.by_node[id];
            let watched = &self.own.watched;
            watched.tell(&context.subscriptions, id, variable, &value);
            let last = lists.last_mut().expect("there is always one");
            let is_in_last = |(index, _): &(usize, u64)| last.iter().any(|(of, _)| of == index);
            if signals.iter().any(is_in_last) {
                lists.push(signals);
            } else {
                last.extend(signals);
            }
        }
        let inbox = &self.own.inbox;
        if let Some(other) = second {
            inbox.push(Visit::SecondWriter(Visitor::of(context).name, other));
        }
        if !lists[0].is_empty() {
            inbox.push(Visit::Written(Visitor::of(context), lists));
        }
    }
}

#[async_trait]
#[expect(clippy::mut_mut, reason = "the crate's own signature")]
impl InMemoryNodeManagerImpl for Signals {
    async fn init(&self, _: &mut AddressSpace, _: ServerContext) {
        // This is the last node manager to be initialised, just before the server listens.
        let tasks = tokio::runtime::Handle::current()
            .metrics()
            .num_alive_tasks();
        self.own.tasks_alone.store(tasks, Ordering::Relaxed);
    }

    fn name(&self) -> &'static str {
        "signals"
    }

    fn namespaces(&self) -> Vec<NamespaceMetadata> {
        namespaces(&self.uris)
    }

    async fn read_values(
        &self,
        context: &RequestContext,
        address_space: &RwLock<AddressSpace>,
        nodes: &[&ParsedReadValueId],
        max_age: f64,
        timestamps: TimestampsToReturn,
    ) -> Vec<DataValue> {
        let wanted = (nodes, max_age, timestamps);
        self.look(context, address_space, wanted, true).await
    }

    async fn create_value_monitored_items(
        &self,
        context: &RequestContext,
        address_space: &RwLock<AddressSpace>,
        items: &mut [&mut &mut CreateMonitoredItem],
    ) {
        if let Err(status) = self.admits(context) {
            for item in items.iter_mut() {
                item.set_status(status);
            }
            return;
        }
        let wanted: Vec<_> = items.iter().map(|item| item.item_to_monitor()).collect();
        let wanted = (&wanted[..], 0.0, TimestampsToReturn::Both);
        let values = self.look(context, address_space, wanted, false).await;
        for (item, value) in items.iter_mut().zip(values) {
            let first = value.source_timestamp;
            if value.status() != StatusCode::BadAttributeIdInvalid {
                item.set_initial_value(value);
            }
            item.set_status(StatusCode::Good);
            if let Some(&variable) = self.by_node.get(&item.item_to_monitor().node_id) {
                let publishing = publishing(context, item.handle());
                let mut rhythm = rhythm(item.sampling_interval(), item.queue_size(), publishing);
                // Without a queue, a client sees the values at the time of publishing: the newest of all items, and
                // thus consistent.
                if item.queue_size() <= 1 && rhythm.sampling <= publishing {
                    item.revise_sampling_interval(UNFILTERED);
                    rhythm.sampling = millis(item.sampling_interval());
                }
                self.own.watched.add(variable, item.handle(), rhythm, first);
            }
        }
    }

    async fn modify_monitored_items(
        &self,
        context: &RequestContext,
        items: &[&MonitoredItemUpdateRef],
    ) {
        for item in items {
            let variable = self.by_node.get(item.node_id());
            if let Some(&variable) = variable
                && item.attribute() == AttributeId::Value
            {
                let made = item.update();
                let publishing = publishing(context, item.handle());
                let queue = made.revised_queue_size as usize;
                let rhythm = rhythm(made.revised_sampling_interval, queue, publishing);
                self.own.watched.modify(variable, item.handle(), rhythm);
            }
        }
    }

    async fn delete_monitored_items(&self, _: &RequestContext, items: &[&MonitoredItemRef]) {
        for item in items {
            if let Some(&variable) = self.by_node.get(item.node_id()) {
                self.own.watched.remove(variable, item.handle());
            }
        }
    }

    async fn call(
        &self,
        context: &RequestContext,
        _: &RwLock<AddressSpace>,
        calls: &mut [&mut &mut MethodCall],
    ) -> Result<(), StatusCode> {
        self.admits(context)?;
        for call in calls {
            let Some(&signal) = self.by_method.get(call.method_id()) else {
                call.set_status(StatusCode::BadNotImplemented);
                continue;
            };
            let (writers, session) = (&self.own.writers, context.session_id);
            writers.begin(session, || Visitor::of(context));
            let refused = writers.refuses(session, [signal]);
            let is_refused = refused.is_some();
            let second = refused.or_else(|| writers.write(session, signal));
            if let Some(other) = second {
                let name = Visitor::of(context).name;
                self.own.inbox.push(Visit::SecondWriter(name, other));
            }
            if is_refused {
                call.set_status(StatusCode::BadUserAccessDenied);
                continue;
            }
            // Two commits: the pulse is there and is over.
            let pulse = vec![vec![(signal, 1)], vec![(signal, 0)]];
            let visit = Visit::Written(Visitor::of(context), pulse);
            self.own.inbox.push(visit);
            call.set_status(StatusCode::Good);
        }
        Ok(())
    }

    async fn write(
        &self,
        context: &RequestContext,
        address_space: &RwLock<AddressSpace>,
        nodes_to_write: &mut [&mut WriteNode],
    ) -> Result<(), StatusCode> {
        // If a service fails, every node gets its status.
        self.admits(context)?;
        let nodes = nodes_to_write.iter();
        let signals = nodes.flat_map(|node| self.signals(&node.value().node_id));
        let signals = signals.collect();
        let (done, ready) = oneshot::channel();
        self.own.inbox.push(Visit::Writes(signals, done));
        // Fails if the bus has stopped.
        let verdict = ready.await.unwrap_or_default();
        self.carry_out(context, address_space, nodes_to_write, &verdict);
        verdict.hold().await;
        Ok(())
    }
}

/// The metadata of the signals' namespaces, whose URIs are those from number 2 on.
fn namespaces(uris: &[String]) -> Vec<NamespaceMetadata> {
    let all = uris.iter().zip(FIRST..);
    let all = all.map(|(uri, namespace_index)| NamespaceMetadata {
        namespace_uri: uri.clone(),
        namespace_index,
        ..NamespaceMetadata::default()
    });
    all.collect()
}
