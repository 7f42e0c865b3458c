//! The lines of `[fieldbus.at]` at a server: the nodes have the ids of a real device.

use std::collections::{BTreeMap, HashMap};

use tickbus_base::toml_text::{Collector, shown};
use tickbus_fieldbus::At;
use tickbus_image::signal::SignalTable;

use super::namespaces::{FIRST, LAST, UA};
use super::{Identifier, Namespace, Node, NodeName, ServerOptions, member};

/// The URI of the nodes that tickbus itself adds.
pub(crate) const OWN: &str = "urn:tickbus:signals";

/// The nodes of a server.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct DeviceNodes {
    /// The URIs of the namespaces from number 2 on; the last one is [`OWN`].
    pub(crate) uris: Vec<String>,
    /// The nodes of signals, by the signals' names.
    pub(crate) nodes: BTreeMap<String, (u16, Identifier)>,
}

impl ServerOptions {
    /// Takes the lines, which are node ids, and reports invalid ones and two signals with the same node.
    pub fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        let mut placed = Vec::new();
        for line in lines {
            let (node, member) = member::split(line.text);
            let node: NodeName = match node.parse() {
                Ok(node) => node,
                Err(mistake) => {
                    line.refuse(mistake);
                    continue;
                }
            };
            let is_reserved = match &node.namespace {
                Namespace::Index(index) => *index < FIRST,
                Namespace::Uri(uri) => self.is_taken(uri),
            };
            match &node.namespace {
                _ if is_reserved => line.wrong(
                    "namespaces 0 and 1 are those of OPC UA and of the server itself",
                    "write the namespace of the device, from ns=2 on, or by its URI",
                ),
                Namespace::Index(index) if *index > LAST => line.wrong(
                    format!(
                        "namespace {index} is beyond {LAST}, the last one of a server of tickbus"
                    ),
                    "write the namespace by its URI: \"nsu=http://example.com/plc;i=6001\"",
                ),
                _ if !member.is_empty() && member::steps(member).is_none() => line.wrong(
                    format!("\"{}\" names no part of a value", shown(member)),
                    "write elements as [0] and members as .name: \"ns=2;i=6001[0].position\"",
                ),
                _ if !member.is_empty() && self.nodesets.is_empty() => line.wrong(
                    format!("\"{}\" is a part of a value, and nothing says what that value is", shown(member)),
                    "name the files that have the variable in \"nodeset\", or write a node without it",
                ),
                _ => {
                    let name = &table.signals[line.signal].name;
                    let node = Node {
                        name: node,
                        member: member.to_owned(),
                        at: line.at(),
                    };
                    self.nodes.insert(name.clone(), node);
                    placed.push((name, line));
                }
            }
        }
        let device = self.device_nodes(&[]);
        let mut taken = HashMap::new();
        for (name, line) in &placed {
            let Some(node) = device.nodes.get(*name) else {
                continue;
            };
            let key = (node, &*self.nodes[*name].member);
            if let Some((other, of)) = taken.insert(key, (*name, *line)) {
                for (line, name) in [(*line, other), (of, *name)] {
                    line.wrong(
                        format!("\"{}\" is that node, too", shown(name)),
                        "give each signal a node of its own",
                    );
                }
            }
        }
    }

    /// Reports signals without a line beside some that have one, and keys without effect.
    pub fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        if let Some(uri) = self
            .identity
            .uri
            .as_deref()
            .filter(|uri| [UA, OWN].contains(uri))
        {
            collector.report(
                self.at,
                format!("the \"uri\" of \"identity\" is \"{uri}\", which is another namespace"),
                "write the ApplicationUri of the device, such as \"urn:acme:press:1\"",
            );
        }
        let own = self.namespaces.iter().find(|uri| self.is_taken(uri));
        if let (Some(at), Some(uri)) = (self.namespaces_at, own) {
            collector.report(
                at,
                format!("\"{}\" is namespace 1, by \"identity\"", shown(uri)),
                "begin with the URI that the device has as number 2",
            );
        }
        if self.nodes.is_empty() {
            if let (Some(at), true) = (self.namespaces_at, self.nodesets.is_empty()) {
                collector.report(
                    at,
                    "\"namespaces\" stands without [fieldbus.at]",
                    "remove it: the signals are in the namespace urn:tickbus:signals",
                );
            }
            return;
        }
        let missing = table.signals.iter();
        let missing = missing.filter(|signal| !self.nodes.contains_key(&signal.name));
        let missing: Vec<&str> = missing.map(|signal| signal.name.as_str()).collect();
        if let [first, rest @ ..] = &missing[..] {
            let others = match rest.len() {
                0 => String::new(),
                count => format!(" (and {count} more)"),
            };
            collector.report(
                self.at,
                format!(
                    "no line of [fieldbus.at] places \"{}\"{others}, and a server with such lines has nothing else",
                    shown(first)
                ),
                "write a line for each signal, or none at all",
            );
        }
    }

    /// Returns true for a URI that the server has in any case: that of OPC UA, its own ones, and that of `identity`.
    pub(crate) fn is_taken(&self, uri: &str) -> bool {
        let stated = self.identity.uri.as_deref();
        uri == UA || uri.starts_with("urn:tickbus:") || stated == Some(uri)
    }

    /// The nodes of the server that `[fieldbus.at]` names, and its namespaces: those of the key, of `NodeSet2` files and of
    /// lines, and its [own](OWN).
    pub(crate) fn device_nodes(&self, of_files: &[String]) -> DeviceNodes {
        let mut uris = self.namespaces.clone();
        let further = of_files.iter().filter(|uri| !self.namespaces.contains(uri));
        uris.extend(further.cloned());
        let indices = self
            .nodes
            .values()
            .filter_map(|node| match node.name.namespace {
                Namespace::Index(index) => Some(index),
                Namespace::Uri(_) => None,
            });
        // A device that is addressed by numbers has as many namespaces before.
        let last = indices.max().unwrap_or(FIRST - 1);
        while uris.len() < usize::from(last + 1 - FIRST) {
            uris.push(format!(
                "urn:tickbus:namespace:{}",
                usize::from(FIRST) + uris.len()
            ));
        }
        let mut nodes = BTreeMap::new();
        for (name, node) in &self.nodes {
            let index = match &node.name.namespace {
                Namespace::Index(index) => *index,
                Namespace::Uri(uri) => {
                    let known = uris.iter().position(|known| known == uri);
                    let at = known.unwrap_or(uris.len());
                    if known.is_none() {
                        uris.push(uri.clone());
                    }
                    // There are fewer signals than numbers.
                    u16::try_from(at).map_or(u16::MAX, |at| at.saturating_add(FIRST))
                }
            };
            nodes.insert(name.clone(), (index, node.name.identifier.clone()));
        }
        uris.push(OWN.to_owned());
        DeviceNodes { uris, nodes }
    }
}
