//! Reads diagrams from their XML.

use roxmltree::Node;
use tickbus_base::toml_text::{Collector, shown};

use super::elements::{Diagram, Element, Kind, Modifier, Pin, Wire};
use crate::code::Code;
use crate::lexer::Kind as Token;

/// Diagrams with more elements than this are refused: no unit is this large.
const ELEMENTS: usize = 20_000;

/// Elements without a meaning for the program.
const IGNORED: [&str; 5] = [
    "comment",
    "rightPowerRail",
    "vendorElement",
    "addData",
    "documentation",
];

/// Reads the text of an element as Structured Text in which every byte keeps its position; `None` if that was refused.
pub(crate) type TextOf<'f> = &'f dyn Fn(Node<'_, '_>) -> Option<(String, usize)>;

/// Reads the body of a unit, an element `LD` or `FBD`; `None` if mistakes were reported.
pub(crate) fn read(
    body: Node<'_, '_>,
    unit: &str,
    text_of: TextOf<'_>,
    wrong: &Collector<'_>,
) -> Option<Diagram> {
    let reader = Reader {
        unit,
        text_of,
        wrong,
    };
    let mut diagram = Diagram::default();
    let mut is_whole = true;
    for node in body.children().filter(Node::is_element) {
        let name = node.tag_name().name();
        if IGNORED.contains(&name) {
            continue;
        }
        let at = node.range().start;
        if diagram.elements.len() == ELEMENTS {
            let what = format!("{}: more than {ELEMENTS} elements", shown(unit));
            wrong.report(at, what, "split this unit");
            return None;
        }
        let Some(element) = reader.element(node) else {
            is_whole = false;
            continue;
        };
        let id = element.id;
        if diagram.by_id.insert(id, diagram.elements.len()).is_some() {
            let what = reader.told(node, "another element has this localId");
            wrong.report(at, what, "export the project again from its editor");
            is_whole = false;
        }
        diagram.elements.push(element);
    }
    for element in &diagram.elements {
        for wire in element.kind.inputs().iter().flat_map(|pin| &pin.wires) {
            let from = diagram.by_id.get(&wire.id);
            if from.is_none_or(|from| diagram.elements[*from].kind.outputs() == 0) {
                let what = format!(
                    "{}, element {}: a wire begins at {}, which is no element with an output",
                    shown(unit),
                    element.id,
                    wire.id
                );
                wrong.report(wire.at, what, "draw the wire again");
                is_whole = false;
            }
        }
    }
    is_whole.then_some(diagram)
}

struct Reader<'f> {
    unit: &'f str,
    text_of: TextOf<'f>,
    wrong: &'f Collector<'f>,
}

impl Reader<'_> {
    fn told(&self, node: Node<'_, '_>, what: &str) -> String {
        let id = node.attribute("localId").unwrap_or("?");
        format!("{}, element {}: {what}", shown(self.unit), shown(id))
    }

    fn refuse<T>(&self, node: Node<'_, '_>, at: usize, what: &str, right: &str) -> Option<T> {
        self.wrong.report(at, self.told(node, what), right);
        None
    }

    fn element(&self, node: Node<'_, '_>) -> Option<Element> {
        let at = node.range().start;
        let Some(id) = number(node, "localId") else {
            let right = "export the project again from its editor";
            return self.refuse(node, at, "there is no number localId", right);
        };
        let order = if node.attribute("executionOrderId").is_none() {
            0
        } else if let Some(order) = number(node, "executionOrderId") {
            order
        } else {
            let what = "the executionOrderId is no number";
            return self.refuse(node, at, what, "take it out");
        };
        let kind = self.kind(node)?;
        Some(Element {
            id,
            at,
            position: child(node, "position").map_or((0, 0), position),
            order,
            kind,
        })
    }

    fn kind(&self, node: Node<'_, '_>) -> Option<Kind> {
        let modifier = || self.modifier(node, node);
        let input = |modifier| Some(self.pin(node, node)?.with(modifier));
        Some(match node.tag_name().name() {
            "leftPowerRail" => Kind::Rail,
            "contact" => {
                let modifier = modifier()?;
                if matches!(modifier, Modifier::Set | Modifier::Reset) {
                    let what = "a contact cannot set or reset";
                    return self.refuse(node, node.range().start, what, "make it a coil");
                }
                Kind::Contact {
                    variable: self.expression(node, "variable")?,
                    input: input(modifier)?,
                }
            }
            "coil" => Kind::Coil {
                variable: self.expression(node, "variable")?,
                input: input(modifier()?)?,
            },
            "inVariable" => Kind::Input {
                expression: self.expression(node, "expression")?,
                is_negated: self.is(node, "negated")?,
            },
            "outVariable" => Kind::Output {
                expression: self.expression(node, "expression")?,
                input: input(modifier()?)?,
            },
            "inOutVariable" => Kind::InOut {
                expression: self.expression(node, "expression")?,
                input: input(if self.is(node, "negatedIn")? {
                    Modifier::Negated
                } else {
                    Modifier::Plain
                })?,
                is_negated: self.is(node, "negatedOut")?,
            },
            "connector" => Kind::Connector {
                name: node.attribute("name").unwrap_or_default().to_owned(),
                input: input(Modifier::Plain)?,
            },
            "continuation" => Kind::Continuation {
                name: node.attribute("name").unwrap_or_default().to_owned(),
            },
            "jump" => Kind::Jump {
                label: self.name(node, "label")?,
                input: input(modifier()?)?,
            },
            "label" => Kind::Label {
                name: self.name(node, "label")?,
            },
            "return" => Kind::Return {
                input: input(modifier()?)?,
            },
            "block" => self.block(node)?,
            other => {
                let what = format!("{} is no element of LD or FBD", shown(other));
                let right = "write this unit in Structured Text";
                return self.refuse(node, node.range().start, &what, right);
            }
        })
    }

    fn block(&self, node: Node<'_, '_>) -> Option<Kind> {
        let name = self.name(node, "typeName")?;
        let instance = match node.attribute("instanceName") {
            None | Some("") => None,
            Some(_) => Some(self.expression_of(
                node,
                &attribute(node, "instanceName")?.0,
                attribute(node, "instanceName")?.1,
            )?),
        };
        let list = |list| {
            let list = child(node, list).into_iter();
            list.flat_map(|list| list.children().filter(Node::is_element))
        };
        let pin = |variable: Node<'_, '_>| -> Option<Pin> {
            let name = variable.attribute("formalParameter").unwrap_or_default();
            if !name.is_empty() && !is_name(name) {
                let what = format!("{} is no name of a parameter", shown(name));
                let right = "export the project again from its editor";
                return self.refuse(node, variable.range().start, &what, right);
            }
            let modifier = self.modifier(node, variable)?;
            if matches!(modifier, Modifier::Set | Modifier::Reset) {
                let what = "a pin of a block cannot set or reset";
                return self.refuse(node, variable.range().start, what, "add a coil");
            }
            let pin = self.pin(node, variable)?.with(modifier);
            Some(Pin {
                name: name.to_owned(),
                ..pin
            })
        };
        let mut inputs: Vec<Pin> = list("inputVariables").map(pin).collect::<Option<_>>()?;
        let mut outputs: Vec<Pin> = list("outputVariables").map(pin).collect::<Option<_>>()?;
        // A pin on both sides of a block is an input and an output of the same name.
        for variable in list("inOutVariables") {
            inputs.push(pin(variable)?);
            let mut output = pin(variable)?;
            output.wires.clear();
            outputs.push(output);
        }
        let outgoing = outputs
            .iter()
            .any(|pin| matches!(pin.modifier, Modifier::Rising | Modifier::Falling));
        if outgoing {
            let what = "an output has an edge";
            let right = "draw an R_TRIG or F_TRIG behind it";
            return self.refuse(node, node.range().start, what, right);
        }
        Some(Kind::Block {
            name,
            instance,
            inputs,
            outputs,
        })
    }

    /// The wires that lead to a node, an element or a pin of one.
    fn pin(&self, element: Node<'_, '_>, node: Node<'_, '_>) -> Option<Pin> {
        let mut pin = Pin {
            at: node.range().start,
            ..Pin::default()
        };
        let mut points = node.children().filter(|node| {
            let name = node.tag_name().name();
            node.is_element() && matches!(name, "connectionPointIn" | "connectionPointOut")
        });
        let is_input = |node: &Node<'_, '_>| node.tag_name().name() == "connectionPointIn";
        if let Some(second) = points.clone().filter(is_input).nth(1) {
            let what = "there is a second connectionPointIn";
            let right = "join the wires at one point";
            return self.refuse(element, second.range().start, what, right);
        }
        let point = points.clone().find(is_input).or_else(|| points.next());
        let Some(point) = point else {
            return Some(pin);
        };
        if let Some(place) = child(point, "relPosition") {
            pin.position = position(place);
        }
        if child(point, "expression").is_some() {
            pin.expression = Some(self.expression(point, "expression")?);
        }
        for wire in point
            .children()
            .filter(|node| node.is_element() && node.tag_name().name() == "connection")
        {
            let at = wire.range().start;
            let Some(id) = number(wire, "refLocalId") else {
                let what = "a wire has no number refLocalId";
                return self.refuse(element, at, what, "draw the wire again");
            };
            let last = wire
                .children()
                .rfind(|node| node.tag_name().name() == "position");
            pin.wires.push(Wire {
                id,
                parameter: wire
                    .attribute("formalParameter")
                    .unwrap_or_default()
                    .to_owned(),
                from: last.map(position),
                at,
            });
        }
        Some(pin)
    }

    fn modifier(&self, element: Node<'_, '_>, node: Node<'_, '_>) -> Option<Modifier> {
        let at = node.range().start;
        let mut found = Vec::new();
        if self.is(node, "negated")? {
            found.push(Modifier::Negated);
        }
        match node.attribute("storage").unwrap_or("none") {
            "none" | "" => {}
            "set" => found.push(Modifier::Set),
            "reset" => found.push(Modifier::Reset),
            other => {
                let what = format!("the storage {} is unknown", shown(other));
                return self.refuse(element, at, &what, "write none, set or reset");
            }
        }
        match node.attribute("edge").unwrap_or("none") {
            "none" | "" => {}
            "rising" => found.push(Modifier::Rising),
            "falling" => found.push(Modifier::Falling),
            other => {
                let what = format!("the edge {} is unknown", shown(other));
                return self.refuse(element, at, &what, "write none, rising or falling");
            }
        }
        if found.len() > 1 {
            let what = "two of negated, storage and edge are given";
            let right = "keep one: compilers disagree about the other";
            return self.refuse(element, at, what, right);
        }
        Some(found.pop().unwrap_or_default())
    }

    /// The value of a Boolean attribute.
    fn is(&self, node: Node<'_, '_>, name: &str) -> Option<bool> {
        match node.attribute(name).unwrap_or("false") {
            "true" | "1" => Some(true),
            "false" | "0" | "" => Some(false),
            other => {
                let what = format!("{name} is {}", shown(other));
                self.refuse(node, node.range().start, &what, "write true or false")
            }
        }
    }

    /// An attribute that is the name of a block or label.
    fn name(&self, node: Node<'_, '_>, key: &str) -> Option<String> {
        let name = node.attribute(key).unwrap_or_default();
        if is_name(name) {
            return Some(name.to_owned());
        }
        let what = format!("the {key} {} is no name", shown(name));
        let right = "export the project again from its editor";
        self.refuse(node, node.range().start, &what, right)
    }

    /// The text of the child called `name`, an expression of Structured Text.
    fn expression(&self, node: Node<'_, '_>, name: &str) -> Option<String> {
        let holder = child(node, name);
        let text = match holder {
            Some(holder) if holder.first_child().is_some() => (self.text_of)(holder)?,
            _ => {
                let what = format!("there is no {name}");
                let right = "name a variable or a value there";
                return self.refuse(node, node.range().start, &what, right);
            }
        };
        self.expression_of(node, &text.0, text.1)
    }

    /// An expression without comments, each blank a single one.
    fn expression_of(&self, node: Node<'_, '_>, text: &str, at: usize) -> Option<String> {
        let code = Code::part(text, at);
        let mut depth = 0_i32;
        let mut is_wrong = code.tokens.is_empty();
        let mut made = String::new();
        let mut end = None;
        for token in &code.tokens {
            let word = &text[token.range()];
            match word {
                "(" | "[" => depth += 1,
                ")" | "]" => depth -= 1,
                _ => {}
            }
            // Assignments and statements are no expressions; in the brackets of a call := names a parameter.
            is_wrong |= depth < 0
                || word == ";"
                || (matches!(word, ":=" | "=>" | ":") && depth == 0)
                || matches!(token.kind, Token::Endless);
            // In XML the two parts of <> and >= are apart: their references are longer.
            let is_split = made.ends_with(['<', '>']) && matches!(word, "=" | ">");
            if end.is_some_and(|end| end != token.start) && !is_split {
                made.push(' ');
            }
            made.push_str(word);
            end = Some(token.end);
        }
        is_wrong |= depth != 0 || code.all.iter().any(|token| token.kind == Token::Pragma);
        if is_wrong {
            let what = format!("{} is no variable and no value", shown(text.trim()));
            let right = "write one variable, value or expression";
            return self.refuse(node, at, &what, right);
        }
        Some(made)
    }
}

impl Pin {
    fn with(self, modifier: Modifier) -> Self {
        Self { modifier, ..self }
    }
}

/// An attribute's value and its position in the file.
fn attribute(node: Node<'_, '_>, name: &str) -> Option<(String, usize)> {
    let found = node.attribute_node(name)?;
    Some((found.value().to_owned(), found.range_value().start))
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    let mut children = node.children().filter(Node::is_element);
    children.find(|child| child.tag_name().name() == name)
}

fn number(node: Node<'_, '_>, name: &str) -> Option<u64> {
    node.attribute(name)?.trim().parse().ok()
}

/// The coordinates of a `position`; a drawing may have fractions, which do not matter.
fn position(node: Node<'_, '_>) -> (i64, i64) {
    let coordinate = |name| {
        let text = node.attribute(name).unwrap_or_default();
        let number: f64 = text.trim().parse().unwrap_or_default();
        #[expect(clippy::cast_possible_truncation, reason = "a coordinate of a drawing")]
        let whole = number.clamp(-1e9, 1e9) as i64;
        whole
    };
    (coordinate("x"), coordinate("y"))
}

fn is_name(text: &str) -> bool {
    let mut bytes = text.bytes();
    let is_letter = |byte: u8| byte.is_ascii_alphabetic() || byte == b'_' || byte >= 0x80;
    bytes.next().is_some_and(is_letter)
        && bytes.all(|byte| is_letter(byte) || byte.is_ascii_digit())
}
