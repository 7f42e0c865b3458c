//! Calls of functions and function blocks, and the values that they leave.

use super::expression::{Expression, Level};
use super::{Writer, wire_name};
use crate::diagram::elements::{Element, Kind, Modifier, Pin, Wire};
use crate::diagram::infer::{is_result, origin};
use crate::diagram::signature::{Signature, Type};
use tickbus_base::toml_text::shown;

impl Writer<'_> {
    /// Calls a block, unless it ran in this scan.
    pub(super) fn call(&mut self, at: usize, ordered: bool) -> Option<()> {
        let element = &self.diagram.elements[at];
        let Kind::Block {
            name,
            instance,
            inputs,
            outputs,
        } = &element.kind
        else {
            return None;
        };
        if instance.is_none() {
            self.check_loop(at)?;
        }
        // A block with an order is called at its place.
        if ordered || !self.done.insert(at) {
            return Some(());
        }
        let signature = self.unit.library.signature(name);
        let is_function = instance.is_none();
        if let Some(signature) = &signature
            && signature.is_block == is_function
        {
            let (what, right) = if is_function {
                (
                    "is a function block, and has no instance here",
                    "give it a name",
                )
            } else {
                (
                    "is a function, and has an instance here",
                    "take the name out",
                )
            };
            return self.refuse(
                element,
                element.at,
                &format!("{} {what}", shown(name)),
                right,
            );
        }
        self.check_pins(element, signature.as_ref())?;
        let mut arguments = Vec::new();
        let mut has_value = false;
        for pin in inputs {
            let is_both = outputs
                .iter()
                .any(|one| !pin.name.is_empty() && one.name == pin.name);
            let value = self.pin(at, pin, element.order > 0)?;
            let value = match value.0 {
                None if is_both => {
                    let what = format!("nothing leads to {}, which the block changes", pin.name);
                    return self.refuse(
                        element,
                        pin.at,
                        &what,
                        "draw a wire from a variable to it",
                    );
                }
                None => continue,
                Some(_) if instance.is_some() && pin.name.is_empty() => {
                    let what = format!("an input of {} has no name", shown(name));
                    return self.refuse(element, pin.at, &what, "draw the block again");
                }
                Some(value) if is_both => self.changeable(element, pin, value)?,
                Some(value) => self.modified(element, pin.modifier, value)?,
            };
            has_value |= !pin.name.eq_ignore_ascii_case("EN");
            arguments.push((pin.name.as_str(), value.text));
        }
        match instance {
            Some(instance) => {
                let arguments: Vec<String> = (arguments.iter())
                    .map(|(name, value)| format!("{name} := {value}"))
                    .collect();
                self.line(&format!("{instance}({});", arguments.join(", ")));
                Some(())
            }
            None if !has_value
                && inputs
                    .iter()
                    .any(|pin| !pin.name.eq_ignore_ascii_case("EN")) =>
            {
                // Its outputs have no value; whoever reads one is refused.
                self.done.remove(&at);
                Some(())
            }
            None => self.call_function(at, signature.as_ref(), arguments),
        }
    }

    /// Refuses pins that a block of the project does not have.
    fn check_pins(&self, element: &Element, signature: Option<&Signature>) -> Option<()> {
        let Kind::Block {
            name,
            inputs,
            outputs,
            ..
        } = &element.kind
        else {
            return None;
        };
        let is_own = self.unit.library.units.contains_key(&name.to_uppercase());
        let Some(signature) = signature.filter(|_| is_own) else {
            return Some(());
        };
        let pins = inputs
            .iter()
            .map(|pin| (pin, true))
            .chain(outputs.iter().map(|pin| (pin, false)));
        for (pin, is_input) in pins {
            let is_result =
                !is_input && !signature.is_block && is_result(pin, name, self.unit.library);
            let is_enable =
                pin.name.eq_ignore_ascii_case("EN") || pin.name.eq_ignore_ascii_case("ENO");
            if !signature.has(&pin.name) && !is_result && !is_enable {
                let what = format!("{} has no parameter {}", shown(name), shown(&pin.name));
                let right = "draw the block again, as it is declared";
                return self.refuse(element, pin.at, &what, right);
            }
        }
        Some(())
    }

    fn call_function(
        &mut self,
        at: usize,
        signature: Option<&Signature>,
        mut arguments: Vec<(&str, String)>,
    ) -> Option<()> {
        let element = &self.diagram.elements[at];
        let Kind::Block {
            name,
            inputs,
            outputs,
            ..
        } = &element.kind
        else {
            return None;
        };
        let enabled = arguments
            .iter()
            .any(|(name, _)| name.eq_ignore_ascii_case("EN"));
        let mut result = None;
        let mut others = Vec::new();
        for (number, pin) in outputs.iter().enumerate() {
            if inputs
                .iter()
                .any(|one| !pin.name.is_empty() && one.name == pin.name)
            {
                continue;
            }
            let is_eno = pin.name.eq_ignore_ascii_case("ENO");
            if !is_eno && is_result(pin, name, self.unit.library) {
                if let Some(kind) = self.types.output(at, number) {
                    let kind = kind.name().map(str::to_owned);
                    let Some(kind) = kind else {
                        let what = "the result is an array";
                        return self.refuse(element, pin.at, what, "give its type a name");
                    };
                    result = Some((wire_name(element, ""), kind));
                } else if self.is_read(element.id, &pin.name) {
                    let what = format!("the type of the result of {} is unknown", shown(name));
                    let right = "write the type before a number, as in INT#5, or use a variable";
                    return self.refuse(element, pin.at, &what, right);
                }
                continue;
            }
            let kind = if is_eno {
                Some("BOOL".to_owned())
            } else {
                let kind = self.types.output(at, number);
                kind.and_then(Type::name).map(str::to_owned)
            };
            let Some(kind) = kind else {
                let what = format!("the type of {} is unknown", shown(&pin.name));
                return self.refuse(
                    element,
                    pin.at,
                    &what,
                    "declare it with a type that has a name",
                );
            };
            others.push((pin.name.as_str(), kind));
        }
        if enabled
            && !others
                .iter()
                .any(|(name, _)| name.eq_ignore_ascii_case("ENO"))
        {
            others.push(("ENO", "BOOL".to_owned()));
        }
        let values = inputs
            .iter()
            .filter(|pin| !pin.name.eq_ignore_ascii_case("EN"));
        let is_full = !enabled && others.is_empty() && values.count() == arguments.len();
        // Editors draw all pins of a function; in the order of its declaration they need no names.
        if let Some(signature) = signature.filter(|_| is_full) {
            let order: Vec<&String> = (signature.inputs.iter().chain(&signature.in_outs))
                .map(|(name, _)| name)
                .collect();
            let place = |name: &str| order.iter().position(|one| one.eq_ignore_ascii_case(name));
            if arguments.len() == order.len() {
                arguments.sort_by_key(|(name, _)| place(name));
            }
        }
        let is_whole =
            signature.is_none_or(|one| one.inputs.len() + one.in_outs.len() == arguments.len());
        let mut list: Vec<String> = (arguments.into_iter())
            .map(|(name, value)| {
                if (is_full && is_whole) || name.is_empty() {
                    value
                } else {
                    format!("{name} := {value}")
                }
            })
            .collect();
        for (pin, kind) in others {
            let variable = wire_name(element, pin);
            self.variable(&variable, &kind);
            list.push(format!("{pin} => {variable}"));
        }
        let Some((variable, kind)) = result else {
            // Nobody reads the result, whose type is unknown: a function of the standard does nothing else.
            return Some(());
        };
        self.variable(&variable, &kind);
        self.line(&format!("{variable} := {name}({});", list.join(", ")));
        Some(())
    }

    fn is_read(&self, id: u64, parameter: &str) -> bool {
        let mut wires = (self.diagram.elements.iter())
            .flat_map(|one| one.kind.inputs())
            .flat_map(|pin| &pin.wires);
        wires
            .any(|wire| wire.id == id && (wire.parameter == parameter || wire.parameter.is_empty()))
    }

    /// A variable that a block may change.
    fn changeable(
        &mut self,
        element: &Element,
        pin: &Pin,
        value: Expression,
    ) -> Option<Expression> {
        let Level::Place = value.level else {
            // The block changes a copy, as in Beremiz.
            let at = self.diagram.by_id[&element.id];
            let inputs = element.kind.inputs();
            let number = inputs.iter().position(|one| std::ptr::eq(one, pin));
            let kind = number.and_then(|number| self.types.input(at, number));
            let Some(kind) = kind.and_then(Type::name).map(str::to_owned) else {
                let what = format!(
                    "{} is changed by the block, and no variable leads to it",
                    pin.name
                );
                let right = "store the value in a variable, and draw a wire from that";
                return self.refuse(element, pin.at, &what, right);
            };
            let variable = wire_name(element, &pin.name);
            self.variable(&variable, &kind);
            self.line(&format!("{variable} := {};", value.text));
            return Some(Expression::place(variable));
        };
        if pin.modifier != Modifier::Plain {
            let what = format!(
                "{} is changed by the block, and is negated or has an edge",
                pin.name
            );
            return self.refuse(element, pin.at, &what, "take the negation out");
        }
        Some(value)
    }

    /// The value of the output of a block at which a wire begins.
    pub(super) fn output(&mut self, at: usize, wire: &Wire) -> Option<Expression> {
        let element = &self.diagram.elements[at];
        let Kind::Block {
            name,
            instance,
            inputs,
            outputs,
        } = &element.kind
        else {
            return None;
        };
        let Some(number) = origin(element, wire) else {
            let what = format!("{} has no output {}", shown(name), shown(&wire.parameter));
            return self.refuse(element, wire.at, &what, "draw the wire again");
        };
        let pin = &outputs[number];
        let through = inputs
            .iter()
            .find(|one| !pin.name.is_empty() && one.name == pin.name);
        let value = if let Some(input) = through {
            // What a block changes leaves it under its own name.
            let [one] = input.wires.as_slice() else {
                let what = format!("one wire must lead to {}", shown(&pin.name));
                return self.refuse(element, input.at, &what, "draw it from a variable");
            };
            self.check_loop(at)?;
            self.running.push(at);
            let value = self.wire(one, true);
            self.running.pop();
            value?
        } else if let Some(instance) = instance {
            let value = Expression::primary(format!("{instance}.{}", pin.name));
            if pin.name.is_empty() {
                let what = format!("an output of {} has no name", shown(name));
                return self.refuse(element, pin.at, &what, "draw the block again");
            }
            value
        } else {
            let is_result =
                !pin.name.eq_ignore_ascii_case("ENO") && is_result(pin, name, self.unit.library);
            let variable = wire_name(element, if is_result { "" } else { &pin.name });
            let is_called = self.done.contains(&at) || element.order > 0;
            if !is_called {
                let what = format!("nothing leads to {}", shown(name));
                return self.refuse(element, element.at, &what, "draw wires to its inputs");
            }
            if let Some(kind) = self.types.output(at, number).and_then(Type::name) {
                let kind = kind.to_owned();
                self.variable(&variable, &kind);
            }
            Expression::place(variable)
        };
        self.modified(element, pin.modifier, value)
    }
}
