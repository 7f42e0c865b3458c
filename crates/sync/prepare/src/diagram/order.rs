//! The order in which the elements of a diagram are evaluated.

use std::collections::HashMap;

use super::elements::{Diagram, Kind};

/// Elements nearer to each other than this are in one row.
const ROW: i64 = 10;

/// Elements that are connected with each other; the whole diagram if it has neither jumps nor returns.
#[derive(Debug)]
pub(crate) struct Network {
    /// The elements that are not evaluated for others, in their order.
    pub(crate) roots: Vec<usize>,
    /// The label before the network: an element.
    pub(crate) label: Option<usize>,
}

/// The networks of a diagram, from top to bottom.
pub(crate) fn networks(diagram: &Diagram) -> Vec<Network> {
    let all: Vec<usize> = (0..diagram.elements.len()).collect();
    let has_jumps = (diagram.elements.iter()).any(|element| {
        matches!(
            element.kind,
            Kind::Jump { .. } | Kind::Label { .. } | Kind::Return { .. }
        )
    });
    if !has_jumps {
        let roots = roots(diagram, &all);
        return vec![Network { roots, label: None }];
    }
    let mut parts = connected(diagram);
    // The label of a network is above it.
    parts.sort_by_key(|part| part.iter().map(|at| top(diagram, *at)).min());
    parts
        .into_iter()
        .map(|part| Network {
            label: (part.iter().copied())
                .find(|at| matches!(diagram.elements[*at].kind, Kind::Label { .. })),
            roots: roots(diagram, &part),
        })
        .collect()
}

fn top(diagram: &Diagram, at: usize) -> (i64, usize) {
    (diagram.elements[at].position.1, at)
}

/// The elements of each connected part.
fn connected(diagram: &Diagram) -> Vec<Vec<usize>> {
    let mut neighbours = vec![Vec::new(); diagram.elements.len()];
    let mut join = |one: usize, other: usize| {
        neighbours[one].push(other);
        neighbours[other].push(one);
    };
    let mut connectors: HashMap<String, usize> = HashMap::new();
    for (at, element) in diagram.elements.iter().enumerate() {
        for wire in element.kind.inputs().iter().flat_map(|pin| &pin.wires) {
            let from = diagram.by_id[&wire.id];
            // One rail may be drawn along all networks.
            if !matches!(diagram.elements[from].kind, Kind::Rail) {
                join(at, from);
            }
        }
        if let Kind::Connector { name, .. } | Kind::Continuation { name } = &element.kind {
            join(at, *connectors.entry(name.to_uppercase()).or_insert(at));
        }
    }
    let mut parts = Vec::new();
    let mut is_seen = vec![false; diagram.elements.len()];
    for start in 0..diagram.elements.len() {
        if is_seen[start] || matches!(diagram.elements[start].kind, Kind::Rail) {
            continue;
        }
        is_seen[start] = true;
        let mut part = vec![start];
        let mut next = 0;
        while let Some(at) = part.get(next).copied() {
            next += 1;
            for other in &neighbours[at] {
                if !std::mem::replace(&mut is_seen[*other], true) {
                    part.push(*other);
                }
            }
        }
        part.sort_unstable();
        parts.push(part);
    }
    parts
}

/// The elements that cause an evaluation, in their order.
fn roots(diagram: &Diagram, part: &[usize]) -> Vec<usize> {
    let of = |wanted: fn(&Kind) -> bool, is_ordered: bool| {
        let found = part.iter().copied().filter(move |at| {
            let element = &diagram.elements[*at];
            wanted(&element.kind) && (has_order(&element.kind) && element.order > 0) == is_ordered
        });
        found.collect::<Vec<usize>>()
    };
    let mut ordered = of(|_| true, true);
    ordered.sort_by_key(|at| diagram.elements[*at].order);
    let is_output = |kind: &Kind| {
        matches!(
            kind,
            Kind::Output { .. } | Kind::InOut { .. } | Kind::Coil { .. } | Kind::Return { .. }
        )
    };
    let outputs = in_rows(diagram, of(is_output, false));
    let blocks = in_rows(
        diagram,
        of(|kind| matches!(kind, Kind::Block { .. }), false),
    );
    let jumps = in_rows(diagram, of(|kind| matches!(kind, Kind::Jump { .. }), false));
    [ordered, outputs, blocks, jumps].concat()
}

/// Editors write an order for all elements, and mean it for these.
fn has_order(kind: &Kind) -> bool {
    matches!(
        kind,
        Kind::Output { .. } | Kind::InOut { .. } | Kind::Block { .. }
    )
}

/// From top to bottom, and from left to right within a row.
fn in_rows(diagram: &Diagram, mut list: Vec<usize>) -> Vec<usize> {
    let position = |at: usize| diagram.elements[at].position;
    list.sort_by_key(|at| position(*at).1);
    let mut start = 0;
    while start < list.len() {
        let first = position(list[start]).1;
        let length = list[start..]
            .iter()
            .take_while(|at| position(**at).1 - first < ROW);
        let end = start + length.count();
        list[start..end].sort_by_key(|at| position(*at).0);
        start = end;
    }
    list
}
