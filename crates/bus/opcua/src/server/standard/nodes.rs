//! The standard nodes as an address space, which all servers of the process share: nobody changes it.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use async_trait::async_trait;
use opcua::core::sync::RwLock;
use opcua::types::{
    DateTime, IdType, MethodId, StatusCode, Variant, VariantScalarTypeId, VariantTypeId,
};
use opcua_server::address_space::{AddressSpace, DefaultTypeTree};
use opcua_server::diagnostics::NamespaceMetadata;
use opcua_server::load_method_args;
use opcua_server::node_manager::memory::{
    InMemoryNodeManager, InMemoryNodeManagerBuilder, InMemoryNodeManagerImpl,
};
use opcua_server::node_manager::{MethodCall, NodeManagerBuilder, RequestContext, ServerContext};

use super::table;

/// The URI of the namespace of OPC UA itself.
const NAMESPACE_URI: &str = "http://opcfoundation.org/UA/";

/// The nodes of all servers, as long as there is a server.
static NODES: Mutex<Weak<Nodes>> = Mutex::new(Weak::new());

/// The nodes, with all that does not depend on the server that shows them.
pub(super) struct Nodes {
    pub(super) manager: Arc<InMemoryNodeManager<Methods>>,
    types: DefaultTypeTree,
}

impl Nodes {
    /// The nodes of this process; made at `time` if no other server has them.
    pub(super) fn shared(context: ServerContext, time: DateTime) -> Arc<Self> {
        // The place is consistent after every change, so a poisoned lock is safe to use.
        let mut place = NODES.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(nodes) = place.upgrade() {
            return nodes;
        }
        let nodes = Arc::new(Self::new(context, time));
        *place = Arc::downgrade(&nodes);
        nodes
    }

    fn new(context: ServerContext, time: DateTime) -> Self {
        let mut types = DefaultTypeTree::new();
        let build = |_: ServerContext, space: &mut AddressSpace| {
            space.add_namespace(NAMESPACE_URI, 0);
            table::read(time, |item| {
                space.import_node(item);
            });
            space.load_into_type_tree(&mut types);
            Methods
        };
        let manager = Box::new(InMemoryNodeManagerBuilder::new(build)).build(context);
        let manager = manager.into_any_arc().downcast();
        Self {
            manager: manager.expect("it was built as this type"),
            types,
        }
    }

    /// Enters the types into the tree of a server that knows none yet.
    pub(super) fn enter_types(&self, tree: &mut DefaultTypeTree) {
        let namespaces = tree.namespaces().clone();
        *tree = self.types.clone();
        *tree.namespaces_mut() = namespaces;
    }
}

/// The methods of the standard nodes.
pub(super) struct Methods;

#[async_trait]
#[expect(clippy::mut_mut, reason = "the crate's own signature")]
impl InMemoryNodeManagerImpl for Methods {
    async fn init(&self, _: &mut AddressSpace, _: ServerContext) {}

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
