//! The types of the values on the wires: results of functions need variables, which need types.

use std::collections::HashMap;

use super::elements::{Diagram, Element, Kind, Pin, Wire};
use super::signature::{Library, Rule, Type, rule};
use crate::code::Code;
use crate::lexer::Kind as Token;

/// The arithmetic functions of a diagram are looked at this often: a longer chain of them without a known type within
/// is refused.
const ROUNDS: usize = 64;

/// The types of a diagram's pins.
pub(crate) struct Types {
    outputs: HashMap<(usize, usize), usize>,
    inputs: HashMap<(usize, usize), usize>,
    classes: Classes,
}

impl Types {
    /// The type of an element's output.
    pub(crate) fn output(&self, element: usize, output: usize) -> Option<&Type> {
        self.classes.kind(*self.outputs.get(&(element, output))?)
    }

    /// The type of an element's input.
    pub(crate) fn input(&self, element: usize, input: usize) -> Option<&Type> {
        self.classes.kind(*self.inputs.get(&(element, input))?)
    }
}

/// The output of a block that a wire begins at; `None` if that is unclear.
pub(crate) fn origin(block: &Element, wire: &Wire) -> Option<usize> {
    let Kind::Block { outputs, .. } = &block.kind else {
        return Some(0);
    };
    let named = (outputs.iter()).position(|pin| pin.name.eq_ignore_ascii_case(&wire.parameter));
    if let (Some(named), false) = (named, wire.parameter.is_empty()) {
        return Some(named);
    }
    if outputs.len() == 1 {
        return Some(0);
    }
    if !wire.parameter.is_empty() {
        return None;
    }
    let from = wire.from?;
    (outputs.iter()).position(|pin| {
        let (x, y) = pin.position;
        (block.position.0 + x, block.position.1 + y) == from
    })
}

/// True if this pin is the result of a function, and not one of its other outputs.
pub(crate) fn is_result(pin: &Pin, name: &str, library: &Library) -> bool {
    let is_parameter = (library.signature(name)).is_some_and(|one| one.has(&pin.name));
    !is_parameter && !pin.name.eq_ignore_ascii_case("ENO")
}

/// Finds the types of all pins.
pub(crate) fn infer(
    diagram: &Diagram,
    variables: &HashMap<String, Type>,
    library: &Library,
) -> Types {
    let mut classes = Classes::default();
    let (mut inputs, mut outputs) = (HashMap::new(), HashMap::new());
    for (index, element) in diagram.elements.iter().enumerate() {
        for number in 0..element.kind.inputs().len() {
            inputs.insert((index, number), classes.add());
        }
        for number in 0..element.kind.outputs() {
            outputs.insert((index, number), classes.add());
        }
    }
    let mut types = Types {
        outputs,
        inputs,
        classes,
    };
    for (index, element) in diagram.elements.iter().enumerate() {
        types.know(index, element, variables, library);
    }
    for (index, element) in diagram.elements.iter().enumerate() {
        for (number, pin) in element.kind.inputs().iter().enumerate() {
            for wire in &pin.wires {
                let from = diagram.by_id[&wire.id];
                if let Some(output) = origin(&diagram.elements[from], wire) {
                    let (one, other) = (
                        types.outputs[&(from, output)],
                        types.inputs[&(index, number)],
                    );
                    types.classes.join(one, other);
                }
            }
        }
    }
    let mut connectors: HashMap<String, usize> = HashMap::new();
    for (index, element) in diagram.elements.iter().enumerate() {
        let (name, class) = match &element.kind {
            Kind::Connector { name, .. } => (name, types.inputs[&(index, 0)]),
            Kind::Continuation { name } => (name, types.outputs[&(index, 0)]),
            _ => continue,
        };
        let first = *connectors.entry(name.to_uppercase()).or_insert(class);
        types.classes.join(first, class);
    }
    types.join_functions(diagram, library);
    types
}

impl Types {
    /// Notes what an element itself says about its types.
    fn know(
        &mut self,
        index: usize,
        element: &Element,
        variables: &HashMap<String, Type>,
        library: &Library,
    ) {
        let bool = || Type::named("BOOL");
        let (known, input, output) = match &element.kind {
            Kind::Rail
            | Kind::Contact { .. }
            | Kind::Coil { .. }
            | Kind::Jump { .. }
            | Kind::Return { .. } => (Some(bool()), 0, 0),
            Kind::Input { expression, .. }
            | Kind::Output { expression, .. }
            | Kind::InOut { expression, .. } => (type_of(expression, variables, library), 0, 0),
            Kind::Block {
                name,
                inputs,
                outputs,
                ..
            } => {
                let signature = library.signature(name);
                let of = |pin: &Pin| {
                    if pin.name.eq_ignore_ascii_case("EN") || pin.name.eq_ignore_ascii_case("ENO") {
                        return Some(bool());
                    }
                    let signature = signature.as_ref()?;
                    signature.parameter(&pin.name).cloned()
                };
                for (number, pin) in inputs.iter().enumerate() {
                    let written = pin.expression.as_ref();
                    let written = written.and_then(|text| type_of(text, variables, library));
                    if let Some(kind) = of(pin).or(written) {
                        self.classes.know(self.inputs[&(index, number)], kind);
                    }
                }
                for (number, pin) in outputs.iter().enumerate() {
                    let result = signature.as_ref().and_then(|one| one.result.clone());
                    let result = result.filter(|_| is_result(pin, name, library));
                    if let Some(kind) = of(pin).or(result) {
                        self.classes.know(self.outputs[&(index, number)], kind);
                    }
                }
                return;
            }
            Kind::Connector { .. } | Kind::Continuation { .. } | Kind::Label { .. } => return,
        };
        let Some(kind) = known else { return };
        if let Some(class) = self.inputs.get(&(index, input)) {
            self.classes.know(*class, kind.clone());
        }
        if let Some(class) = self.outputs.get(&(index, output)) {
            self.classes.know(*class, kind);
        }
    }

    /// Joins the types that standard functions have in common.
    fn join_functions(&mut self, diagram: &Diagram, library: &Library) {
        let mut arithmetic = Vec::new();
        for (index, element) in diagram.elements.iter().enumerate() {
            let Kind::Block {
                name,
                instance: None,
                inputs,
                outputs,
            } = &element.kind
            else {
                continue;
            };
            let (false, Some(rule)) =
                (library.units.contains_key(&name.to_uppercase()), rule(name))
            else {
                continue;
            };
            let result = outputs
                .iter()
                .position(|pin| !pin.name.eq_ignore_ascii_case("ENO"));
            let result = result.map(|number| self.outputs[&(index, number)]);
            let values: Vec<usize> = (inputs.iter().enumerate())
                .filter(|(_, pin)| !pin.name.eq_ignore_ascii_case("EN"))
                .map(|(number, _)| self.inputs[&(index, number)])
                .collect();
            let values = values.as_slice();
            let (same, given) = match rule {
                Rule::Same => (values, None),
                Rule::SameButFirst => (values.get(1..).unwrap_or_default(), None),
                Rule::SameAsFirst => (values.get(..1).unwrap_or_default(), None),
                Rule::Compares => (values, Some(Type::named("BOOL"))),
                Rule::Gives(kind) => (&[][..], Some(kind)),
                Rule::Free => continue,
                Rule::Arithmetic => {
                    arithmetic.push((name.to_uppercase(), values.to_vec(), result));
                    continue;
                }
            };
            for other in same.iter().skip(1) {
                self.classes.join(same[0], *other);
            }
            match (given, result, same.first()) {
                (Some(kind), Some(result), _) => self.classes.know(result, kind),
                (None, Some(result), Some(first)) => self.classes.join(*first, result),
                _ => {}
            }
        }
        for _ in 0..ROUNDS {
            let mut is_done = true;
            let mut later = Vec::new();
            for (name, values, result) in arithmetic.drain(..).rev() {
                if self.join_arithmetic(&name, &values, result) {
                    is_done = false;
                } else {
                    later.push((name, values, result));
                }
            }
            arithmetic = later;
            if is_done {
                break;
            }
        }
    }

    /// True if the types of an arithmetic function are known now.
    fn join_arithmetic(&mut self, name: &str, values: &[usize], result: Option<usize>) -> bool {
        let kinds: Vec<Option<Type>> = values
            .iter()
            .map(|class| self.classes.kind(*class).cloned())
            .collect();
        let is_time = |kind: &Option<Type>, name| kind.as_ref().is_some_and(|kind| kind.is(name));
        let times = kinds.iter().any(|kind| is_time(kind, "TIME"));
        let date = ["TIME_OF_DAY", "DATE_AND_TIME", "DATE"].into_iter();
        let mut date = date.filter(|date| is_time(&kinds[..].first().cloned().flatten(), date));
        let given = match (name, date.next()) {
            ("SUB", Some(_)) if !kinds.get(1).is_some_and(|kind| is_time(kind, "TIME")) => "TIME",
            (_, Some(date)) => date,
            (_, None) if times => "TIME",
            _ => {
                let known = kinds.iter().flatten().next();
                let known = known.or_else(|| self.classes.kind(result?));
                let Some(known) = known.cloned() else {
                    return false;
                };
                // A result that is a time may be a time multiplied by a number.
                if known.is("TIME") && matches!(name, "MUL" | "DIV") {
                    return false;
                }
                for class in values.iter().chain(&result) {
                    self.classes.know(*class, known.clone());
                }
                return true;
            }
        };
        if let Some(result) = result {
            self.classes.know(result, Type::named(given));
        }
        true
    }
}

/// The type of an expression: a literal, or a variable with its members and indices; `None` if it is something else, or a
/// number without a type.
pub(crate) fn type_of(
    expression: &str,
    variables: &HashMap<String, Type>,
    library: &Library,
) -> Option<Type> {
    let code = Code::new(expression);
    let first = code.word(0);
    match code.kind(0)? {
        Token::Literal if code.tokens.len() == 1 => {
            let (prefix, _) = first.split_once('#')?;
            return Some(match prefix.to_uppercase().as_str() {
                "T" | "TIME" => Type::named("TIME"),
                "D" | "DATE" => Type::named("DATE"),
                "2" | "8" | "16" => return None,
                other => Type::named(other),
            });
        }
        Token::Text if code.tokens.len() == 1 => {
            let is_wide = first.starts_with('"');
            return Some(Type::named(if is_wide { "WSTRING" } else { "STRING" }));
        }
        Token::Address if code.tokens.len() == 1 => {
            let letter = first.get(2..3)?.to_uppercase();
            return Some(Type::named(match letter.as_str() {
                "B" => "BYTE",
                "W" => "WORD",
                "D" => "DWORD",
                "L" => "LWORD",
                _ => "BOOL",
            }));
        }
        Token::Word => {}
        _ => return None,
    }
    if code.tokens.len() == 1 && matches!(code.capitals(0).as_str(), "TRUE" | "FALSE") {
        return Some(Type::named("BOOL"));
    }
    let mut kind = variables.get(&code.capitals(0))?.clone();
    let mut at = 1;
    while at < code.tokens.len() {
        match code.word(at) {
            "." => {
                kind = library.member(&kind, code.word(at + 1))?;
                at += 2;
            }
            "[" => {
                let Type::Array(inner) = library.resolved(&kind) else {
                    return None;
                };
                kind = *inner;
                at = code.closing(at, code.tokens.len()) + 1;
            }
            _ => return None,
        }
    }
    Some(kind)
}

/// Pins that have one type in common.
#[derive(Default)]
struct Classes {
    parents: Vec<usize>,
    kinds: Vec<Option<Type>>,
}

impl Classes {
    fn add(&mut self) -> usize {
        self.parents.push(self.parents.len());
        self.kinds.push(None);
        self.parents.len() - 1
    }

    fn root(&self, mut class: usize) -> usize {
        while self.parents[class] != class {
            class = self.parents[class];
        }
        class
    }

    fn kind(&self, class: usize) -> Option<&Type> {
        self.kinds[self.root(class)].as_ref()
    }

    /// The first type that is known stays.
    fn know(&mut self, class: usize, kind: Type) {
        let root = self.root(class);
        self.kinds[root].get_or_insert(kind);
    }

    /// The root, with shorter ways to it afterwards.
    fn find(&mut self, mut class: usize) -> usize {
        while self.parents[class] != class {
            self.parents[class] = self.parents[self.parents[class]];
            class = self.parents[class];
        }
        class
    }

    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.find(one), self.find(other));
        if one == other {
            return;
        }
        let (root, child) = (one.min(other), one.max(other));
        self.parents[child] = root;
        let kind = self.kinds[child].take();
        if self.kinds[root].is_none() {
            self.kinds[root] = kind;
        }
    }
}
