//! One element of a `NodeSet2` file as a node of an address space.

use std::collections::HashMap;
use std::str::FromStr;
use std::sync::OnceLock;

use opcua::types::{
    DataTypeId, DataValue, LocalizedText, NodeClass, NodeId, QualifiedName, ReferenceTypeId,
};
use opcua_server::address_space::{
    Base, DataType, EventNotifier, ImportedItem, ImportedReference, Method, NodeType, Object,
    ObjectType, ReferenceType, Variable, VariableType, View,
};
use roxmltree::Node;
use tickbus_base::toml_text::shown;

use super::attributes::{dimensions, flag, localized, number};
use super::{TagName, child, types, value};
use crate::namespaces::UA;

/// The types of the standard by their names, which some files use without an alias.
fn standard(name: &str) -> Option<NodeId> {
    /// Above the numbers of all types of the standard.
    const NUMBERS: u32 = 40_000;
    static TYPES: OnceLock<HashMap<String, NodeId>> = OnceLock::new();
    let types = TYPES.get_or_init(|| {
        let numbers = 1..NUMBERS;
        let types = numbers.filter_map(|number| {
            let data_type = DataTypeId::try_from(number).map(|id| format!("{id:?}"));
            let reference = || ReferenceTypeId::try_from(number).map(|id| format!("{id:?}"));
            let name = data_type.or_else(|()| reference()).ok()?;
            Some((name, NodeId::new(0, number)))
        });
        types.collect()
    });
    types.get(name).cloned()
}

/// The names of a file.
pub(super) struct Reader<'t> {
    aliases: HashMap<&'t str, &'t str>,
    /// The numbers of its namespaces in the server; `None` for a namespace that the server does not have.
    indices: Vec<Option<u16>>,
}

impl<'t> Reader<'t> {
    pub(super) fn new(
        root: Node<'t, '_>,
        uris: &[String],
        index: impl Fn(&str) -> Option<u16>,
    ) -> Self {
        let aliases = child(root, "Aliases").into_iter();
        let aliases = aliases.flat_map(|aliases| aliases.children());
        let aliases =
            aliases.filter_map(|alias| Some((alias.attribute("Alias")?, alias.text()?.trim())));
        let own = uris
            .iter()
            .map(|uri| if uri == UA { Some(0) } else { index(uri) });
        Self {
            aliases: aliases.collect(),
            indices: [Some(0)].into_iter().chain(own).collect(),
        }
    }

    /// The node of an element; `None` if the element does not describe a node.
    pub(super) fn item(&self, element: Node<'_, '_>) -> Result<Option<ImportedItem>, String> {
        let class = match element.tag_name().name() {
            "UAObject" => NodeClass::Object,
            "UAVariable" => NodeClass::Variable,
            "UAMethod" => NodeClass::Method,
            "UAView" => NodeClass::View,
            "UAObjectType" => NodeClass::ObjectType,
            "UAVariableType" => NodeClass::VariableType,
            "UADataType" => NodeClass::DataType,
            "UAReferenceType" => NodeClass::ReferenceType,
            _ => return Ok(None),
        };
        Ok(Some(ImportedItem {
            node: self.node(class, element)?,
            references: self.references(element)?,
        }))
    }

    fn node(&self, class: NodeClass, element: Node<'_, '_>) -> Result<NodeType, String> {
        let base = self.base(class, element)?;
        let is_abstract = flag(element, "IsAbstract", false);
        let rank = number(element, "ValueRank", -1)?;
        let dimensions = dimensions(element)?;
        let notifier = || {
            Ok::<_, String>(EventNotifier::from_bits_truncate(number(
                element,
                "EventNotifier",
                0,
            )?))
        };
        let data_type = || match element.attribute("DataType") {
            None => Ok(NodeId::new(0, 24_u32)),
            Some(text) => self.id(text),
        };
        let value = child(element, "Value").and_then(|value| value.first_element_child());
        let value = value.map(|value| value::variant(value, &|text| self.id(text)));
        let value = value.map(DataValue::new_now);
        Ok(match class {
            NodeClass::Object => Object::new_full(base, notifier()?).into(),
            NodeClass::View => {
                View::new_full(base, notifier()?, flag(element, "ContainsNoLoops", false)).into()
            }
            NodeClass::ObjectType => ObjectType::new_full(base, is_abstract).into(),
            NodeClass::DataType => {
                let definition = types::definition(element, &|text| self.id(text))?;
                DataType::new_full(base, is_abstract, definition).into()
            }
            NodeClass::Method => Method::new_full(
                base,
                flag(element, "Executable", true),
                flag(element, "UserExecutable", true),
            )
            .into(),
            NodeClass::ReferenceType => ReferenceType::new_full(
                base,
                flag(element, "Symmetric", false),
                is_abstract,
                localized(element, "InverseName"),
            )
            .into(),
            NodeClass::VariableType => {
                VariableType::new_full(base, data_type()?, is_abstract, rank, value, dimensions)
                    .into()
            }
            // A variable without a signal is read-only.
            _ => {
                let readable = number::<u8>(element, "AccessLevel", 1)? & 1;
                Variable::new_full(
                    base,
                    data_type()?,
                    false,
                    rank,
                    value.unwrap_or_else(DataValue::null),
                    readable,
                    readable,
                    dimensions,
                    None,
                )
                .into()
            }
        })
    }

    fn base(&self, class: NodeClass, element: Node<'_, '_>) -> Result<Base, String> {
        let id = element.attribute("NodeId").ok_or("a node has no NodeId")?;
        let name = element.attribute("BrowseName").unwrap_or_default();
        let name = self.qualified(name)?;
        let shown = localized(element, "DisplayName");
        let shown = shown.unwrap_or_else(|| LocalizedText::from(name.name.as_ref()));
        let description = localized(element, "Description");
        Ok(Base::new_full(
            self.id(id)?,
            class,
            name,
            shown,
            description,
            Some(0),
            Some(0),
        ))
    }

    fn references(&self, element: Node<'_, '_>) -> Result<Vec<ImportedReference>, String> {
        let list = child(element, "References").into_iter();
        let list = list.flat_map(|list| list.children());
        let list = list.filter(|reference| reference.has_tag_name_of("Reference"));
        let reference = |reference: Node<'_, '_>| {
            let of_type = reference.attribute("ReferenceType").unwrap_or_default();
            Ok(ImportedReference {
                target_id: self.id(reference.text().unwrap_or_default())?,
                type_id: self.id(of_type)?,
                is_forward: flag(reference, "IsForward", true),
            })
        };
        list.map(reference).collect()
    }

    /// A node id or its alias, with the namespace's number in the server.
    fn id(&self, text: &str) -> Result<NodeId, String> {
        let text = text.trim();
        let text = self.aliases.get(text).copied().unwrap_or(text);
        let Ok(mut id) = NodeId::from_str(text) else {
            let wrong = || format!("\"{}\" is no node id, and no alias of one", shown(text));
            return standard(text).ok_or_else(wrong);
        };
        id.namespace = self.index(id.namespace)?;
        Ok(id)
    }

    fn qualified(&self, text: &str) -> Result<QualifiedName, String> {
        let parts = text.split_once(':');
        let parts = parts.and_then(|(index, name)| Some((index.parse::<u16>().ok()?, name)));
        let (index, name) = parts.unwrap_or((0, text));
        Ok(QualifiedName::new(self.index(index)?, name))
    }

    fn index(&self, index: u16) -> Result<u16, String> {
        let found = self.indices.get(usize::from(index)).copied().flatten();
        found.ok_or_else(|| format!("the file has no namespace {index}"))
    }
}
