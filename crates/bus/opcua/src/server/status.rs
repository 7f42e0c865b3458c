//! The structure `Server_ServerStatus` with its current time.

use std::sync::Arc;

use async_trait::async_trait;
use opcua::nodes::DefaultTypeTree;
use opcua::server::CreateMonitoredItem;
use opcua::server::diagnostics::NamespaceMetadata;
use opcua::server::node_manager::memory::CoreNodeManager;
use opcua::server::node_manager::{
    BrowseNode, BrowsePathItem, MonitoredItemRef, MonitoredItemUpdateRef, NodeManager, ReadNode,
    RequestContext, ServerContext, WriteNode,
};
use opcua::types::{
    AttributeId, DataValue, ExtensionObject, MonitoringMode, NodeId, ServerStatusDataType,
    StatusCode, TimestampsToReturn, VariableId,
};

use crate::pki::date;
use tickbus_base::time::WallClock;

/// Handles the value of that node in place of the crate's own manager, which handles everything else. With the latter,
/// `CurrentTime` stands still unless a client subscribes to it.
pub(super) struct Status {
    node: NodeId,
    context: ServerContext,
    wall: WallClock,
}

impl Status {
    pub(super) fn new(context: ServerContext, wall: WallClock) -> Self {
        Self {
            node: VariableId::Server_ServerStatus.into(),
            context,
            wall,
        }
    }

    fn core(&self) -> Result<Arc<CoreNodeManager>, StatusCode> {
        let core = self.context.node_managers.get_of_type();
        core.ok_or(StatusCode::BadServerHalted)
    }

    /// The current value of the structure.
    fn value(&self) -> DataValue {
        let whole = self.context.status.full_status_obj();
        let time = date((self.wall)());
        let whole = match whole.inner_as::<ServerStatusDataType>() {
            Some(status) => ExtensionObject::from_message(ServerStatusDataType {
                current_time: time,
                ..status.clone()
            }),
            None => whole,
        };
        DataValue::new_at(whole, time)
    }
}

#[async_trait]
impl NodeManager for Status {
    fn owns_node(&self, id: &NodeId) -> bool {
        *id == self.node
    }

    fn name(&self) -> &'static str {
        "status"
    }

    fn namespaces_for_user(&self, _: &RequestContext) -> Vec<NamespaceMetadata> {
        Vec::new()
    }

    async fn init(&self, _: &mut DefaultTypeTree, _: ServerContext) {}

    async fn read(
        &self,
        context: &RequestContext,
        max_age: f64,
        timestamps: TimestampsToReturn,
        nodes: &mut [&mut ReadNode],
    ) -> Result<(), StatusCode> {
        let core = self.core()?;
        core.read(context, max_age, timestamps, nodes).await?;
        for node in nodes {
            if node.status().is_good() && node.node().attribute_id == AttributeId::Value {
                node.set_result(self.value());
            }
        }
        Ok(())
    }

    async fn write(
        &self,
        context: &RequestContext,
        nodes: &mut [&mut WriteNode],
    ) -> Result<(), StatusCode> {
        self.core()?.write(context, nodes).await
    }

    async fn browse(&self, _: &RequestContext, _: &mut [BrowseNode]) -> Result<(), StatusCode> {
        // Every manager is asked about every node.
        Ok(())
    }

    async fn translate_browse_paths_to_node_ids(
        &self,
        _: &RequestContext,
        _: &mut [&mut BrowsePathItem],
    ) -> Result<(), StatusCode> {
        Ok(())
    }

    async fn create_monitored_items(
        &self,
        context: &RequestContext,
        items: &mut [&mut CreateMonitoredItem],
    ) -> Result<(), StatusCode> {
        self.core()?.create_monitored_items(context, items).await
    }

    async fn modify_monitored_items(
        &self,
        context: &RequestContext,
        items: &[&MonitoredItemUpdateRef],
    ) {
        if let Ok(core) = self.core() {
            core.modify_monitored_items(context, items).await;
        }
    }

    async fn set_monitoring_mode(
        &self,
        context: &RequestContext,
        mode: MonitoringMode,
        items: &[&MonitoredItemRef],
    ) {
        if let Ok(core) = self.core() {
            core.set_monitoring_mode(context, mode, items).await;
        }
    }

    async fn delete_monitored_items(&self, context: &RequestContext, items: &[&MonitoredItemRef]) {
        if let Ok(core) = self.core() {
            core.delete_monitored_items(context, items).await;
        }
    }
}
