//! `PLCopen` XML, TC6 version 2: what CODESYS and TwinCAT import as a whole.
//!
//! The elements are those of the schema `tc6_xml_v201.xsd`. The namespace is that of version 2.00, which is the one that both
//! editors write and read; a file of ours is valid under it and, with the namespace changed, under 2.01. A list of global
//! variables that belongs to no configuration has no place in the schema: both editors keep it in `addData`.

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};
use std::io;

const NAMESPACE: &str = "http://www.plcopen.org/xml/tc6_0200";
const XHTML: &str = "http://www.w3.org/1999/xhtml";
const GLOBALS: &str = "http://www.3s-software.com/plcopenxml/globalvars";
const ATTRIBUTES: &str = "http://www.3s-software.com/plcopenxml/attributes";

/// A file to import.
#[derive(Clone, Debug)]
pub(super) struct Project {
    pub(super) name: String,
    /// What it is and where it comes from.
    pub(super) comment: String,
    pub(super) units: Vec<Unit>,
    /// The name of the list of global variables, and what is in it.
    pub(super) globals: (String, Vec<Variable>),
}

/// A program or a function, in Structured Text.
#[derive(Clone, Debug)]
pub(super) struct Unit {
    pub(super) name: String,
    /// The type of its value, for a function; a program has none.
    pub(super) returns: Option<&'static str>,
    pub(super) inputs: Vec<Variable>,
    pub(super) locals: Vec<Variable>,
    /// Its statements.
    pub(super) lines: Vec<String>,
    pub(super) comment: String,
}

/// A variable.
#[derive(Clone, Debug)]
pub(super) struct Variable {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) comment: String,
}

/// The type of a variable.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// One of the language, such as `BOOL`.
    Basic(&'static str),
    /// A block of a library.
    Block(&'static str),
    /// So many of one of the language, from 0 on.
    Array(usize, &'static str),
    /// A pointer to one of the language.
    Pointer(&'static str),
}

/// A variable that needs no comment.
pub(super) fn variable(name: &str, kind: Kind) -> Variable {
    Variable {
        name: name.to_owned(),
        kind,
        comment: String::new(),
    }
}

type Xml = Writer<Vec<u8>>;

impl Project {
    /// The file as text. Nothing in it depends on the clock: equal projects give equal texts.
    pub(super) fn text(&self) -> String {
        let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
        self.write(&mut xml).expect("memory takes all");
        let mut text = String::from_utf8(xml.into_inner()).expect("it was made of text");
        text.push('\n');
        text
    }

    fn write(&self, xml: &mut Xml) -> io::Result<()> {
        xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("utf-8"), None)))?;
        let project = xml
            .create_element("project")
            .with_attribute(("xmlns", NAMESPACE));
        project.write_inner_content(|xml| {
            xml.create_element("fileHeader")
                .with_attribute(("companyName", ""))
                .with_attribute(("productName", "tickbus"))
                .with_attribute(("productVersion", env!("CARGO_PKG_VERSION")))
                // The schema asks for a time; that of an export would make each file differ.
                .with_attribute(("creationDateTime", "2000-01-01T00:00:00"))
                .write_empty()?;
            let header = xml
                .create_element("contentHeader")
                .with_attribute(("name", self.name.as_str()));
            header.write_inner_content(|xml| {
                let comment = xml.create_element("Comment");
                comment.write_text_content(BytesText::new(&self.comment))?;
                let scales = xml.create_element("coordinateInfo");
                scales.write_inner_content(|xml| {
                    for language in ["fbd", "ld", "sfc"] {
                        within(xml, language, |xml| {
                            let scale = xml.create_element("scaling");
                            scale
                                .with_attributes([("x", "1"), ("y", "1")])
                                .write_empty()?;
                            Ok(())
                        })?;
                    }
                    Ok(())
                })?;
                Ok(())
            })?;
            within(xml, "types", |xml| {
                xml.create_element("dataTypes").write_empty()?;
                within(xml, "pous", |xml| {
                    self.units.iter().try_for_each(|unit| unit.write(xml))
                })
            })?;
            within(xml, "instances", |xml| {
                xml.create_element("configurations").write_empty()?;
                Ok(())
            })?;
            within(xml, "addData", |xml| {
                data(xml, GLOBALS, |xml| self.write_globals(xml))
            })
        })?;
        Ok(())
    }

    fn write_globals(&self, xml: &mut Xml) -> io::Result<()> {
        let (name, variables) = &self.globals;
        let list = xml
            .create_element("globalVars")
            .with_attribute(("name", name.as_str()));
        list.write_inner_content(|xml| {
            variables.iter().try_for_each(|one| one.write(xml))?;
            within(xml, "addData", |xml| {
                data(xml, ATTRIBUTES, |xml| {
                    within(xml, "Attributes", |xml| {
                        let attribute = xml.create_element("Attribute");
                        let attribute = attribute.with_attribute(("Name", "qualified_only"));
                        attribute.with_attribute(("Value", "")).write_empty()?;
                        Ok(())
                    })
                })
            })
        })?;
        Ok(())
    }
}

impl Unit {
    fn write(&self, xml: &mut Xml) -> io::Result<()> {
        let kind = if self.returns.is_some() {
            "function"
        } else {
            "program"
        };
        let unit = xml.create_element("pou");
        let unit = unit.with_attributes([("name", self.name.as_str()), ("pouType", kind)]);
        unit.write_inner_content(|xml| {
            within(xml, "interface", |xml| {
                if let Some(kind) = self.returns {
                    within(xml, "returnType", |xml| Kind::Basic(kind).write(xml))?;
                }
                for (section, variables) in
                    [("inputVars", &self.inputs), ("localVars", &self.locals)]
                {
                    if !variables.is_empty() {
                        within(xml, section, |xml| {
                            variables.iter().try_for_each(|one| one.write(xml))
                        })?;
                    }
                }
                Ok(())
            })?;
            within(xml, "body", |xml| {
                within(xml, "ST", |xml| xhtml(xml, &self.lines.join("\n")))
            })?;
            within(xml, "documentation", |xml| xhtml(xml, &self.comment))
        })?;
        Ok(())
    }
}

impl Variable {
    fn write(&self, xml: &mut Xml) -> io::Result<()> {
        let variable = xml
            .create_element("variable")
            .with_attribute(("name", self.name.as_str()));
        variable.write_inner_content(|xml| {
            within(xml, "type", |xml| self.kind.write(xml))?;
            if self.comment.is_empty() {
                return Ok(());
            }
            within(xml, "documentation", |xml| xhtml(xml, &self.comment))
        })?;
        Ok(())
    }
}

impl Kind {
    fn write(self, xml: &mut Xml) -> io::Result<()> {
        let base =
            |xml: &mut Xml, kind| within(xml, "baseType", |xml| Self::Basic(kind).write(xml));
        match self {
            Self::Basic(name) => {
                xml.create_element(name).write_empty()?;
            }
            Self::Block(name) => {
                let derived = xml.create_element("derived");
                derived.with_attribute(("name", name)).write_empty()?;
            }
            Self::Array(count, kind) => within(xml, "array", |xml| {
                let last = count.saturating_sub(1).to_string();
                let range = xml.create_element("dimension");
                let range = range.with_attributes([("lower", "0"), ("upper", last.as_str())]);
                range.write_empty()?;
                base(xml, kind)
            })?,
            Self::Pointer(kind) => within(xml, "pointer", |xml| base(xml, kind))?,
        }
        Ok(())
    }
}

fn within(
    xml: &mut Xml,
    name: &'static str,
    content: impl FnOnce(&mut Xml) -> io::Result<()>,
) -> io::Result<()> {
    xml.create_element(name).write_inner_content(content)?;
    Ok(())
}

/// Something of the editors' own, which others may leave out.
fn data(
    xml: &mut Xml,
    name: &str,
    content: impl FnOnce(&mut Xml) -> io::Result<()>,
) -> io::Result<()> {
    let data = xml.create_element("data");
    let data = data.with_attributes([("name", name), ("handleUnknown", "implementation")]);
    data.write_inner_content(content)?;
    Ok(())
}

fn xhtml(xml: &mut Xml, text: &str) -> io::Result<()> {
    let element = xml.create_element("xhtml").with_attribute(("xmlns", XHTML));
    element.write_text_content(BytesText::new(text))?;
    Ok(())
}
