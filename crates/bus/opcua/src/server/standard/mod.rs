//! The nodes that every OPC UA server has (namespace 0), and their manager.

mod live;
mod nodes;
mod table;

use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use opcua::types::{
    AttributeId, DateTime, ExpandedNodeId, MonitoringMode, NodeId, StatusCode, TimestampsToReturn,
};
use opcua_server::CreateMonitoredItem;
use opcua_server::address_space::{DefaultTypeTree, ImportedItem};
use opcua_server::diagnostics::NamespaceMetadata;
use opcua_server::node_manager::{
    BrowseNode, BrowsePathItem, ExternalReferenceRequest, MethodCall, MonitoredItemRef,
    MonitoredItemUpdateRef, NodeManager, ReadNode, RequestContext, ServerContext, SyncSampler,
};

use crate::pki::date;
use tickbus_base::time::WallClock;

use live::Live;
use nodes::Nodes;

/// How often the values that change are looked at for those who subscribe to them, at most.
const SAMPLING: Duration = Duration::from_millis(100);

/// Passes on every standard node, with its references.
pub(super) fn each(mut take: impl FnMut(&ImportedItem)) {
    table::read(DateTime::null(), |item| take(&item));
}

/// The manager of these nodes for one server: it supplies the values that describe the server, and leaves the rest to
/// the nodes themselves. The crate's own is only there together with the nodes as code.
pub(super) struct Standard {
    nodes: Arc<Nodes>,
    live: Live,
    sampler: SyncSampler,
}

impl Standard {
    pub(super) fn new(context: ServerContext, wall: WallClock) -> Self {
        Self {
            live: Live::new(&context, wall),
            nodes: Nodes::shared(context, date(wall())),
            sampler: SyncSampler::new(),
        }
    }
}

#[async_trait]
impl NodeManager for Standard {
    fn owns_node(&self, id: &NodeId) -> bool {
        self.nodes.manager.owns_node(id)
    }

    fn name(&self) -> &'static str {
        "standard"
    }

    fn handle_new_node(&self, parent: &ExpandedNodeId) -> bool {
        self.nodes.manager.handle_new_node(parent)
    }

    fn namespaces_for_user(&self, context: &RequestContext) -> Vec<NamespaceMetadata> {
        self.nodes.manager.namespaces_for_user(context)
    }

    async fn init(&self, types: &mut DefaultTypeTree, context: ServerContext) {
        self.nodes.enter_types(types);
        self.sampler.run(SAMPLING, context.subscriptions);
    }

    async fn resolve_external_references(
        &self,
        context: &RequestContext,
        items: &mut [&mut ExternalReferenceRequest],
    ) {
        let nodes = &self.nodes.manager;
        nodes.resolve_external_references(context, items).await;
    }

    async fn read(
        &self,
        context: &RequestContext,
        max_age: f64,
        timestamps: TimestampsToReturn,
        nodes: &mut [&mut ReadNode],
    ) -> Result<(), StatusCode> {
        let manager = &self.nodes.manager;
        manager.read(context, max_age, timestamps, nodes).await?;
        let space = manager.address_space().read();
        for node in nodes {
            if node.node().attribute_id == AttributeId::Value
                && space.validate_node_read(context, node.node()).is_ok()
                && let Some(value) = self.live.read(context, node.node())
            {
                node.set_result(value);
            }
        }
        Ok(())
    }

    async fn browse(
        &self,
        context: &RequestContext,
        nodes: &mut [BrowseNode],
    ) -> Result<(), StatusCode> {
        self.nodes.manager.browse(context, nodes).await
    }

    async fn translate_browse_paths_to_node_ids(
        &self,
        context: &RequestContext,
        paths: &mut [&mut BrowsePathItem],
    ) -> Result<(), StatusCode> {
        let nodes = &self.nodes.manager;
        nodes
            .translate_browse_paths_to_node_ids(context, paths)
            .await
    }

    async fn create_monitored_items(
        &self,
        context: &RequestContext,
        items: &mut [&mut CreateMonitoredItem],
    ) -> Result<(), StatusCode> {
        self.nodes
            .manager
            .create_monitored_items(context, items)
            .await?;
        for item in items {
            let wanted = item.item_to_monitor();
            let (id, attribute) = (wanted.node_id.clone(), wanted.attribute_id);
            if attribute != AttributeId::Value || !item.status_code().is_good() {
                continue;
            }
            let Some(value) = self.live.read(context, wanted) else {
                continue;
            };
            if value.status() == StatusCode::BadUserAccessDenied {
                item.set_status(StatusCode::BadUserAccessDenied);
                continue;
            }
            item.set_initial_value(value);
            if let Some(sample) = self.live.sample(&id) {
                let interval = span(item.sampling_interval());
                let (mode, handle) = (item.monitoring_mode(), item.handle());
                (self.sampler).add_sampler(id, attribute, sample, mode, handle, interval);
            }
        }
        Ok(())
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
            let interval = span(item.update().revised_sampling_interval);
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
        calls: &mut [&mut MethodCall],
    ) -> Result<(), StatusCode> {
        self.nodes.manager.call(context, calls).await
    }
}

/// A sampling interval in milliseconds; a negative one means the publishing interval.
fn span(millis: f64) -> Duration {
    Duration::from_secs_f64(millis.max(0.0) / 1e3)
}
