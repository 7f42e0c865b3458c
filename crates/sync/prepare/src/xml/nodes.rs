//! Elements of a project in XML.

use std::ops::Range;

use roxmltree::Node;

use crate::plan::{Named, Plan};

/// Elements called `name` within a node, in any namespace: versions of `PLCopen` XML differ only in that.
pub(super) fn named<'a, 'i>(
    node: Node<'a, 'i>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'i>> + use<'a, 'i> {
    node.descendants()
        .filter(move |node| node.is_element() && node.tag_name().name() == name)
}

pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    let mut children = node.children().filter(Node::is_element);
    children.find(|child| child.tag_name().name() == name)
}

pub(super) fn variable_names<'a, 'i>(
    list: Node<'a, 'i>,
) -> impl Iterator<Item = String> + use<'a, 'i> {
    let names = named(list, "variable").filter_map(|node| node.attribute("name"));
    names.map(str::to_uppercase)
}

pub(super) fn named_attribute(node: Node<'_, '_>, name: &str) -> Option<Named> {
    let attribute = node.attribute_node(name)?;
    let text = attribute.value().to_owned();
    let at = attribute.range_value().start;
    (!text.is_empty()).then_some(Named { text, at })
}

/// The signal of the task that runs a unit.
pub(super) fn signal<'p>(unit: Node<'_, '_>, plan: &'p Plan) -> Option<&'p String> {
    let name = unit.attribute("name").unwrap_or_default();
    let is_program = unit.attribute("pouType") == Some("program");
    let found = plan.programs.get(&name.to_uppercase());
    found.filter(|_| is_program)
}

/// The program of an instance. CODESYS leaves its type empty: there a program is its own instance.
pub(super) fn program(instance: Node<'_, '_>) -> Named {
    let named = named_attribute(instance, "typeName").or_else(|| named_attribute(instance, "name"));
    named.unwrap_or_else(|| Named {
        text: String::new(),
        at: instance.range().start,
    })
}

/// The bytes between the tags of an element; `None` if it has only one tag.
pub(super) fn inner(text: &str, node: Node<'_, '_>) -> Option<Range<usize>> {
    let whole = node.range();
    let start = first_tag(text, node).end;
    let end = whole.start + text[whole.clone()].rfind("</")?;
    (start <= end && text.as_bytes()[start - 2] != b'/').then_some(start..end)
}

/// The bytes of the first tag of an element.
pub(super) fn first_tag(text: &str, node: Node<'_, '_>) -> Range<usize> {
    let whole = node.range();
    whole.start..whole.start + tag_length(&text[whole])
}

/// The length of the tag at the start of a text.
fn tag_length(text: &str) -> usize {
    let mut quote = None;
    let end = text.bytes().position(|byte| {
        match (quote, byte) {
            (None, b'"' | b'\'') => quote = Some(byte),
            (Some(open), byte) if open == byte => quote = None,
            (None, b'>') => return true,
            _ => {}
        }
        false
    });
    end.map_or(text.len(), |end| end + 1)
}
