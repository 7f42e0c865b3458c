//! The data types of `NodeSet2` files: their definitions, and the structures that values are made of.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use opcua::types::custom::{DataTypeTree, EncodingIds, ParentIds, TypeInfo};
use opcua::types::{
    DataTypeDefinition, EnumDefinition, EnumField, LocalizedText, NodeClass, NodeId,
    ReferenceTypeId, StructureDefinition, StructureField, StructureType,
};
use opcua_server::address_space::{AddressSpace, HasNodeId, ImportedItem, NodeType};
use roxmltree::Node;

use super::attributes::{dimensions, flag, localized, number};
use super::{TagName, child};

/// The structures of the standard that have no members themselves: Structure, Union.
const BARE: [NodeId; 2] = [
    NodeId {
        namespace: 0,
        identifier: opcua::types::Identifier::Numeric(22),
    },
    NodeId {
        namespace: 0,
        identifier: opcua::types::Identifier::Numeric(12756),
    },
];

/// The structures with members whose type a value states, which async-opcua 0.19 neither reads nor writes.
const OPEN: [StructureType; 2] = [
    StructureType::StructureWithSubtypedValues,
    StructureType::UnionWithSubtypedValues,
];

/// The deepest nesting of structures whose members can be signals.
const DEEPEST: usize = 16;

/// The most supertypes of a structure whose definition is known.
const MOST_SUPERTYPES: usize = 100;

/// The data types that files define.
#[derive(Debug, Default)]
pub(crate) struct Types {
    /// As in the file: structures without inherited members.
    own: HashMap<NodeId, DataTypeDefinition>,
    /// By subtype.
    supertypes: HashMap<NodeId, NodeId>,
    /// The objects that are called `Default Binary`.
    binary: HashSet<NodeId>,
    /// Encodings by data type.
    encodings: HashMap<NodeId, Vec<NodeId>>,
}

impl Types {
    /// Adds the facts about data types that one node has.
    pub(crate) fn take(&mut self, item: &ImportedItem) {
        let id = item.node.node_id();
        let is_type = item.node.node_class() == NodeClass::DataType;
        match &item.node {
            NodeType::DataType(node) => {
                if let Some(definition) = node.data_type_definition() {
                    self.own.entry(id.clone()).or_insert(definition.clone());
                }
            }
            NodeType::Object(node) => {
                use opcua_server::address_space::NodeBase;
                if node.browse_name().name.as_ref() == "Default Binary" {
                    self.binary.insert(id.clone());
                }
            }
            _ => {}
        }
        for reference in &item.references {
            let target = &reference.target_id;
            let ends = if reference.is_forward {
                (id, target)
            } else {
                (target, id)
            };
            if reference.type_id == ReferenceTypeId::HasEncoding {
                let of = self.encodings.entry(ends.0.clone()).or_default();
                of.push(ends.1.clone());
            } else if is_type && reference.type_id == ReferenceTypeId::HasSubtype {
                self.supertypes.insert(ends.1.clone(), ends.0.clone());
            }
        }
    }

    /// The complete definition of a type: its structure's inherited members come first. `None` if it is not known.
    fn definition(&self, id: &NodeId) -> Option<DataTypeDefinition> {
        self.inherited(id, MOST_SUPERTYPES)
    }

    /// The same, with at most this many supertypes.
    fn inherited(&self, id: &NodeId, left: usize) -> Option<DataTypeDefinition> {
        let structure = match self.own.get(id)? {
            DataTypeDefinition::Structure(structure) => structure,
            definition @ DataTypeDefinition::Enum(_) => return Some(definition.clone()),
        };
        let base = self.supertypes.get(id)?;
        let mut fields = Vec::new();
        let mut has_optional = structure.structure_type != StructureType::Structure;
        if !BARE.contains(base) {
            let DataTypeDefinition::Structure(inherited) =
                self.inherited(base, left.checked_sub(1)?)?
            else {
                return None;
            };
            has_optional |= inherited.structure_type != StructureType::Structure;
            fields = inherited.fields.unwrap_or_default();
        }
        fields.extend(structure.fields.iter().flatten().cloned());
        let encodings = self.encodings.get(id).into_iter().flatten();
        let binary = encodings
            .filter(|encoding| self.binary.contains(encoding))
            .min_by_key(ToString::to_string);
        Some(DataTypeDefinition::Structure(StructureDefinition {
            default_encoding_id: binary.cloned().unwrap_or_else(NodeId::null),
            base_data_type: base.clone(),
            structure_type: match structure.structure_type {
                StructureType::Structure if has_optional => {
                    StructureType::StructureWithOptionalFields
                }
                own => own,
            },
            fields: Some(fields),
        }))
    }

    /// Gives the nodes of data types their definitions.
    pub(super) fn define(&self, space: &mut AddressSpace) {
        for id in self.own.keys() {
            let definition = self.definition(id);
            if let Some(NodeType::DataType(node)) = space.find_mut(id) {
                node.set_data_type_definition(definition);
            }
        }
    }

    /// An empty tree that knows which type is a subtype of which.
    pub(crate) fn tree(&self) -> DataTypeTree {
        let mut parents = ParentIds::new();
        for (subtype, of) in &self.supertypes {
            parents.add_type(subtype.clone(), of.clone());
        }
        DataTypeTree::new(parents)
    }

    /// Adds a structure, and those that it has inside, to `tree`.
    ///
    /// # Errors
    ///
    /// A type is unknown, or has itself inside.
    pub(crate) fn add_structure(
        &self,
        tree: &mut DataTypeTree,
        id: &NodeId,
        outside: &mut Vec<NodeId>,
    ) -> Result<(), String> {
        if outside.contains(id) || outside.len() > DEEPEST {
            return Err(format!("the structure {id} is nested too deeply"));
        }
        if tree.get_struct_type(id).is_some() {
            return Ok(());
        }
        let known = self.definition(id);
        let Some(DataTypeDefinition::Structure(structure)) = known else {
            return Err(format!(
                "no file of \"nodeset\" defines the members of its type {id}"
            ));
        };
        if OPEN.contains(&structure.structure_type) {
            return Err(format!("the type {id} has members of an open type"));
        }
        if structure.default_encoding_id.is_null() {
            return Err(format!("the type {id} has no binary encoding"));
        }
        outside.push(id.clone());
        for field in structure.fields.iter().flatten() {
            let builtin = tree.parent_ids().get_builtin_type(&field.data_type);
            if builtin == Some(opcua::types::VariantScalarTypeId::ExtensionObject) {
                self.add_structure(tree, &field.data_type, outside)?;
            }
        }
        outside.pop();
        let binary = &structure.default_encoding_id;
        let encodings = EncodingIds {
            binary_id: binary.clone(),
            json_id: binary.clone(),
            xml_id: binary.clone(),
        };
        let info = TypeInfo::from_type_definition(
            DataTypeDefinition::Structure(structure),
            id.to_string(),
            Some(encodings),
            false,
            id,
            tree.parent_ids(),
        )?;
        if let TypeInfo::Struct(info) = info {
            let info = Arc::try_unwrap(info).map_err(|_| "the type is in use".to_owned())?;
            tree.add_type(id.clone(), info);
        }
        Ok(())
    }
}

/// Reads the definition in the element of a data type; inherited members, base and encoding are filled in later.
pub(super) fn definition(
    element: Node<'_, '_>,
    id: &dyn Fn(&str) -> Result<NodeId, String>,
) -> Result<Option<DataTypeDefinition>, String> {
    let Some(definition) = child(element, "Definition") else {
        return Ok(None);
    };
    let fields = definition.children();
    let fields: Vec<_> = fields
        .filter(|field| field.has_tag_name_of("Field"))
        .collect();
    let text = |field: Node<'_, '_>, name| localized(field, name).unwrap_or_default();
    if fields.iter().any(|field| field.has_attribute("Value")) {
        let fields = fields.into_iter().map(|field| {
            let name = field.attribute("Name").unwrap_or_default();
            Ok(EnumField {
                value: number(field, "Value", -1_i64)?,
                display_name: localized(field, "DisplayName")
                    .unwrap_or_else(|| LocalizedText::from(name)),
                description: text(field, "Description"),
                name: name.into(),
            })
        });
        let fields = fields.collect::<Result<Vec<_>, String>>()?;
        return Ok(Some(DataTypeDefinition::Enum(EnumDefinition {
            fields: Some(fields),
        })));
    }
    let has_optional = fields.iter().any(|field| flag(*field, "IsOptional", false));
    let has_subtypes = fields
        .iter()
        .any(|field| flag(*field, "AllowSubTypes", false));
    let is_union = flag(definition, "IsUnion", false);
    let fields = fields.into_iter().map(|field| {
        Ok(StructureField {
            name: field.attribute("Name").unwrap_or_default().into(),
            description: text(field, "Description"),
            data_type: id(field.attribute("DataType").unwrap_or("i=24"))?,
            value_rank: number(field, "ValueRank", -1)?,
            array_dimensions: dimensions(field)?,
            max_string_length: number(field, "MaxStringLength", 0)?,
            is_optional: flag(field, "IsOptional", false),
        })
    });
    Ok(Some(DataTypeDefinition::Structure(StructureDefinition {
        default_encoding_id: NodeId::null(),
        base_data_type: NodeId::null(),
        structure_type: match (is_union, has_optional, has_subtypes) {
            (true, _, false) => StructureType::Union,
            (true, _, true) => StructureType::UnionWithSubtypedValues,
            (false, _, true) => StructureType::StructureWithSubtypedValues,
            (false, true, false) => StructureType::StructureWithOptionalFields,
            (false, false, false) => StructureType::Structure,
        },
        fields: Some(fields.collect::<Result<Vec<_>, String>>()?),
    })))
}
