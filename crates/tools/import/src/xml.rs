//! Elements, texts and names in the XML of projects.

use std::collections::HashSet;

use roxmltree::Node;

use super::cells::{Cell, Record};

/// Elements called `name` in any namespace: versions of PLCopen XML differ only in that.
pub(super) fn named<'a, 'i>(
    node: Node<'a, 'i>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'i>> {
    node.descendants()
        .filter(move |node| node.is_element() && node.tag_name().name() == name)
}

pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children()
        .find(|child| child.is_element() && child.tag_name().name() == name)
}

/// The text within a node, as one line; of a long text only the beginning.
pub(super) fn words(node: Option<Node<'_, '_>>) -> String {
    const PIECES: usize = 1000;
    let pieces = node
        .into_iter()
        .flat_map(|node| node.descendants().take(PIECES));
    let pieces: Vec<&str> = pieces
        .filter(Node::is_text)
        .filter_map(|piece| piece.text())
        .flat_map(str::split_whitespace)
        .collect();
    pieces.join(" ")
}

/// The offset of an attribute's value, or otherwise of its element.
pub(super) fn place(node: Node<'_, '_>, attribute: &str) -> usize {
    let attribute = node.attribute_node(attribute);
    attribute.map_or(node.range().start, |attribute| {
        attribute.range_value().start
    })
}

pub(super) fn record(
    node: Node<'_, '_>,
    name: &str,
    address: (&str, usize),
    kind: (&str, usize),
    comment: &str,
) -> Record {
    let cell = |text: &str, at| Cell {
        text: text.split_whitespace().collect::<Vec<_>>().join(" "),
        at,
    };
    vec![
        cell(name, place(node, "name")),
        cell(address.0, address.1),
        cell(kind.0, kind.1),
        cell(comment, node.range().start),
    ]
}

/// A record with the folder that its variable is in.
pub(super) fn in_folder(mut record: Record, folder: Option<&str>) -> Record {
    let text = folder.unwrap_or_default().to_owned();
    let at = record[0].at;
    record.push(Cell { text, at });
    record
}

/// The attribute of the nearest of these `scopes` around a variable.
pub(super) fn scope<'a>(
    variable: Node<'a, '_>,
    scopes: &[&str],
    attribute: &str,
) -> Option<&'a str> {
    let mut around = variable.ancestors();
    let scope = around.find(|node| scopes.contains(&node.tag_name().name()))?;
    scope.attribute(attribute)
}

/// The names of variables so far.
#[derive(Default)]
pub(super) struct Names {
    given: HashSet<String>,
}

impl Names {
    /// The name for a variable; if it is taken, prefixed by the program or list that the variable is local to.
    pub(super) fn give(
        &mut self,
        variable: Node<'_, '_>,
        name: &str,
        scopes: &[&str],
        attribute: &str,
    ) -> String {
        let mut wanted = name.to_owned();
        if self.given.contains(name)
            && let Some(scope) = scope(variable, scopes, attribute)
        {
            wanted = format!("{scope}.{name}");
        }
        self.given.insert(wanted.clone());
        wanted
    }
}
