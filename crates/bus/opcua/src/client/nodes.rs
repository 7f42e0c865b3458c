//! The nodes of signals in the server, and whether they match the signals.

use std::fmt::Write as _;
use std::sync::Arc;

use opcua::client::Session;
use opcua::types::{
    AttributeId, DataTypeId, DataValue, NodeId, ReadValueId, TimestampsToReturn, VariableId,
    Variant,
};

use crate::pki::meaning;
use crate::values::{data_type_id, scalar};
use crate::{Identifier, Namespace, NodeName};
use tickbus_fieldbus::BusError;

use super::Field;

/// The most nodes checked in one call.
const CHUNK: usize = 50;

/// The most mistakes in one message.
const TOLD: usize = 5;

/// The attributes read from each node.
pub(super) const ATTRIBUTES: [AttributeId; 3] = [
    AttributeId::Value,
    AttributeId::DataType,
    AttributeId::UserAccessLevel,
];

/// The bits of an access level.
pub(super) const READS: u8 = 1;
pub(super) const WRITES: u8 = 2;

/// The server's information about itself.
pub(super) struct Server {
    /// The name of the product.
    pub(super) product: String,
    /// The most values in one Write; 0 for no limit.
    pub(super) most_writes: usize,
    /// The URIs of the namespaces, by their numbers.
    pub(super) namespaces: Vec<String>,
}

/// Asks the server for its product, its limits and its namespaces.
pub(super) async fn ask(session: &Session) -> Result<Server, BusError> {
    let ids = [
        VariableId::Server_ServerStatus_BuildInfo_ProductName,
        VariableId::Server_ServerCapabilities_OperationLimits_MaxNodesPerWrite,
        VariableId::Server_NamespaceArray,
    ];
    let wanted = ids.map(|id| ReadValueId::new_value(id.into()));
    let values = read(session, &wanted).await?;
    let value = |index: usize| values.get(index).and_then(|value| value.value.as_ref());
    let product = match value(0) {
        Some(Variant::String(name)) => name.as_ref().to_owned(),
        _ => String::new(),
    };
    let most_writes = match value(1) {
        Some(Variant::UInt32(most)) => *most as usize,
        _ => 0,
    };
    let namespaces = match value(2) {
        Some(Variant::Array(list)) => list.values.iter().map(Variant::to_string).collect(),
        _ => Vec::new(),
    };
    Ok(Server {
        product,
        most_writes,
        namespaces,
    })
}

/// Reads values or other attributes.
pub(super) async fn read(
    session: &Session,
    wanted: &[ReadValueId],
) -> Result<Vec<DataValue>, BusError> {
    let values = session.read(wanted, TimestampsToReturn::Neither, 0.0).await;
    let values = values.map_err(|error| {
        BusError::Link(format!(
            "the server cannot be read ({})",
            meaning(error.status())
        ))
    })?;
    if values.len() == wanted.len() {
        Ok(values)
    } else {
        Err(BusError::Protocol(format!(
            "the server was asked for {} values, and gave {}",
            wanted.len(),
            values.len()
        )))
    }
}

impl Server {
    /// The node that a driver.cfg names.
    pub(super) fn node(&self, name: &NodeName) -> Result<NodeId, String> {
        let namespace = match &name.namespace {
            Namespace::Index(index) => *index,
            Namespace::Uri(uri) => {
                let found = self.namespaces.iter().position(|known| known == uri);
                let found = found.and_then(|index| u16::try_from(index).ok());
                found.ok_or_else(|| {
                    format!(
                        "the server has no namespace \"{uri}\"; it has {:?}",
                        self.namespaces
                    )
                })?
            }
        };
        Ok(match &name.identifier {
            Identifier::Text(text) => NodeId::new(namespace, &**text),
            Identifier::Number(number) => NodeId::new(namespace, *number),
        })
    }
}

/// The node of each signal, each checked: it exists, has the signal's type, and can be read, or written if `writes`.
pub(super) async fn check(
    session: &Arc<Session>,
    server: &Server,
    fields: &[Field],
    writes: bool,
) -> Result<Vec<NodeId>, BusError> {
    let mut mistakes = Vec::new();
    let mut nodes = Vec::new();
    for field in fields {
        let node = server.node(&field.node);
        if let Err(why) = &node {
            mistakes.push(format!("\"{}\" is {}, but {why}", field.name, field.node));
        }
        nodes.push(node.unwrap_or_default());
    }
    let every: Vec<usize> = (0..fields.len()).collect();
    for chunk in every.chunks(CHUNK) {
        let wanted = chunk.iter().flat_map(|&index| {
            let node = nodes[index].clone();
            ATTRIBUTES.map(|attribute| ReadValueId::new(node.clone(), attribute))
        });
        let wanted: Vec<ReadValueId> = wanted.collect();
        let values = read(session, &wanted).await?;
        for (&index, values) in chunk.iter().zip(values.chunks(ATTRIBUTES.len())) {
            if !nodes[index].is_null()
                && let Err(why) = judge(&fields[index], values, writes)
            {
                mistakes.push(why);
            }
        }
    }
    if mistakes.is_empty() {
        return Ok(nodes);
    }
    let mut text = mistakes[..mistakes.len().min(TOLD)].join("; ");
    if mistakes.len() > TOLD {
        // Writing to a string cannot fail.
        let _ = write!(text, "; and {} more", mistakes.len() - TOLD);
    }
    Err(BusError::Refused(format!(
        "{text}; correct the signals, or [fieldbus.at] and \"node_pattern\", or the server"
    )))
}

/// Returns whether a node with these attributes fits the signal.
pub(super) fn judge(field: &Field, values: &[DataValue], writes: bool) -> Result<(), String> {
    let Field {
        name,
        node,
        data_type,
        is_read,
        ..
    } = field;
    let [value, kind, access] = values else {
        return Ok(());
    };
    let (own, theirs) = (scalar(*data_type), value.value.as_ref());
    let missing = kind.status();
    if missing.is_bad() {
        return Err(format!(
            "\"{name}\" is {node}, which the server does not have as a variable ({})",
            meaning(missing)
        ));
    }
    let differs = |theirs: &str| {
        Err(format!(
            "\"{name}\" is {data_type}, which is {own:?} in OPC UA, but {node} is {theirs} on the server"
        ))
    };
    match theirs {
        Some(Variant::Array(array)) => {
            return differs(&format!("an array of {:?}", array.value_type));
        }
        Some(value) if !value.is_empty() => match value.scalar_type_id() {
            Some(theirs) if theirs == own => {}
            Some(theirs) => return differs(&format!("{theirs:?}")),
            None => {}
        },
        // Without a value so far, the declared type decides, if it is one of the plain ones.
        _ => {
            if let Some(Variant::NodeId(id)) = &kind.value
                && let Ok(declared) = id.as_data_type_id()
                && is_plain(declared)
                && declared != data_type_id(*data_type)
            {
                return differs(&format!("{declared:?}"));
            }
        }
    }
    if let Some(Variant::Byte(access)) = access.value {
        if *is_read && access & READS == 0 {
            return Err(format!(
                "\"{name}\" is {node}, which this user may not read"
            ));
        }
        if !is_read && writes && access & WRITES == 0 {
            return Err(format!(
                "\"{name}\" is {node}, which this user may not write"
            ));
        }
    }
    Ok(())
}

/// True if all values of the type are of exactly that type, and not of a subtype.
fn is_plain(declared: DataTypeId) -> bool {
    // Boolean to String are 1 to 12.
    (1..=12).contains(&(declared as u32))
}
