//! The values of standard nodes that describe the current state of the server.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use chrono::Offset;
use opcua::types::{
    DataValue, DateTime, ExtensionObject, NodeId, NumericRange, ServerStatusDataType, StatusCode,
    TimeZoneDataType, VariableId, Variant,
};
use opcua_server::node_manager::{
    NodeManagersRef, ParsedReadValueId, RequestContext, ServerContext,
};
use opcua_server::{ServerInfo, ServerStatusWrapper};

use crate::pki::date;
use tickbus_base::time::WallClock;

/// The places where these values are.
#[derive(Clone)]
pub(super) struct Live {
    managers: NodeManagersRef,
    info: Arc<ServerInfo>,
    status: Arc<ServerStatusWrapper>,
    wall: WallClock,
}

impl Live {
    pub(super) fn new(context: &ServerContext, wall: WallClock) -> Self {
        Self {
            managers: context.node_managers.clone(),
            info: Arc::clone(&context.info),
            status: Arc::clone(&context.status),
            wall,
        }
    }

    /// The value of a node; `None` if the node itself has it.
    pub(super) fn read(
        &self,
        context: &RequestContext,
        wanted: &ParsedReadValueId,
    ) -> Option<DataValue> {
        let id = variable(&wanted.node_id)?;
        let info = &self.info;
        if id == VariableId::Server_ServerStatus {
            return Some(self.whole_status());
        }
        if info.diagnostics.is_mapped(id) {
            let permissions = info.authenticator.core_permissions(&context.token);
            return Some(if permissions.read_diagnostics {
                info.diagnostics.get(id).unwrap_or_default()
            } else {
                DataValue::new_at_status(
                    Variant::Empty,
                    self.now(),
                    StatusCode::BadUserAccessDenied,
                )
            });
        }
        let value = if id == VariableId::Server_NamespaceArray {
            self.namespaces(context)?
        } else {
            None.or_else(|| self.status(id))
                .or_else(|| self.capability(id))
                .or_else(|| self.limit(id))
                .or_else(|| self.history(id))?
        };
        let value = match wanted.index_range {
            NumericRange::None => Ok(value),
            ref range => value.range_of(range),
        };
        Some(match value {
            Ok(value) => DataValue {
                value: Some(value),
                status: Some(StatusCode::Good),
                source_timestamp: Some(**info.start_time.load()),
                server_timestamp: Some(**info.start_time.load()),
                ..DataValue::default()
            },
            Err(status) => DataValue {
                status: Some(status),
                ..DataValue::default()
            },
        })
    }

    /// The function that returns the value of a node again and again, if it changes without being reported.
    pub(super) fn sample(
        &self,
        node: &NodeId,
    ) -> Option<impl FnMut() -> Option<DataValue> + Send + 'static> {
        let id = variable(node)?;
        let changes = matches!(
            id,
            VariableId::Server_ServerStatus
                | VariableId::Server_ServerStatus_CurrentTime
                | VariableId::Server_ServerStatus_SecondsTillShutdown
                | VariableId::Server_ServerStatus_ShutdownReason
        );
        let is_counted = self.info.diagnostics.is_mapped(id);
        let live = self.clone();
        (changes || is_counted).then_some(move || match id {
            VariableId::Server_ServerStatus => Some(live.whole_status()),
            _ if is_counted => live.info.diagnostics.get(id),
            _ => match live.status(id)? {
                // The server is not about to end.
                Variant::Empty => None,
                value => Some(DataValue::new_at(value, live.now())),
            },
        })
    }

    /// The structure `ServerStatus`. The crate's own stands still between two samples.
    fn whole_status(&self) -> DataValue {
        let whole = self.status.full_status_obj();
        let time = self.now();
        let whole = match whole.inner_as::<ServerStatusDataType>() {
            Some(status) => ExtensionObject::from_message(ServerStatusDataType {
                current_time: time,
                ..status.clone()
            }),
            None => whole,
        };
        DataValue::new_at(whole, time)
    }

    fn now(&self) -> DateTime {
        date((self.wall)())
    }

    fn status(&self, id: VariableId) -> Option<Variant> {
        use VariableId as Id;
        let status = &self.status;
        let build = || status.build_info();
        Some(match id {
            Id::Server_ServerStatus_BuildInfo => ExtensionObject::from_message(build()).into(),
            Id::Server_ServerStatus_BuildInfo_BuildDate => build().build_date.into(),
            Id::Server_ServerStatus_BuildInfo_BuildNumber => build().build_number.into(),
            Id::Server_ServerStatus_BuildInfo_ManufacturerName => build().manufacturer_name.into(),
            Id::Server_ServerStatus_BuildInfo_ProductName => build().product_name.into(),
            Id::Server_ServerStatus_BuildInfo_ProductUri => build().product_uri.into(),
            Id::Server_ServerStatus_BuildInfo_SoftwareVersion => build().software_version.into(),
            Id::Server_ServerStatus_CurrentTime => self.now().into(),
            Id::Server_ServerStatus_SecondsTillShutdown => status.seconds_till_shutdown().into(),
            Id::Server_ServerStatus_ShutdownReason => status.shutdown_reason().into(),
            Id::Server_ServerStatus_StartTime => status.start_time().into(),
            Id::Server_ServerStatus_State => (status.state() as i32).into(),
            _ => return None,
        })
    }

    fn capability(&self, id: VariableId) -> Option<Variant> {
        use VariableId as Id;
        let info = &self.info;
        Some(match id {
            Id::Server_ServerArray => info.servers.clone().into(),
            Id::Server_ServerCapabilities_ServerProfileArray => {
                info.capabilities.profiles.clone().into()
            }
            Id::Server_ServiceLevel => info.service_level.load(Ordering::Relaxed).into(),
            Id::Server_LocalTime => {
                let here = self.now().as_chrono().with_timezone(&chrono::Local);
                let minutes = here.offset().fix().local_minus_utc() / 60;
                ExtensionObject::from_message(TimeZoneDataType {
                    offset: minutes.try_into().ok()?,
                    daylight_saving_in_offset: false,
                })
                .into()
            }
            _ => return None,
        })
    }

    /// The URIs of all namespaces, by their indices.
    fn namespaces(&self, context: &RequestContext) -> Option<Variant> {
        let mut uris = Vec::new();
        let managers = self.managers.iter();
        for namespace in managers.flat_map(|manager| manager.namespaces_for_user(context)) {
            let index = usize::from(namespace.namespace_index);
            if uris.len() <= index {
                uris.resize(index + 1, String::new());
            }
            uris[index] = namespace.namespace_uri;
        }
        (!uris.is_empty()).then(|| uris.into())
    }

    fn limit(&self, id: VariableId) -> Option<Variant> {
        use VariableId as Id;
        let limits = &self.info.config.limits;
        let of = &limits.operational;
        let points = match id {
            Id::Server_ServerCapabilities_MaxBrowseContinuationPoints => {
                Some(limits.max_browse_continuation_points)
            }
            Id::Server_ServerCapabilities_MaxHistoryContinuationPoints => {
                Some(limits.max_history_continuation_points)
            }
            Id::Server_ServerCapabilities_MaxQueryContinuationPoints => {
                Some(limits.max_query_continuation_points)
            }
            _ => None,
        };
        if let Some(points) = points {
            return Some(u16::try_from(points).unwrap_or(u16::MAX).into());
        }
        let limit = match id {
            Id::Server_ServerCapabilities_MaxArrayLength => limits.max_array_length,
            Id::Server_ServerCapabilities_MaxByteStringLength => limits.max_byte_string_length,
            Id::Server_ServerCapabilities_MaxStringLength => limits.max_string_length,
            // The server accepts any, and revises it.
            Id::Server_ServerCapabilities_MinSupportedSampleRate => 0,
            Id::Server_ServerCapabilities_OperationLimits_MaxMonitoredItemsPerCall => {
                of.max_monitored_items_per_call
            }
            Id::Server_ServerCapabilities_OperationLimits_MaxNodesPerBrowse => {
                of.max_nodes_per_browse
            }
            Id::Server_ServerCapabilities_OperationLimits_MaxNodesPerHistoryReadData => {
                of.max_nodes_per_history_read_data
            }
            Id::Server_ServerCapabilities_OperationLimits_MaxNodesPerHistoryReadEvents => {
                of.max_nodes_per_history_read_events
            }
            Id::Server_ServerCapabilities_OperationLimits_MaxNodesPerHistoryUpdateData
            | Id::Server_ServerCapabilities_OperationLimits_MaxNodesPerHistoryUpdateEvents => {
                of.max_nodes_per_history_update
            }
            Id::Server_ServerCapabilities_OperationLimits_MaxNodesPerMethodCall => {
                of.max_nodes_per_method_call
            }
            Id::Server_ServerCapabilities_OperationLimits_MaxNodesPerNodeManagement => {
                of.max_nodes_per_node_management
            }
            Id::Server_ServerCapabilities_OperationLimits_MaxNodesPerRead => of.max_nodes_per_read,
            Id::Server_ServerCapabilities_OperationLimits_MaxNodesPerRegisterNodes => {
                of.max_nodes_per_register_nodes
            }
            Id::Server_ServerCapabilities_OperationLimits_MaxNodesPerTranslateBrowsePathsToNodeIds => {
                of.max_nodes_per_translate_browse_paths_to_node_ids
            }
            Id::Server_ServerCapabilities_OperationLimits_MaxNodesPerWrite => {
                of.max_nodes_per_write
            }
            _ => return None,
        };
        Some(u32::try_from(limit).unwrap_or(u32::MAX).into())
    }

    fn history(&self, id: VariableId) -> Option<Variant> {
        use VariableId as Id;
        let of = &self.info.capabilities.history;
        Some(
            match id {
                Id::HistoryServerCapabilities_AccessHistoryDataCapability => of.access_history_data,
                Id::HistoryServerCapabilities_AccessHistoryEventsCapability => {
                    of.access_history_events
                }
                Id::HistoryServerCapabilities_DeleteAtTimeCapability => of.delete_at_time,
                Id::HistoryServerCapabilities_DeleteEventCapability => of.delete_event,
                Id::HistoryServerCapabilities_DeleteRawCapability => of.delete_raw,
                Id::HistoryServerCapabilities_InsertAnnotationCapability => of.insert_annotation,
                Id::HistoryServerCapabilities_InsertDataCapability => of.insert_data,
                Id::HistoryServerCapabilities_InsertEventCapability => of.insert_event,
                Id::HistoryServerCapabilities_MaxReturnDataValues => {
                    return Some(of.max_return_data_values.into());
                }
                Id::HistoryServerCapabilities_MaxReturnEventValues => {
                    return Some(of.max_return_event_values.into());
                }
                Id::HistoryServerCapabilities_ReplaceDataCapability => of.replace_data,
                Id::HistoryServerCapabilities_ReplaceEventCapability => of.replace_event,
                Id::HistoryServerCapabilities_ServerTimestampSupported => {
                    of.server_timestamp_supported
                }
                Id::HistoryServerCapabilities_UpdateDataCapability => of.update_data,
                Id::HistoryServerCapabilities_UpdateEventCapability => of.update_event,
                _ => return None,
            }
            .into(),
        )
    }
}

fn variable(node: &NodeId) -> Option<VariableId> {
    node.as_variable_id().ok()
}
