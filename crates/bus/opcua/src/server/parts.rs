//! Finds the elements and members of the maker's variables that are signals.

use std::collections::{BTreeMap, HashMap};

use opcua::types::{NodeId, VariantScalarTypeId};
use tickbus_base::Mistake;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::SignalTable;

use super::content::{Content, Shape};
use super::nodeset::{Target, Types};
use super::standard;
use super::whole::{Member, Wholes};
use crate::{Step, member, values};

/// A signal whose line names a part of a variable.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) signal: usize,
    /// The offset of the line in the driver.cfg.
    pub(super) at: usize,
    steps: Vec<Step>,
}

/// The node that a line names, and its part of that node's value, if the line names one: `written` are the steps behind
/// a number. A text can have steps, too, and is a node first.
pub(super) fn split(
    node: &NodeId,
    written: &str,
    is_node: impl Fn(&NodeId) -> bool,
) -> Option<(NodeId, Vec<Step>)> {
    if !written.is_empty() {
        return Some((node.clone(), member::steps(written)?));
    }
    let opcua::types::Identifier::String(text) = &node.identifier else {
        return None;
    };
    if is_node(node) {
        return None;
    }
    let text = text.as_ref();
    member::begins(text).find_map(|at| {
        let whole = NodeId::new(node.namespace, &text[..at]);
        let steps = member::steps(&text[at..])?;
        is_node(&whole).then_some((whole, steps))
    })
}

/// The lines that name parts of variables, by variable.
#[derive(Debug, Default)]
pub(super) struct Parts(BTreeMap<String, (NodeId, Vec<Part>)>);

impl Parts {
    pub(super) fn add(&mut self, node: NodeId, (signal, at): (usize, usize), steps: Vec<Step>) {
        let entry = self.0.entry(node.to_string());
        let (_, parts) = entry.or_insert_with(|| (node, Vec::new()));
        parts.push(Part { signal, at, steps });
    }

    /// Finds all parts in the variables of the files, which are taken out of `found`. Mistakes have the offsets of their
    /// lines.
    pub(super) fn resolve(
        self,
        table: &SignalTable,
        found: &mut HashMap<NodeId, Target>,
        types: &mut Types,
        mistakes: &mut Vec<(usize, Mistake)>,
    ) -> Wholes {
        if self.0.is_empty() {
            return Wholes::default();
        }
        standard::each(|item| types.take(item));
        let mut tree = types.tree();
        let mut wholes = Vec::new();
        for (node, parts) in self.0.into_values() {
            let target = found.remove(&node);
            match whole(table, target, types, &mut tree, &parts) {
                Ok(whole) => wholes.push(whole),
                Err(mistake) => mistakes.push(mistake),
            }
        }
        let mut made = Wholes::new(tree);
        for (members, content) in wholes {
            made.add(members, content);
        }
        made
    }
}

/// One variable and the signals in it.
fn whole(
    table: &SignalTable,
    target: Option<Target>,
    types: &Types,
    tree: &mut opcua::types::custom::DataTypeTree,
    parts: &[Part],
) -> Result<(Vec<Member>, Content), (usize, Mistake)> {
    let first = parts.first().expect("a line made it");
    let wrong = |at: usize, what: String, right: &str| (at, Mistake::new(what, right.to_owned()));
    let no_variable =
        "name a variable of the file; \"nsu=…\" spells its namespace as the file does";
    let (data_type, rank, sizes, length) = match target {
        Some(Target::Variable(data_type)) => (data_type, -1, Vec::new(), 0),
        Some(Target::List(list)) => (list.data_type, list.rank, list.sizes, list.length),
        Some(_) => {
            let what = "the node is not a variable, and has no elements or members";
            return Err(wrong(first.at, what.to_owned(), no_variable));
        }
        None => {
            let what = "no file of \"nodeset\" has that node, or another line is all of it";
            return Err(wrong(first.at, what.to_owned(), no_variable));
        }
    };
    let cannot = |why: String| {
        wrong(
            first.at,
            format!("no part of the variable can be a signal: {why}"),
            "name another variable, or the file that defines the type",
        )
    };
    let is_stated = sizes.iter().any(|size| *size > 0);
    let sizes = if is_stated { sizes } else { vec![length] };
    let builtin = tree.parent_ids().get_builtin_type(&data_type);
    if builtin == Some(VariantScalarTypeId::ExtensionObject) {
        let added = types.add_structure(tree, &data_type, &mut Vec::new());
        added.map_err(cannot)?;
    }
    let shape = Shape {
        data_type: &data_type,
        rank,
        dimensions: Some(&sizes),
    };
    let mut content = Content::empty(&shape, tree).map_err(cannot)?;
    let mut members: Vec<Member> = Vec::new();
    for part in parts {
        let signal = &table.signals[part.signal];
        let name = shown(&signal.name);
        let at = content.find(&part.steps, is_stated).map_err(|why| {
            let what = format!("the variable has no such part for the signal \"{name}\": {why}");
            wrong(part.at, what, "name a single value in the variable")
        })?;
        let of_type = content.leaf(&at).scalar_type_id();
        if of_type != Some(values::scalar(signal.data_type)) {
            let of_type = of_type.map_or_else(|| "unknown".to_owned(), |id| id.to_string());
            return Err(wrong(
                part.at,
                format!(
                    "that part of the variable is of type {of_type}, and the signal \"{name}\" of type {}",
                    signal.data_type
                ),
                "correct \"type\" of the signal, or name another part",
            ));
        }
        if let Some(other) = members.iter().find(|member| member.at == at) {
            let other = shown(&table.signals[other.signal].name);
            return Err(wrong(
                part.at,
                format!("\"{other}\" is that part of the variable, too"),
                "give each signal a part of its own",
            ));
        }
        if signal.area != table.signals[first.signal].area {
            let other = shown(&table.signals[first.signal].name);
            return Err(wrong(
                part.at,
                format!(
                    "clients write a variable or read it: \"{name}\" and \"{other}\" go in different directions"
                ),
                "name parts of two variables, or correct the addresses",
            ));
        }
        members.push(Member {
            signal: part.signal,
            at,
        });
    }
    let places: Vec<&[usize]> = members.iter().map(|member| &member.at[..]).collect();
    content.close(&places).map_err(cannot)?;
    Ok((members, content))
}
