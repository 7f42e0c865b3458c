//! The nodes of a driver: a folder, containing a folder per station, which contain the signals.

use std::path::Path;

use opcua::types::{
    DataTypeId, DataValue, ExtensionObject, LocalizedText, NodeId, ObjectId, QualifiedName, Range,
    VariableTypeId, Variant,
};
use opcua_server::address_space::AddressSpace;
use opcua_server::address_space::{AccessLevel, NodeType, ObjectBuilder, VariableBuilder};

use crate::values::{data_type_id, variant};
use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::{Area, DataType, Scale, Signal, SignalTable};

use super::nodeset::{NodeSets, Target};
use super::parts::{self, Parts};
use super::units::unit;
use super::whole::Wholes;
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
    /// The maker's address space.
    nodesets: NodeSets,
    /// By signal, its node in the maker's address space; `None` for one that is added.
    targets: Vec<Option<Target>>,
    /// The maker's variables that have several signals.
    pub(super) wholes: Wholes,
}

impl Places {
    /// The node ids of the signals in `table`, and their nodes in the maker's address space.
    ///
    /// # Errors
    ///
    /// A mistake in that address space, with the offset of the line in the driver.cfg that it concerns.
    pub(super) fn new(
        options: &ServerOptions,
        table: &SignalTable,
        folder: &Path,
    ) -> Result<Self, Vec<(usize, Mistake)>> {
        let at = options.nodeset_at.unwrap_or(options.at);
        let whole = |mistake| vec![(at, mistake)];
        let nodesets = NodeSets::load(folder, &options.nodesets).map_err(whole)?;
        let of_files = nodesets.uris();
        if let Some(uri) = of_files.iter().find(|uri| options.is_taken(uri)) {
            return Err(whole(Mistake::new(
                format!(
                    "a file of \"nodeset\" has the namespace \"{}\", which is that of the server itself",
                    shown(uri)
                ),
                "write another \"uri\" in \"identity\", or another namespace in the file",
            )));
        }
        let device = options.device_nodes(&of_files);
        let own = usize::from(FIRST) + device.uris.len() - 1;
        let own = u16::try_from(own).unwrap_or(u16::MAX);
        let node = |signal: &Signal| match device.nodes.get(&signal.name) {
            Some((index, Identifier::Number(number))) => NodeId::new(*index, *number),
            Some((index, Identifier::Text(text))) => NodeId::new(*index, text.as_str()),
            None => NodeId::new(own, signal.name.as_str()),
        };
        let mut places = Self {
            own,
            nodes: table.signals.iter().map(node).collect(),
            uris: device.uris,
            nodesets,
            targets: vec![None; table.signals.len()],
            wholes: Wholes::default(),
        };
        if options.nodesets.is_empty() {
            return Ok(places);
        }
        let (mut found, mut types) = places
            .nodesets
            .check(|uri| places.index(uri))
            .map_err(whole)?;
        let mut mistakes = Vec::new();
        let mut parts = Parts::default();
        for (index, signal) in table.signals.iter().enumerate() {
            let Some(line) = options.nodes.get(&signal.name) else {
                continue;
            };
            let is_node = |id: &NodeId| found.contains_key(id);
            if let Some((node, steps)) = parts::split(&places.nodes[index], &line.member, is_node) {
                places.nodes[index] = node.clone();
                places.targets[index] = Some(Target::Member);
                parts.add(node, (index, line.at), steps);
            }
        }
        places.wholes = parts.resolve(table, &mut found, &mut types, &mut mistakes);
        for (index, signal) in table.signals.iter().enumerate() {
            let Some(line) = options.nodes.get(&signal.name) else {
                continue;
            };
            if places.targets[index].is_some() {
                continue;
            }
            let target = found.remove(&places.nodes[index]);
            match bind(signal, target.as_ref(), options.role.areas().1) {
                Ok(target) => places.targets[index] = Some(target),
                Err(mistake) => mistakes.push((line.at, mistake)),
            }
        }
        if mistakes.is_empty() {
            Ok(places)
        } else {
            Err(mistakes)
        }
    }

    /// The number of a namespace.
    fn index(&self, uri: &str) -> Option<u16> {
        let at = self.uris.iter().position(|known| known == uri)?;
        u16::try_from(at).ok()?.checked_add(FIRST)
    }

    /// Returns true if a signal is a method of the maker's address space.
    pub(super) fn is_method(&self, signal: usize) -> bool {
        self.targets[signal] == Some(Target::Method)
    }

    /// The node of a signal.
    pub(super) fn node(&self, signal: usize) -> &NodeId {
        &self.nodes[signal]
    }

    /// The node with a signal's value in engineering units, if it has one.
    pub(super) fn scaled(&self, table: &SignalTable, signal: usize) -> Option<(NodeId, Scale)> {
        let is_bound = self.targets[signal].is_some();
        let signal = &table.signals[signal];
        let name = format!("{}{SCALED}", signal.name);
        // A signal of that name takes precedence. Nothing is added to the maker's variables.
        let scale = signal
            .scale
            .filter(|_| !is_bound)
            .filter(|_| table.position(&name).is_none())?;
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
    if let Err(mistake) = places.nodesets.build(space, |uri| places.index(uri)) {
        // It was checked when the bus was made.
        log::warn!("the address space is not complete: {mistake}");
    }
    let (bound, others): (Vec<usize>, Vec<usize>) =
        (0..table.signals.len()).partition(|index| places.targets[*index].is_some());
    for index in bound {
        let signal = &table.signals[index];
        if let Some(NodeType::Variable(variable)) = space.find_mut(places.node(index)) {
            let mut access = AccessLevel::CURRENT_READ;
            access.set(AccessLevel::CURRENT_WRITE, signal.area == reads);
            variable.set_access_level(access);
            variable.set_user_access_level(access);
            variable.set_minimum_sampling_interval(0.0);
            let first = places.wholes.first(index);
            let whole = first.and_then(|first| places.wholes.value(first));
            let value = whole.unwrap_or_else(|| variant(signal.data_type, 0));
            variable.set_data_value(DataValue::new_now(value));
        }
    }
    if others.is_empty() {
        return;
    }
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
    for index in others {
        let signal = &table.signals[index];
        let parent = if table.stations[signal.station].name.is_empty() {
            top.clone()
        } else {
            places.number(FOLDERS + 1 + signal.station)
        };
        variable(space, places, table, index, parent, reads);
    }
}

/// The node of the maker's address space for a signal; `reads` is the area that clients write.
fn bind(signal: &Signal, target: Option<&Target>, reads: Area) -> Result<Target, Mistake> {
    let name = shown(&signal.name);
    match target {
        Some(Target::Variable(of_type)) => {
            // Of other types the standard's tree would have to be known: numbers, times and enumerations.
            let is_plain = of_type.namespace == 0;
            let number = of_type.as_data_type_id().ok().filter(|_| is_plain);
            let fits = match number.map(|id| id as u32) {
                Some(known @ 1..=11) => known == data_type_id(signal.data_type) as u32,
                Some(12..=22) => false,
                _ => true,
            };
            if fits {
                return Ok(Target::Variable(of_type.clone()));
            }
            let words = number.map_or_else(|| of_type.to_string(), |id| format!("{id:?}"));
            Err(Mistake::new(
                format!(
                    "the variable is of type {words}, and the signal \"{name}\" of type {}",
                    signal.data_type
                ),
                "correct \"type\" of the signal, or name another node",
            ))
        }
        Some(Target::Method) => {
            let is_pulse = signal.data_type == DataType::Bool && signal.latch.is_some();
            if is_pulse && signal.area == reads {
                return Ok(Target::Method);
            }
            Err(Mistake::new(
                format!(
                    "the node is a method, whose call is a pulse, and the signal \"{name}\" could miss it"
                ),
                "name it for a BOOL that clients write, with latch = \"rising\"",
            ))
        }
        Some(Target::List(_)) => Err(Mistake::new(
            format!("the variable has an array, and the signal \"{name}\" is a single value"),
            "name an element of it, such as \"ns=2;i=6001[0]\"",
        )),
        Some(Target::Other | Target::Member) => Err(Mistake::new(
            "the node is neither a variable nor a method",
            "name the variable below it that has the value",
        )),
        None => Err(Mistake::new(
            "no file of \"nodeset\" has that node, or another signal is it",
            "name a variable of the file; \"nsu=…\" spells its namespace as the file does",
        )),
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
