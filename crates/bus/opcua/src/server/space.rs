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

/// The namespace of the signals; 0 and 1 are the crate's.
pub(super) const NAMESPACE: u16 = 2;

/// The URI of that namespace.
pub(super) const NAMESPACE_URI: &str = "urn:tickbus:signals";

/// The suffix of a node with a scaled signal's value in engineering units.
const SCALED: &str = ".scaled";

/// The first numeric ids of folders and properties; signals have strings.
const FOLDERS: usize = 1;
const PROPERTIES: usize = 1_000_000;

/// The node of a signal.
pub(super) fn node(name: &str) -> NodeId {
    NodeId::new(NAMESPACE, name)
}

/// The node with a signal's value in engineering units, if it has one.
pub(super) fn scaled(table: &SignalTable, signal: &Signal) -> Option<(NodeId, Scale)> {
    let name = format!("{}{SCALED}", signal.name);
    // A signal of that name takes precedence.
    let scale = signal.scale.filter(|_| table.position(&name).is_none())?;
    Some((node(&name), scale))
}

/// Creates the nodes; `reads` is the area that clients write.
pub(super) fn build(space: &mut AddressSpace, driver: &str, table: &SignalTable, reads: Area) {
    let top = number(FOLDERS);
    folder(space, &top, driver, ObjectId::ObjectsFolder.into());
    for (index, station) in table.stations.iter().enumerate() {
        if !station.name.is_empty() {
            folder(
                space,
                &number(FOLDERS + 1 + index),
                &station.name,
                top.clone(),
            );
        }
    }
    for (index, signal) in table.signals.iter().enumerate() {
        let parent = if table.stations[signal.station].name.is_empty() {
            top.clone()
        } else {
            number(FOLDERS + 1 + signal.station)
        };
        variable(space, table, index, parent, reads);
    }
}

fn number(number: usize) -> NodeId {
    let number = u32::try_from(number).expect("tables hold fewer than 2^31 signals");
    NodeId::new(NAMESPACE, number)
}

fn browse(name: &str) -> QualifiedName {
    QualifiedName::new(NAMESPACE, name)
}

fn folder(space: &mut AddressSpace, id: &NodeId, name: &str, parent: NodeId) {
    let made = ObjectBuilder::new(id, browse(name), name)
        .is_folder()
        .organized_by(parent)
        .insert(space);
    debug_assert!(made, "no number is given twice");
}

fn variable(
    space: &mut AddressSpace,
    table: &SignalTable,
    index: usize,
    parent: NodeId,
    reads: Area,
) {
    let signal = &table.signals[index];
    let id = node(&signal.name);
    let scaled = scaled(table, signal);
    // The unit belongs to the value in engineering units.
    let own_unit = signal.unit.as_deref().filter(|_| signal.scale.is_none());
    let kind = match own_unit {
        Some(_) => VariableTypeId::AnalogUnitType,
        None => VariableTypeId::BaseDataVariableType,
    };
    let builder = VariableBuilder::new(&id, browse(&signal.name), &*signal.name)
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
        units(space, first, name, &id);
    }
    let Some((value, _)) = scaled else {
        return;
    };
    VariableBuilder::new(&value, browse("Scaled"), "Scaled")
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
        first + 1,
        signal.unit.as_deref().unwrap_or_default(),
        &value,
    );
    if let Some([low, high]) = signal.range {
        // The range of normal operation, not of the type (OPC 10000-8, 5.3.2).
        let range = ExtensionObject::from_message(Range { low, high });
        property(
            space,
            first + 2,
            "EURange",
            DataTypeId::Range,
            range,
            &value,
        );
    }
}

fn units(space: &mut AddressSpace, at: usize, name: &str, of: &NodeId) {
    let unit = ExtensionObject::from_message(unit(name));
    let kind = DataTypeId::EUInformation;
    property(space, at, "EngineeringUnits", kind, unit, of);
}

fn property(
    space: &mut AddressSpace,
    at: usize,
    name: &str,
    kind: DataTypeId,
    value: ExtensionObject,
    of: &NodeId,
) {
    VariableBuilder::new(&number(at), QualifiedName::new(0, name), name)
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
