//! The blocks, types and variables that a project declares.

use std::collections::HashMap;

use roxmltree::Node;

use super::nodes::{child, named};
use crate::diagram::{Library, Signature, Type};

/// The lists of variables in an interface.
const LISTS: [&str; 7] = [
    "inputVars",
    "outputVars",
    "inOutVars",
    "localVars",
    "externalVars",
    "globalVars",
    "tempVars",
];

/// Everything that a project declares.
pub(super) fn library(root: Node<'_, '_>) -> Library {
    let mut library = Library::default();
    for unit in named(root, "pou") {
        let name = unit.attribute("name").unwrap_or_default().to_uppercase();
        let mut signature = Signature {
            is_block: unit.attribute("pouType") != Some("function"),
            ..Signature::default()
        };
        if let Some(interface) = child(unit, "interface") {
            signature.result = child(interface, "returnType").and_then(kind);
            signature.inputs = list(interface, "inputVars");
            signature.outputs = list(interface, "outputVars");
            signature.in_outs = list(interface, "inOutVars");
        }
        library.units.insert(name, signature);
    }
    for declared in named(root, "dataType") {
        let name = declared
            .attribute("name")
            .unwrap_or_default()
            .to_uppercase();
        let Some(base) = child(declared, "baseType") else {
            continue;
        };
        if let Some(members) = child(base, "struct") {
            let members = of_variables(members).into_iter();
            let members = members.filter_map(|(name, kind)| Some((name, kind?)));
            library.structures.insert(name, members.collect());
        } else if let Some(kind) = kind(base) {
            library.aliases.insert(name, kind);
        }
    }
    library
}

/// The variables of a unit, by their names in capitals, with the name of a function for its result.
pub(super) fn variables(unit: Node<'_, '_>) -> HashMap<String, Type> {
    let Some(interface) = child(unit, "interface") else {
        return HashMap::new();
    };
    let lists = LISTS.iter().flat_map(|name| list(interface, name));
    let mut found: HashMap<String, Type> = lists
        .filter_map(|(name, kind)| Some((name, kind?)))
        .collect();
    if let Some(result) = child(interface, "returnType").and_then(kind) {
        let name = unit.attribute("name").unwrap_or_default();
        found.insert(name.to_uppercase(), result);
    }
    found
}

fn list(interface: Node<'_, '_>, name: &str) -> Vec<(String, Option<Type>)> {
    let lists = interface
        .children()
        .filter(|node| node.is_element() && node.tag_name().name() == name);
    lists.flat_map(of_variables).collect()
}

fn of_variables(holder: Node<'_, '_>) -> Vec<(String, Option<Type>)> {
    let variables = holder
        .children()
        .filter(|node| node.is_element() && node.tag_name().name() == "variable");
    let found = variables.map(|variable| {
        let name = variable.attribute("name").unwrap_or_default();
        (name.to_uppercase(), child(variable, "type").and_then(kind))
    });
    found.collect()
}

/// The type in an element such as `type`, `baseType` or `returnType`; `None` if it has no name.
fn kind(holder: Node<'_, '_>) -> Option<Type> {
    let mut node = holder.children().find(Node::is_element)?;
    let mut arrays = 0;
    // A type within more arrays than this has no use.
    while arrays < 20 {
        match node.tag_name().name() {
            "array" => {
                arrays += 1;
                node = child(node, "baseType")?.children().find(Node::is_element)?;
            }
            "subrangeSigned" | "subrangeUnsigned" => {
                node = child(node, "baseType")?.children().find(Node::is_element)?;
            }
            _ => break,
        }
    }
    let name = match node.tag_name().name() {
        "derived" => node.attribute("name")?,
        "pointer" | "struct" | "enum" | "array" => return None,
        elementary => elementary,
    };
    let inner = Type::named(name);
    Some((0..arrays).fold(inner, |inner, _| Type::Array(Box::new(inner))))
}
