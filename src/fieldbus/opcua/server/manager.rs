//! What clients do to the nodes: they read, subscribe and write.

use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use async_trait::async_trait;
use opcua::core::sync::RwLock;
use opcua::server::address_space::{AddressSpace, NodeType};
use opcua::server::diagnostics::NamespaceMetadata;
use opcua::server::node_manager::memory::{InMemoryNodeManager, InMemoryNodeManagerImpl};
use opcua::server::node_manager::{
    MonitoredItemRef, ParsedReadValueId, ParsedWriteValue, RequestContext, ServerContext, WriteNode,
};
use opcua::server::{CreateMonitoredItem, MonitoredItemHandle, Subscription};
use opcua::types::{
    AttributeId, DataValue, DateTime, NodeId, NumericRange, StatusCode, TimestampsToReturn,
};
use tokio::sync::oneshot;

use crate::fieldbus::opcua::reactor::Inbox;
use crate::fieldbus::opcua::values;
use crate::signal::{Area, SignalTable, Slot};
use crate::time::Nanos;

use super::space::{self, NAMESPACE, NAMESPACE_URI};

/// A sampling interval that keeps no change back, in milliseconds; the crate takes no zero here.
const UNFILTERED: f64 = 0.001;

/// A session of a client, as far as one can be looked at: the crate does not give its type a name.
pub(super) struct Visitor {
    /// The number of the session.
    pub(super) id: u32,
    /// The name of the client, or else of the session.
    pub(super) name: String,
    /// When the session would expire, which every request puts off; `None` when it is over.
    pub(super) deadline: Box<dyn Fn() -> Option<Instant> + Send>,
}

impl Visitor {
    fn of(context: &RequestContext) -> Self {
        let session = Arc::clone(&context.session);
        let read = session.read();
        let application = read
            .application_description()
            .application_name
            .text
            .to_string();
        let name = if application.is_empty() {
            read.session_name().to_owned()
        } else {
            application
        };
        drop(read);
        Self {
            id: context.session_id,
            name,
            deadline: Box::new(move || {
                let session = session.read();
                session.is_activated().then(|| session.deadline())
            }),
        }
    }
}

/// What clients have done.
pub(super) enum News {
    /// Values were written, all in one request. A signal that was written twice in it begins a new list.
    Written(Visitor, Vec<Vec<(usize, Slot)>>),
    /// These signals are about to be read: their nodes have to be brought up to date first.
    Reads(Visitor, Vec<usize>, oneshot::Sender<()>),
    /// The server has ended.
    Ended(String),
}

/// All the nodes and their values.
pub(super) type Nodes = InMemoryNodeManager<Signals>;

/// The signals, as the crate's server asks for them.
pub(super) struct Signals {
    table: Arc<SignalTable>,
    by_node: HashMap<NodeId, usize>,
    /// The area that clients write.
    reads: Area,
    watched: Watched,
    inbox: Inbox<News>,
}

impl fmt::Debug for Signals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Signals").finish_non_exhaustive()
    }
}

impl Signals {
    /// The signals of `table`, of which clients write those of the area `reads`.
    pub(super) fn new(
        table: Arc<SignalTable>,
        reads: Area,
        watched: Watched,
        inbox: Inbox<News>,
    ) -> Self {
        let mut by_node: HashMap<NodeId, usize> = HashMap::new();
        for (index, signal) in table.signals.iter().enumerate() {
            if let Some((scaled, _)) = space::scaled(&table, signal) {
                by_node.insert(scaled, index);
            }
            by_node.insert(space::node(&signal.name), index);
        }
        Self {
            table,
            by_node,
            reads,
            watched,
            inbox,
        }
    }

    /// The signal and its bits that a client wants to write.
    fn judge(
        &self,
        space: &AddressSpace,
        write: &ParsedWriteValue,
    ) -> Result<(usize, Slot), StatusCode> {
        let Some(&index) = self.by_node.get(&write.node_id) else {
            return Err(if space.node_exists(&write.node_id) {
                StatusCode::BadNotWritable
            } else {
                StatusCode::BadNodeIdUnknown
            });
        };
        let signal = &self.table.signals[index];
        let its_own = write.node_id == space::node(&signal.name);
        if write.attribute_id != AttributeId::Value || !its_own {
            return Err(StatusCode::BadNotWritable);
        }
        if signal.area != self.reads {
            return Err(StatusCode::BadUserAccessDenied);
        }
        if write.index_range != NumericRange::None {
            return Err(StatusCode::BadWriteNotSupported);
        }
        // Who writes a bad value says that it has none.
        if write.value.status.is_some_and(|status| !status.is_good()) {
            return Err(StatusCode::BadWriteNotSupported);
        }
        let value = write.value.value.as_ref();
        let bits = value.and_then(|value| values::bits(signal.data_type, value));
        Ok((index, bits.ok_or(StatusCode::BadTypeMismatch)?))
    }
}

#[async_trait]
#[expect(clippy::mut_mut, reason = "the crate's own signature")]
impl InMemoryNodeManagerImpl for Signals {
    async fn init(&self, _: &mut AddressSpace, _: ServerContext) {}

    fn name(&self) -> &'static str {
        "signals"
    }

    fn namespaces(&self) -> Vec<NamespaceMetadata> {
        vec![namespace()]
    }

    async fn read_values(
        &self,
        context: &RequestContext,
        address_space: &RwLock<AddressSpace>,
        nodes: &[&ParsedReadValueId],
        max_age: f64,
        timestamps: TimestampsToReturn,
    ) -> Vec<DataValue> {
        let signals = nodes
            .iter()
            .filter_map(|node| self.by_node.get(&node.node_id));
        let signals = signals.copied().collect();
        let (done, ready) = oneshot::channel();
        self.inbox
            .push(News::Reads(Visitor::of(context), signals, done));
        // It fails when the bus has stopped; then the nodes are as they were.
        let _ = ready.await;
        let space = address_space.read();
        let read = nodes
            .iter()
            .map(|node| space.read(context, node, max_age, timestamps));
        read.collect()
    }

    async fn create_value_monitored_items(
        &self,
        context: &RequestContext,
        address_space: &RwLock<AddressSpace>,
        items: &mut [&mut &mut CreateMonitoredItem],
    ) {
        let wanted: Vec<_> = items.iter().map(|item| item.item_to_monitor()).collect();
        let both = TimestampsToReturn::Both;
        let values = self
            .read_values(context, address_space, &wanted, 0.0, both)
            .await;
        for (item, value) in items.iter_mut().zip(values) {
            if value.status() != StatusCode::BadAttributeIdInvalid {
                item.set_initial_value(value);
            }
            item.set_status(StatusCode::Good);
            if let Some(&signal) = self.by_node.get(&item.item_to_monitor().node_id) {
                let sampling = millis(item.sampling_interval());
                let publishing = publishing(context, item.handle());
                // A queue keeps what is sampled. Without one, what is there when it publishes is seen: the
                // newest of all items, and so values that belong together.
                let span = if item.queue_size() > 1 {
                    sampling
                } else {
                    if sampling <= publishing {
                        item.revise_sampling_interval(UNFILTERED);
                    }
                    sampling.max(publishing)
                };
                self.watched.add(signal, item.handle(), span);
            }
        }
    }

    async fn delete_monitored_items(&self, _: &RequestContext, items: &[&MonitoredItemRef]) {
        for item in items {
            if let Some(&signal) = self.by_node.get(item.node_id()) {
                self.watched.remove(signal, item.handle());
            }
        }
    }

    async fn write(
        &self,
        context: &RequestContext,
        address_space: &RwLock<AddressSpace>,
        nodes_to_write: &mut [&mut WriteNode],
    ) -> Result<(), StatusCode> {
        let mut lists: Vec<Vec<(usize, Slot)>> = vec![Vec::new()];
        let mut space = address_space.write();
        let now = DateTime::now();
        for node in nodes_to_write {
            let (index, bits) = match self.judge(&space, node.value()) {
                Ok(judged) => judged,
                Err(status) => {
                    node.set_status(status);
                    continue;
                }
            };
            node.set_status(StatusCode::Good);
            let written = &node.value().value;
            let value = DataValue {
                value: written.value.clone(),
                status: Some(StatusCode::Good),
                source_timestamp: written.source_timestamp.or(Some(now)),
                server_timestamp: Some(now),
                ..DataValue::default()
            };
            let id = &node.value().node_id;
            if let Some(NodeType::Variable(variable)) = space.find_mut(id) {
                variable.set_data_value(value.clone());
            }
            let change = std::iter::once((value, id, AttributeId::Value));
            context.subscriptions.notify_data_change(change);
            let last = lists.last_mut().expect("there is always one");
            if last.iter().any(|(other, _)| *other == index) {
                lists.push(vec![(index, bits)]);
            } else {
                last.push((index, bits));
            }
        }
        if !lists[0].is_empty() {
            self.inbox.push(News::Written(Visitor::of(context), lists));
        }
        Ok(())
    }
}

/// What is told of the namespace of the signals.
pub(super) fn namespace() -> NamespaceMetadata {
    NamespaceMetadata {
        namespace_uri: NAMESPACE_URI.to_owned(),
        namespace_index: NAMESPACE,
        ..NamespaceMetadata::default()
    }
}

/// The publishing interval of the subscription that an item belongs to.
fn publishing(context: &RequestContext, item: MonitoredItemHandle) -> Nanos {
    let of_session = context
        .subscriptions
        .get_session_subscriptions(context.session_id);
    of_session.map_or(Nanos::ZERO, |of_session| {
        let of_session = of_session.lock();
        let interval = of_session
            .get(item.subscription_id)
            .map(Subscription::publishing_interval);
        interval.map_or(Nanos::ZERO, |interval| {
            Nanos(i64::try_from(interval.as_nanos()).unwrap_or(i64::MAX))
        })
    })
}

/// A span that is given in milliseconds; negative ones stand for the publishing interval.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a sampling interval, in nanoseconds"
)]
fn millis(millis: f64) -> Nanos {
    Nanos((millis.max(0.0) * 1e6) as i64)
}

/// The signals that clients subscribe to, and for how long each has to be shown to be seen by all of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Watched(Arc<Mutex<Items>>);

#[derive(Debug, Default)]
struct Items {
    of: HashMap<usize, HashMap<MonitoredItemHandle, Nanos>>,
    /// How many there ever were.
    made: usize,
}

impl Watched {
    fn lock(&self) -> MutexGuard<'_, Items> {
        // A table is whole between any two of its changes.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn add(&self, signal: usize, item: MonitoredItemHandle, span: Nanos) {
        let mut items = self.lock();
        items.of.entry(signal).or_default().insert(item, span);
        items.made += 1;
    }

    fn remove(&self, signal: usize, item: MonitoredItemHandle) {
        let of = &mut self.lock().of;
        if let Some(items) = of.get_mut(&signal) {
            items.remove(&item);
            if items.is_empty() {
                of.remove(&signal);
            }
        }
    }

    /// How long the signal has to be shown; `None` when nobody subscribes to it.
    pub(super) fn span(&self, signal: usize) -> Option<Nanos> {
        let items = &self.lock().of;
        items
            .get(&signal)
            .and_then(|items| items.values().max().copied())
    }

    /// How many items were left behind, if nobody subscribes to anything any more.
    pub(super) fn left_behind(&self) -> usize {
        let items = self.lock();
        if items.of.is_empty() { items.made } else { 0 }
    }
}
