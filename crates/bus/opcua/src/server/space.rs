//! The nodes of a driver: a folder, containing a folder per station, which contain the signals.

use opcua::types::{
    DataTypeId, ExtensionObject, LocalizedText, NodeId, ObjectId, QualifiedName, Range,
    VariableTypeId, Variant,
};
use opcua_server::address_space::AddressSpace;
use opcua_server::address_space::{ObjectBuilder, VariableBuilder};

use crate::values::{data_type_id, variant};
use tickbus_image::signal::{Area, Scale, Signal, SignalTable};

use super::units::unit;
use crate::namespaces::FIRST;
use crate::{Identifier, ServerOptions};

/// The suffix of a node with a scaled signal's value in engineering units.
const SCALED: &str = ".scaled";

/// The first numeric ids of folders and properties; signals have strings.
const FOLDERS: usize = 1;
const PROPERTIES: usize = 1_000_000;

/// The node ids of a server.
#[derive(Debug)]
pub(super) struct Places {
    /// The URIs of the namespaces from number 2 on; 0 and 1 are the crate's.
    pub(super) uris: Vec<String>,
    /// The number of the last one, which has all nodes without an id in the driver.cfg.
    own: u16,
    /// By signal.
    nodes: Vec<NodeId>,
}

impl Places {
    /// The node ids of the signals in `table`.
    pub(super) fn new(options: &ServerOptions, table: &SignalTable) -> Self {
        let device = options.device_nodes();
        let own = usize::from(FIRST) + device.uris.len() - 1;
        let own = u16::try_from(own).expect("a device has fewer namespaces");
        let node = |signal: &Signal| match device.nodes.get(&signal.name) {
            Some((index, Identifier::Number(number))) => NodeId::new(*index, *number),
            Some((index, Identifier::Text(text))) => NodeId::new(*index, text.as_str()),
            None => NodeId::new(own, signal.name.as_str()),
        };
        Self {
            own,
            nodes: table.signals.iter().map(node).collect(),
            uris: device.uris,
        }
    }

    /// The node of a signal.
    pub(super) fn node(&self, signal: usize) -> &NodeId {
        &self.nodes[signal]
    }

    /// The node with a signal's value in engineering units, if it has one.
    pub(super) fn scaled(&self, table: &SignalTable, signal: usize) -> Option<(NodeId, Scale)> {
        let signal = &table.signals[signal];
        let name = format!("{}{SCALED}", signal.name);
        // A signal of that name takes precedence.
        let scale = signal.scale.filter(|_| table.position(&name).is_none())?;
        Some((NodeId::new(self.own, name), scale))
    }

    fn number(&self, number: usize) -> NodeId {
        let number = u32::try_from(number).expect("tables hold fewer than 2^31 signals");
        NodeId::new(self.own, number)
    }
}

/// Creates the nodes; `reads` is the area that clients write.
pub(super) fn build(
    space: &mut AddressSpace,
    places: &Places,
    driver: &str,
    table: &SignalTable,
    reads: Area,
) {
    let top = places.number(FOLDERS);
    folder(space, &top, driver, ObjectId::ObjectsFolder.into());
    for (index, station) in table.stations.iter().enumerate() {
        if !station.name.is_empty() {
            folder(
                space,
                &places.number(FOLDERS + 1 + index),
                &station.name,
                top.clone(),
            );
        }
    }
    for (index, signal) in table.signals.iter().enumerate() {
        let parent = if table.stations[signal.station].name.is_empty() {
            top.clone()
        } else {
            places.number(FOLDERS + 1 + signal.station)
        };
        variable(space, places, table, index, parent, reads);
    }
}

/// The browse name of a node.
fn browse(id: &NodeId, name: &str) -> QualifiedName {
    QualifiedName::new(id.namespace, name)
}

fn folder(space: &mut AddressSpace, id: &NodeId, name: &str, parent: NodeId) {
    let made = ObjectBuilder::new(id, browse(id, name), name)
        .is_folder()
        .organized_by(parent)
        .insert(space);
    debug_assert!(made, "no number is given twice");
}

fn variable(
    space: &mut AddressSpace,
    places: &Places,
    table: &SignalTable,
    index: usize,
    parent: NodeId,
    reads: Area,
) {
    let signal = &table.signals[index];
    let id = places.node(index).clone();
    let scaled = places.scaled(table, index);
    // The unit belongs to the value in engineering units.
    let own_unit = signal.unit.as_deref().filter(|_| signal.scale.is_none());
    let kind = match own_unit {
        Some(_) => VariableTypeId::AnalogUnitType,
        None => VariableTypeId::BaseDataVariableType,
    };
    let builder = VariableBuilder::new(&id, browse(&id, &signal.name), &*signal.name)
        .description(LocalizedText::from(&*description(signal)))
        .data_type(data_type_id(signal.data_type))
        .value_rank(-1)
        .value(variant(signal.data_type, 0))
        .minimum_sampling_interval(0.0)
        .has_type_definition(kind)
        .component_of(parent);
    let builder = if signal.area == reads {
        builder.writable()
    } else {
        builder
    };
    builder.insert(space);
    let first = PROPERTIES + 4 * index;
    if let Some(name) = own_unit {
        units(space, &places.number(first), name, &id);
    }
    let Some((value, _)) = scaled else {
        return;
    };
    VariableBuilder::new(&value, browse(&value, "Scaled"), "Scaled")
        .description(LocalizedText::from("the value in engineering units"))
        .data_type(DataTypeId::Double)
        .value_rank(-1)
        .value(0.0)
        .minimum_sampling_interval(0.0)
        .has_type_definition(match signal.range {
            Some(_) => VariableTypeId::AnalogItemType,
            None => VariableTypeId::AnalogUnitType,
        })
        .component_of(id)
        .insert(space);
    units(
        space,
        &places.number(first + 1),
        signal.unit.as_deref().unwrap_or_default(),
        &value,
    );
    if let Some([low, high]) = signal.range {
        // The range of normal operation, not of the type (OPC 10000-8, 5.3.2).
        let range = ExtensionObject::from_message(Range { low, high });
        property(
            space,
            &places.number(first + 2),
            "EURange",
            DataTypeId::Range,
            range,
            &value,
        );
    }
}

fn units(space: &mut AddressSpace, at: &NodeId, name: &str, of: &NodeId) {
    let unit = ExtensionObject::from_message(unit(name));
    let kind = DataTypeId::EUInformation;
    property(space, at, "EngineeringUnits", kind, unit, of);
}

fn property(
    space: &mut AddressSpace,
    at: &NodeId,
    name: &str,
    kind: DataTypeId,
    value: ExtensionObject,
    of: &NodeId,
) {
    VariableBuilder::new(at, QualifiedName::new(0, name), name)
        .data_type(kind)
        .value_rank(-1)
        .value(Variant::from(value))
        .has_type_definition(VariableTypeId::PropertyType)
        .property_of(of.clone())
        .insert(space);
}

/// The description of a signal: its address and type in the PLC.
fn description(signal: &Signal) -> String {
    format!("{} {}", signal.address(), signal.data_type)
}
