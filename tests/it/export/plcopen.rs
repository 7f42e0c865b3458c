//! Converts `PLCopen` XML back to Structured Text, as the editor would show it.

use std::collections::VecDeque;

use quick_xml::events::Event;
use quick_xml::reader::Reader;

/// An element with its content.
#[derive(Clone, Debug, Default)]
pub(crate) struct Element {
    pub(crate) name: String,
    pub(crate) attributes: Vec<(String, String)>,
    pub(crate) text: String,
    pub(crate) children: Vec<Element>,
}

impl Element {
    /// The root element of a document.
    pub(crate) fn of_document(text: &str) -> Self {
        let mut reader = Reader::from_str(text);
        let mut open = VecDeque::from([Self::default()]);
        loop {
            let event = reader.read_event().expect("well-formed XML");
            let is_empty = matches!(event, Event::Empty(_));
            match event {
                Event::Start(start) | Event::Empty(start) => {
                    let attributes = start.attributes().map(|attribute| {
                        let attribute = attribute.expect("an attribute");
                        let value = attribute
                            .normalized_value(quick_xml::XmlVersion::Explicit1_0)
                            .expect("a value");
                        let name = attribute.key.as_ref().to_owned();
                        (name, value.into_owned())
                    });
                    let element = Self {
                        name: start.name().as_ref().to_owned(),
                        attributes: attributes.collect(),
                        ..Self::default()
                    };
                    open.push_back(element);
                    if is_empty {
                        close(&mut open);
                    }
                }
                Event::End(_) => close(&mut open),
                Event::Text(text) => {
                    open.back_mut().expect("one is open").text.push_str(&text);
                }
                Event::GeneralRef(reference) => {
                    let name: &str = &reference;
                    let character = match name {
                        "lt" => '<',
                        "gt" => '>',
                        "amp" => '&',
                        "quot" => '"',
                        "apos" => '\'',
                        other => panic!("&{other};"),
                    };
                    open.back_mut().expect("one is open").text.push(character);
                }
                Event::Eof => break,
                _ => {}
            }
        }
        assert_eq!(open.len(), 1, "every element is closed");
        let mut document = open.pop_back().expect("the document");
        document.children.pop().expect("an element")
    }

    /// The first child of this name.
    pub(crate) fn child(&self, name: &str) -> &Self {
        let mut children = self.children.iter();
        let found = children.find(|child| child.name == name);
        found.unwrap_or_else(|| panic!("{} has no {name}", self.name))
    }

    /// All elements of this name, at any depth.
    pub(crate) fn all(&self, name: &str) -> Vec<&Self> {
        let mut found = Vec::new();
        for child in &self.children {
            if child.name == name {
                found.push(child);
            }
            found.extend(child.all(name));
        }
        found
    }

    /// The value of an attribute.
    pub(crate) fn attribute(&self, name: &str) -> &str {
        let mut attributes = self.attributes.iter();
        let found = attributes.find(|(key, _)| key == name);
        &found
            .unwrap_or_else(|| panic!("{} has no {name}", self.name))
            .1
    }

    /// A variable as a declaration, with its comment.
    fn declaration(&self) -> String {
        let name = self.attribute("name");
        let comment = self
            .children
            .iter()
            .find(|child| child.name == "documentation");
        let comment = comment.map_or_else(String::new, |comment| {
            format!(
                " (* {} *)",
                comment
                    .child("xhtml")
                    .text
                    .replace("*)", "* )")
                    .replace("(*", "( *")
            )
        });
        format!(
            "    {name} : {};{comment}\n",
            kind(&self.child("type").children[0])
        )
    }

    #[expect(clippy::format_collect, reason = "a few lines of text")]
    fn declarations(&self, section: &str, keyword: &str) -> String {
        let sections = self.children.iter().filter(|child| child.name == section);
        sections
            .map(|section| {
                let variables = section
                    .children
                    .iter()
                    .filter(|child| child.name == "variable");
                let variables: String = variables.map(Self::declaration).collect();
                format!("{keyword}\n{variables}END_VAR\n")
            })
            .collect()
    }
}

fn close(open: &mut VecDeque<Element>) {
    let element = open.pop_back().expect("one is open");
    open.back_mut()
        .expect("one around it")
        .children
        .push(element);
}

fn kind(kind: &Element) -> String {
    match kind.name.as_str() {
        "derived" => kind.attribute("name").to_owned(),
        "pointer" => format!("POINTER TO {}", kind.child("baseType").children[0].name),
        "array" => {
            let range = kind.child("dimension");
            let base = &kind.child("baseType").children[0].name;
            format!(
                "ARRAY[{}..{}] OF {base}",
                range.attribute("lower"),
                range.attribute("upper")
            )
        }
        basic => basic.to_owned(),
    }
}

/// The list of global variables, and the units one by one with their names, as Structured Text.
pub(crate) fn structured_text(xml: &str) -> (String, Vec<(String, String)>) {
    let project = Element::of_document(xml);
    let globals = project.child("addData").child("data");
    let globals = globals.declarations("globalVars", "VAR_GLOBAL");
    let units = project.all("pou").into_iter().map(|unit| {
        let name = unit.attribute("name").to_owned();
        let interface = unit.child("interface");
        let returns = interface
            .children
            .iter()
            .find(|child| child.name == "returnType");
        let head = match returns {
            Some(returns) => format!("FUNCTION {name} : {}", kind(&returns.children[0])),
            None => format!("PROGRAM {name}"),
        };
        let end = if returns.is_some() {
            "END_FUNCTION"
        } else {
            "END_PROGRAM"
        };
        let inputs = interface.declarations("inputVars", "VAR_INPUT");
        let locals = interface.declarations("localVars", "VAR");
        let body = &unit.child("body").child("ST").child("xhtml").text;
        let text = format!("{head}\n{inputs}{locals}{body}\n{end}\n");
        (name, text)
    });
    (globals, units.collect())
}
