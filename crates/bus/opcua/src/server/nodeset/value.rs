//! The values of variables in a `NodeSet2` file, in the XML encoding of OPC 10000-6, 5.3.

use std::str::FromStr;

use opcua::types::{
    Argument, ByteString, DateTime, EUInformation, EnumValueType, ExtensionObject, Guid,
    LocalizedText, NodeId, QualifiedName, Range, UAString, Variant,
};
use roxmltree::Node;

use super::{child, text_of};

/// Reads a node id of the file.
type ReadId<'r> = &'r dyn Fn(&str) -> Result<NodeId, String>;

/// The value of an element; empty for a structure that is not one of the standard's frequent ones.
pub(super) fn variant(element: Node<'_, '_>, id: ReadId<'_>) -> Variant {
    let name = element.tag_name().name();
    let Some(single) = name.strip_prefix("ListOf") else {
        return scalar(name, element, id).unwrap_or(Variant::Empty);
    };
    let elements = element.children().filter(Node::is_element);
    let values = elements.map(|element| scalar(single, element, id));
    let values: Option<Vec<Variant>> = values.collect();
    let list = values.and_then(|values| {
        let of_type = values.first()?.scalar_type_id()?;
        Some(Variant::from((of_type, values)))
    });
    list.unwrap_or(Variant::Empty)
}

fn number<T: FromStr + Into<Variant>>(text: &str) -> Option<Variant> {
    text.parse::<T>().ok().map(Into::into)
}

fn scalar(name: &str, element: Node<'_, '_>, id: ReadId<'_>) -> Option<Variant> {
    let text = element.text().unwrap_or_default().trim();
    match name {
        "Boolean" => Some(matches!(text, "true" | "1").into()),
        "SByte" => number::<i8>(text),
        "Byte" => number::<u8>(text),
        "Int16" => number::<i16>(text),
        "UInt16" => number::<u16>(text),
        "Int32" => number::<i32>(text),
        "UInt32" => number::<u32>(text),
        "Int64" => number::<i64>(text),
        "UInt64" => number::<u64>(text),
        "Float" => number::<f32>(text),
        "Double" => number::<f64>(text),
        "String" => Some(UAString::from(element.text().unwrap_or_default()).into()),
        "DateTime" => {
            let zoned = format!("{}Z", text.trim_end_matches('Z'));
            Some(DateTime::from_str(&zoned).ok()?.into())
        }
        "Guid" => Some(Guid::from_str(text_of(element, "String")?).ok()?.into()),
        "ByteString" => {
            let plain: String = text.split_whitespace().collect();
            Some(ByteString::from_base64(&plain)?.into())
        }
        "NodeId" => Some(id(text_of(element, "Identifier")?).ok()?.into()),
        "LocalizedText" => Some(localized(element).into()),
        "QualifiedName" => {
            let index = text_of(element, "NamespaceIndex").unwrap_or("0");
            let name = text_of(element, "Name").unwrap_or_default();
            // Numbers of namespaces within values are those of OPC UA in all files seen.
            (index == "0").then(|| QualifiedName::new(0, name).into())
        }
        "ExtensionObject" => structure(element, id).map(Into::into),
        _ => None,
    }
}

fn structure(element: Node<'_, '_>, id: ReadId<'_>) -> Option<ExtensionObject> {
    let body = child(element, "Body")?.first_element_child()?;
    let text = |name: &str| text_of(body, name);
    let localized_of = |name: &str| child(body, name).map(localized).unwrap_or_default();
    Some(match body.tag_name().name() {
        "Argument" => {
            let data_type = child(body, "DataType")?;
            ExtensionObject::from_message(Argument {
                name: text("Name").unwrap_or_default().into(),
                data_type: id(text_of(data_type, "Identifier")?).ok()?,
                value_rank: text("ValueRank").unwrap_or("-1").parse().ok()?,
                array_dimensions: None,
                description: localized_of("Description"),
            })
        }
        "EUInformation" => ExtensionObject::from_message(EUInformation {
            namespace_uri: text("NamespaceUri").unwrap_or_default().into(),
            unit_id: text("UnitId").unwrap_or("-1").parse().ok()?,
            display_name: localized_of("DisplayName"),
            description: localized_of("Description"),
        }),
        "Range" => ExtensionObject::from_message(Range {
            low: text("Low").unwrap_or("0").parse().ok()?,
            high: text("High").unwrap_or("0").parse().ok()?,
        }),
        "EnumValueType" => ExtensionObject::from_message(EnumValueType {
            value: text("Value")?.parse().ok()?,
            display_name: localized_of("DisplayName"),
            description: localized_of("Description"),
        }),
        _ => return None,
    })
}

fn localized(element: Node<'_, '_>) -> LocalizedText {
    let text = |name: &str| text_of(element, name).unwrap_or_default();
    LocalizedText::new(text("Locale"), text("Text"))
}
