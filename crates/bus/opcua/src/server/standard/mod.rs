//! The nodes that every OPC UA server has (namespace 0), and their manager.

mod live;
mod table;

use std::time::Duration;

use async_trait::async_trait;
use opcua::core::sync::RwLock;
use opcua::types::{
    DataValue, DateTime, IdType, MethodId, MonitoringMode, ObjectId, ReferenceTypeId, StatusCode,
    TimestampsToReturn, Variant, VariantScalarTypeId, VariantTypeId,
};
use opcua_server::CreateMonitoredItem;
use opcua_server::address_space::{AddressSpace, read_node_value};
use opcua_server::diagnostics::NamespaceMetadata;
use opcua_server::load_method_args;
use opcua_server::node_manager::memory::InMemoryNodeManagerImpl;
use opcua_server::node_manager::{
    MethodCall, MonitoredItemRef, MonitoredItemUpdateRef, ParsedReadValueId, RequestContext,
    ServerContext, SyncSampler,
};

use tickbus_base::time::WallClock;

use live::Live;

/// The URI of the namespace of OPC UA itself.
const NAMESPACE_URI: &str = "http://opcfoundation.org/UA/";

/// How often the values that change are looked at for those who subscribe to them, at most.
const SAMPLING: Duration = Duration::from_millis(100);

/// The manager of these nodes. The crate's own is only there together with the nodes as code.
pub(super) struct Standard {
    live: Live,
    sampler: SyncSampler,
}

impl Standard {
    /// Builds the nodes in `space`.
    pub(super) fn new(context: &ServerContext, space: &mut AddressSpace, wall: WallClock) -> Self {
        space.add_namespace(NAMESPACE_URI, 0);
        table::read(DateTime::now(), |item| {
            space.import_node(item);
        });
        Self {
            live: Live::new(context, wall),
            sampler: SyncSampler::new(),
        }
    }

    fn read(
        &self,
        context: &RequestContext,
        space: &AddressSpace,
        wanted: &ParsedReadValueId,
        max_age: f64,
        timestamps: TimestampsToReturn,
    ) -> DataValue {
        let node = match space.validate_node_read(context, wanted) {
            Ok(node) => node,
            Err(status) => {
                return DataValue {
                    status: Some(status),
                    ..DataValue::default()
                };
            }
        };
        let live = self.live.read(context, wanted);
        live.unwrap_or_else(|| read_node_value(node, context, wanted, max_age, timestamps))
    }
}

#[async_trait]
#[expect(clippy::mut_mut, reason = "the crate's own signature")]
impl InMemoryNodeManagerImpl for Standard {
    async fn init(&self, space: &mut AddressSpace, context: ServerContext) {
        for aggregate in &context.info.capabilities.history.aggregates {
            space.insert_reference(
                &ObjectId::HistoryServerCapabilities_AggregateFunctions.into(),
                aggregate,
                ReferenceTypeId::Organizes,
            );
        }
        self.sampler.run(SAMPLING, context.subscriptions);
    }

    fn name(&self) -> &'static str {
        "standard"
    }

    fn namespaces(&self) -> Vec<NamespaceMetadata> {
        vec![NamespaceMetadata {
            is_namespace_subset: Some(false),
            namespace_uri: NAMESPACE_URI.to_owned(),
            static_node_id_types: Some(vec![IdType::Numeric]),
            ..NamespaceMetadata::default()
        }]
    }

    async fn read_values(
        &self,
        context: &RequestContext,
        address_space: &RwLock<AddressSpace>,
        nodes: &[&ParsedReadValueId],
        max_age: f64,
        timestamps: TimestampsToReturn,
    ) -> Vec<DataValue> {
        let space = address_space.read();
        let read = nodes
            .iter()
            .map(|node| self.read(context, &space, node, max_age, timestamps));
        read.collect()
    }

    async fn create_value_monitored_items(
        &self,
        context: &RequestContext,
        address_space: &RwLock<AddressSpace>,
        items: &mut [&mut &mut CreateMonitoredItem],
    ) {
        let space = address_space.read();
        for item in items {
            let wanted = item.item_to_monitor();
            let (id, attribute) = (wanted.node_id.clone(), wanted.attribute_id);
            let value = self.read(context, &space, wanted, 0.0, item.timestamps_to_return());
            match value.status() {
                StatusCode::BadUserAccessDenied => {
                    item.set_status(StatusCode::BadUserAccessDenied);
                    continue;
                }
                StatusCode::BadAttributeIdInvalid => {}
                _ => item.set_initial_value(value),
            }
            item.set_status(StatusCode::Good);
            if let Some(sample) = self.live.sample(&id) {
                let interval = Duration::from_secs_f64(item.sampling_interval().max(0.0) / 1e3);
                let (mode, handle) = (item.monitoring_mode(), item.handle());
                (self.sampler).add_sampler(id, attribute, sample, mode, handle, interval);
            }
        }
    }

    async fn set_monitoring_mode(
        &self,
        _: &RequestContext,
        mode: MonitoringMode,
        items: &[&MonitoredItemRef],
    ) {
        for item in items {
            let (id, attribute) = (item.node_id(), item.attribute());
            (self.sampler).set_sampler_mode(id, attribute, item.handle(), mode);
        }
    }

    async fn modify_monitored_items(&self, _: &RequestContext, items: &[&MonitoredItemUpdateRef]) {
        for item in items {
            let interval = item.update().revised_sampling_interval.max(0.0);
            let interval = Duration::from_secs_f64(interval / 1e3);
            let (id, attribute) = (item.node_id(), item.attribute());
            (self.sampler).update_sampler(id, attribute, item.handle(), interval);
        }
    }

    async fn delete_monitored_items(&self, _: &RequestContext, items: &[&MonitoredItemRef]) {
        for item in items {
            let (id, attribute) = (item.node_id(), item.attribute());
            (self.sampler).remove_sampler(id, attribute, item.handle());
        }
    }

    async fn call(
        &self,
        context: &RequestContext,
        _: &RwLock<AddressSpace>,
        calls: &mut [&mut &mut MethodCall],
    ) -> Result<(), StatusCode> {
        for call in calls {
            match answer(call, context) {
                Ok(outputs) => {
                    call.set_outputs(outputs);
                    call.set_status(StatusCode::Good);
                }
                Err(status) => call.set_status(status),
            }
        }
        Ok(())
    }
}

/// Calls a method, and returns its outputs.
fn answer(call: &MethodCall, context: &RequestContext) -> Result<Vec<Variant>, StatusCode> {
    let method = call.method_id().as_method_id();
    let method = method.map_err(|_| StatusCode::BadNotSupported)?;
    if !matches!(
        method,
        MethodId::Server_GetMonitoredItems | MethodId::Server_ResendData
    ) {
        return Err(StatusCode::BadNotSupported);
    }
    let id = load_method_args!(call, UInt32)?;
    let subscriptions = context
        .subscriptions
        .get_session_subscriptions(context.session_id)
        .ok_or(StatusCode::BadSessionIdInvalid)?;
    let mut subscriptions = subscriptions.lock();
    let subscription = subscriptions
        .get_mut(id)
        .ok_or(StatusCode::BadSubscriptionIdInvalid)?;
    if method == MethodId::Server_ResendData {
        subscription.set_resend_data();
        return Ok(Vec::new());
    }
    let items = subscription.items();
    let (ids, handles): (Vec<_>, Vec<_>) =
        items.map(|item| (item.id(), item.client_handle())).unzip();
    Ok(vec![ids.into(), handles.into()])
}
