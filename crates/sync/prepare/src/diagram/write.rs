//! Writes a diagram as statements of Structured Text.

mod call;
mod expression;

use std::collections::{HashMap, HashSet};
use std::fmt::Write as _;

use super::elements::{Diagram, Element, Kind, Modifier, Pin, Wire};
use super::infer::{Types, infer};
use super::order::{Network, networks};
use super::signature::{Library, Type};
use expression::Expression;
use tickbus_base::toml_text::{Collector, shown};

/// Elements in a row, one behind the other: longer rows are refused.
const DEPTH: usize = 200;

/// Evaluated elements of one unit, with repetitions: a ladder with more ways than this is refused.
const WORK: usize = 200_000;

/// The wires behind a contact, sorted: their elements and parameters.
type Key<'d> = Vec<(u64, &'d str)>;

/// The unit around a diagram.
pub(crate) struct Unit<'u> {
    pub(crate) name: &'u str,
    /// The variables of the unit, by their names in capitals.
    pub(crate) variables: &'u HashMap<String, Type>,
    pub(crate) library: &'u Library,
}

/// A diagram as Structured Text.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Written {
    /// Statements, one in a line.
    pub(crate) statements: String,
    /// Variables to add to the unit: their names and types.
    pub(crate) variables: Vec<(String, String)>,
}

/// Writes a diagram; `None` if mistakes were reported.
pub(crate) fn write(diagram: &Diagram, unit: &Unit<'_>, wrong: &Collector<'_>) -> Option<Written> {
    let mut writer = Writer {
        diagram,
        unit,
        wrong,
        types: infer(diagram, unit.variables, unit.library),
        made: Written::default(),
        indent: 1,
        done: HashSet::new(),
        running: Vec::new(),
        connectors: HashMap::new(),
        work: 0,
    };
    writer.networks(&networks(diagram))?;
    Some(writer.made)
}

/// The value at a pin; `None` if nothing leads to it.
struct Value(Option<Expression>);

struct Writer<'w> {
    diagram: &'w Diagram,
    unit: &'w Unit<'w>,
    wrong: &'w Collector<'w>,
    types: Types,
    made: Written,
    indent: usize,
    /// The blocks that were called.
    done: HashSet<usize>,
    /// The elements whose inputs are being evaluated.
    running: Vec<usize>,
    /// The values of connectors that were evaluated, by name in capitals.
    connectors: HashMap<String, Expression>,
    work: usize,
}

impl<'w> Writer<'w> {
    fn refuse<T>(&self, element: &Element, at: usize, what: &str, right: &str) -> Option<T> {
        let unit = shown(self.unit.name);
        let what = format!("{unit}, element {}: {what}", element.id);
        self.wrong.report(at, what, right);
        None
    }

    fn line(&mut self, text: &str) {
        let indent = self.indent * 2;
        let _ = writeln!(self.made.statements, "{:indent$}{text}", "");
    }

    fn variable(&mut self, name: &str, kind: &str) {
        if !self.made.variables.iter().any(|(one, _)| one == name) {
            self.made.variables.push((name.to_owned(), kind.to_owned()));
        }
    }

    /// Writes all networks; a jump skips those before its label.
    fn networks(&mut self, networks: &[Network]) -> Option<()> {
        let mut labels: HashMap<String, usize> = HashMap::new();
        for (index, network) in networks.iter().enumerate() {
            let Some(at) = network.label else { continue };
            let element = &self.diagram.elements[at];
            if let Kind::Label { name } = &element.kind
                && labels.insert(name.to_uppercase(), index).is_some()
            {
                let what = format!("there is a second label {}", shown(name));
                return self.refuse(element, element.at, &what, "give it another name");
            }
        }
        // The jumps and the networks that they skip.
        let mut jumps = Vec::new();
        for (index, network) in networks.iter().enumerate() {
            for at in &network.roots {
                let element = &self.diagram.elements[*at];
                let Kind::Jump { label, .. } = &element.kind else {
                    continue;
                };
                let Some(target) = labels.get(&label.to_uppercase()) else {
                    let what = format!("there is no label {}", shown(label));
                    return self.refuse(element, element.at, &what, "draw it above a network");
                };
                if *target <= index {
                    let what = format!("this jumps back to {}", shown(label));
                    let right = "write the loop in Structured Text";
                    return self.refuse(element, element.at, &what, right);
                }
                jumps.push((*at, index + 1..*target));
            }
        }
        for (at, _) in &jumps {
            let name = jump_name(&self.diagram.elements[*at]);
            self.variable(&name, "BOOL");
            self.line(&format!("{name} := FALSE;"));
        }
        for (index, network) in networks.iter().enumerate() {
            let skips = jumps.iter().filter(|(_, skipped)| skipped.contains(&index));
            let skips: Vec<String> = skips
                .map(|(at, _)| jump_name(&self.diagram.elements[*at]))
                .collect();
            let is_skipped = !skips.is_empty() && !network.roots.is_empty();
            if is_skipped {
                self.line(&format!("IF NOT ({}) THEN", skips.join(" OR ")));
                self.indent += 1;
            }
            let before = self.made.statements.len();
            for at in &network.roots {
                self.root(*at)?;
            }
            if is_skipped {
                if self.made.statements.len() == before {
                    self.line(";");
                }
                self.indent -= 1;
                self.line("END_IF;");
            }
        }
        Some(())
    }

    /// Writes an element that is not evaluated for others.
    fn root(&mut self, at: usize) -> Option<()> {
        let element = &self.diagram.elements[at];
        match &element.kind {
            Kind::Coil { variable, input } => {
                let Some(value) = self.pin(at, input, false)?.0 else {
                    return Some(());
                };
                self.assign(element, variable, input.modifier, value, None)
            }
            Kind::Output { expression, input }
            | Kind::InOut {
                expression, input, ..
            } => {
                let enable = self.enable_output(input);
                let Some(value) = self.pin(at, input, false)?.0 else {
                    return Some(());
                };
                self.assign(element, expression, input.modifier, value, enable)
            }
            Kind::Return { input } => {
                let value = self.pin(at, input, false)?.0;
                let value = self.modified(
                    element,
                    input.modifier,
                    value.unwrap_or_else(Expression::on),
                )?;
                self.line(&format!("IF {} THEN RETURN; END_IF;", value.text));
                Some(())
            }
            Kind::Jump { input, .. } => {
                let value = self.pin(at, input, false)?.0;
                let value = self.modified(
                    element,
                    input.modifier,
                    value.unwrap_or_else(Expression::on),
                )?;
                self.line(&format!("{} := {};", jump_name(element), value.text));
                Some(())
            }
            Kind::Block { .. } => self.call(at, false),
            _ => Some(()),
        }
    }

    fn assign(
        &mut self,
        element: &Element,
        variable: &str,
        modifier: Modifier,
        value: Expression,
        enable: Option<String>,
    ) -> Option<()> {
        let stored = match modifier {
            Modifier::Set => Some("TRUE"),
            Modifier::Reset => Some("FALSE"),
            _ => None,
        };
        let statement = if let Some(stored) = stored {
            format!("IF {} THEN {variable} := {stored}; END_IF;", value.text)
        } else {
            let value = self.modified(element, modifier, value)?;
            format!("{variable} := {};", value.text)
        };
        match enable {
            Some(enable) => self.line(&format!("IF {enable} THEN {statement} END_IF;")),
            None => self.line(&statement),
        }
        Some(())
    }

    /// The ENO of the block that an output shows, if that block has a wire at EN: without it the output stays.
    fn enable_output(&self, input: &Pin) -> Option<String> {
        let [wire] = input.wires.as_slice() else {
            return None;
        };
        let block = &self.diagram.elements[self.diagram.by_id[&wire.id]];
        let Kind::Block {
            instance, inputs, ..
        } = &block.kind
        else {
            return None;
        };
        let is_enabled = |pin: &Pin| pin.name.eq_ignore_ascii_case("EN") && pin.is_connected();
        inputs.iter().any(is_enabled).then(|| match instance {
            Some(instance) => format!("{instance}.ENO"),
            None => wire_name(block, "ENO"),
        })
    }

    fn modified(
        &mut self,
        element: &Element,
        modifier: Modifier,
        value: Expression,
    ) -> Option<Expression> {
        let trigger = match modifier {
            Modifier::Plain => return Some(value),
            Modifier::Negated => return Some(value.negated()),
            Modifier::Rising => "R_TRIG",
            Modifier::Falling => "F_TRIG",
            Modifier::Set | Modifier::Reset => {
                let what = "only a coil or an output can set or reset";
                return self.refuse(element, element.at, what, "add a coil");
            }
        };
        let edges = self.made.variables.iter();
        let number = edges.filter(|(_, kind)| kind.ends_with("_TRIG")).count() + 1;
        let name = format!("tickbus_edge_{number}");
        self.variable(&name, trigger);
        self.line(&format!("{name}(CLK := {});", value.text));
        Some(Expression::primary(format!("{name}.Q")))
    }

    /// The value at a pin of an element: that of its wires, joined by OR.
    fn pin(&mut self, at: usize, pin: &Pin, ordered: bool) -> Option<Value> {
        let element = &self.diagram.elements[at];
        if let Some(text) = &pin.expression {
            return Some(Value(Some(Expression::of_text(text))));
        }
        if pin.wires.is_empty() {
            return Some(Value(None));
        }
        if pin.wires.len() > 1 {
            let inputs = element.kind.inputs();
            let number = inputs.iter().position(|one| std::ptr::eq(one, pin));
            let kind = number.and_then(|number| self.types.input(at, number));
            if let Some(kind) = kind.filter(|kind| !kind.is("BOOL")) {
                let kind = kind.name().unwrap_or("ARRAY");
                let what = format!("{} wires lead to one {kind}", pin.wires.len());
                let right = "keep one: only wires of the type BOOL are joined";
                return self.refuse(element, pin.at, &what, right);
            }
        }
        self.running.push(at);
        let value = self.any(&pin.wires, ordered);
        self.running.pop();
        value.map(|value| Value(Some(value)))
    }

    /// The values of these wires, joined by OR. Parallel contacts behind the same wires share them.
    fn any(&mut self, wires: &[Wire], ordered: bool) -> Option<Expression> {
        let mut groups: Vec<(Option<Key<'_>>, Vec<&Wire>)> = Vec::new();
        for wire in wires {
            let from = &self.diagram.elements[self.diagram.by_id[&wire.id]];
            let key = match &from.kind {
                Kind::Contact { input, .. } if input.expression.is_none() => {
                    let mut key: Key<'_> = (input.wires.iter())
                        .map(|wire| (wire.id, wire.parameter.as_str()))
                        .collect();
                    key.sort_unstable();
                    Some(key)
                }
                _ => None,
            };
            let same = groups
                .iter_mut()
                .find(|(one, _)| key.is_some() && *one == key);
            match same {
                Some((_, group)) => group.push(wire),
                None => groups.push((key, vec![wire])),
            }
        }
        let mut found: Option<Expression> = None;
        for (_, group) in groups {
            let value = if let [wire] = group.as_slice() {
                self.wire(wire, ordered)?
            } else {
                let mut heads: Option<Expression> = None;
                for wire in &group {
                    let from = &self.diagram.elements[self.diagram.by_id[&wire.id]];
                    let head = self.contact(from)?;
                    heads = Some(heads.map_or(head.clone(), |heads| heads.or(head)));
                }
                let first = self.diagram.by_id[&group[0].id];
                let tail = self.behind_contact(first, ordered)?;
                heads?.and(tail)
            };
            found = Some(match found {
                Some(before) => before.or(value),
                None => value,
            });
        }
        found
    }

    /// The value of a contact's variable.
    fn contact(&mut self, element: &'w Element) -> Option<Expression> {
        let Kind::Contact { variable, input } = &element.kind else {
            return None;
        };
        self.modified(element, input.modifier, Expression::of_text(variable))
    }

    /// The value that reaches a contact.
    fn behind_contact(&mut self, at: usize, ordered: bool) -> Option<Expression> {
        let element = &self.diagram.elements[at];
        let Kind::Contact { input, .. } = &element.kind else {
            return None;
        };
        self.check_loop(at)?;
        if let Some(value) = self.pin(at, input, ordered)?.0 {
            Some(value)
        } else {
            let right = "draw a wire to it, from the power rail for example";
            self.refuse(element, element.at, "nothing leads to this contact", right)
        }
    }

    /// The value of one wire.
    fn wire(&mut self, wire: &Wire, ordered: bool) -> Option<Expression> {
        let at = self.diagram.by_id[&wire.id];
        let element = &self.diagram.elements[at];
        self.work += 1;
        if self.work > WORK {
            let right = "split this unit: store a part of its ladder in a variable";
            return self.refuse(element, element.at, "the diagram has too many ways", right);
        }
        if self.running.len() > DEPTH {
            let what = format!("more than {DEPTH} elements are in a row");
            let right = "store a part of it in a variable";
            return self.refuse(element, element.at, &what, right);
        }
        match &element.kind {
            Kind::Rail => Some(Expression::on()),
            Kind::Input {
                expression,
                is_negated,
            }
            | Kind::InOut {
                expression,
                is_negated,
                ..
            } => {
                let value = Expression::of_text(expression);
                Some(if *is_negated { value.negated() } else { value })
            }
            Kind::Contact { .. } => {
                let head = self.contact(element)?;
                let tail = self.behind_contact(at, ordered)?;
                Some(head.and(tail))
            }
            Kind::Coil { input, .. } => {
                self.check_loop(at)?;
                if let Some(value) = self.pin(at, input, false)?.0 {
                    Some(value)
                } else {
                    let right = "draw a wire to it, from the power rail for example";
                    self.refuse(element, element.at, "nothing leads to this coil", right)
                }
            }
            Kind::Continuation { name } => self.continued(element, name, ordered),
            Kind::Block { .. } => {
                self.call(at, ordered)?;
                self.output(at, wire)
            }
            _ => None,
        }
    }

    fn continued(&mut self, element: &Element, name: &str, ordered: bool) -> Option<Expression> {
        let key = name.to_uppercase();
        if let Some(known) = self.connectors.get(&key) {
            // Each connector can double the text of the one before: its length is work, too.
            self.work += known.text.len() / 16;
            return Some(known.clone());
        }
        let all = self.diagram.elements.iter().enumerate();
        let mut found = all.filter(|(_, one)| match &one.kind {
            Kind::Connector { name, .. } => name.to_uppercase() == key,
            _ => false,
        });
        let Some((at, connector)) = found.next() else {
            let what = format!("there is no connector {}", shown(name));
            return self.refuse(element, element.at, &what, "draw it, or name another one");
        };
        if let Some((_, second)) = found.next() {
            let what = format!("there is a second connector {}", shown(name));
            return self.refuse(second, second.at, &what, "give it another name");
        }
        self.check_loop(at)?;
        let Some(value) = self.pin(at, &connector.kind.inputs()[0], ordered)?.0 else {
            let what = format!("nothing leads to the connector {}", shown(name));
            return self.refuse(connector, connector.at, &what, "draw a wire to it");
        };
        self.connectors.insert(key, value.clone());
        Some(value)
    }

    /// Refuses a loop without a function block: the value of the last scan would be nowhere.
    fn check_loop(&self, at: usize) -> Option<()> {
        let Some(start) = self.running.iter().position(|one| *one == at) else {
            return Some(());
        };
        let is_block = |at: &usize| {
            let kind = &self.diagram.elements[*at].kind;
            matches!(
                kind,
                Kind::Block {
                    instance: Some(_),
                    ..
                }
            )
        };
        if self.running[start..].iter().any(is_block) {
            return Some(());
        }
        let element = &self.diagram.elements[at];
        let what = "this element is in a loop without a function block or a variable";
        let right = "store the value in a variable, and begin with that variable";
        self.refuse(element, element.at, what, right)
    }
}

/// The variable for an output of a function.
fn wire_name(block: &Element, pin: &str) -> String {
    if pin.is_empty() {
        format!("tickbus_wire_{}", block.id)
    } else {
        format!("tickbus_wire_{}_{}", block.id, pin.trim_matches('_'))
    }
}

/// The variable that is on while a jump skips networks.
fn jump_name(jump: &Element) -> String {
    format!("tickbus_jump_{}", jump.id)
}
