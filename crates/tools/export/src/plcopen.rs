//! `PLCopen` XML, TC6 version 2, which CODESYS and TwinCAT can import.
//!
//! The elements are those of the schema `tc6_xml_v201.xsd`. The namespace is that of version 2.00, which both editors
//! write and read. Our files are valid in that version and, with the namespace changed, in 2.01. The schema has no
//! place for a list of global variables outside a configuration: both editors keep such a list in `addData`.

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};
use std::io;

const NAMESPACE: &str = "http://www.plcopen.org/xml/tc6_0200";
const XHTML: &str = "http://www.w3.org/1999/xhtml";
const GLOBALS: &str = "http://www.3s-software.com/plcopenxml/globalvars";
const ATTRIBUTES: &str = "http://www.3s-software.com/plcopenxml/attributes";

/// A file to be imported.
#[derive(Clone, Debug)]
pub(super) struct Project {
    pub(super) name: String,
    /// The purpose and origin of the project.
    pub(super) comment: String,
    pub(super) units: Vec<Unit>,
    /// The name of the list of global variables, and the variables.
    pub(super) globals: (String, Vec<Variable>),
}

/// A program or a function, in Structured Text.
#[derive(Clone, Debug)]
pub(super) struct Unit {
    pub(super) name: String,
    /// The type of a function's value; `None` for a program.
    pub(super) returns: Option<&'static str>,
    pub(super) inputs: Vec<Variable>,
    pub(super) locals: Vec<Variable>,
    /// The statements of the unit.
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
    /// An elementary type, such as `BOOL`.
    Basic(&'static str),
    /// A function block of a library.
    Block(&'static str),
    /// An array of an elementary type, with this number of elements from 0 on.
    Array(usize, &'static str),
    /// A pointer to an elementary type.
    Pointer(&'static str),
}

/// A variable without a comment.
pub(super) fn variable(name: &str, kind: Kind) -> Variable {
    Variable {
        name: name.to_owned(),
        kind,
        comment: String::new(),
    }
}

type Xml = Writer<Vec<u8>>;

impl Project {
    /// The file as text. The text does not depend on the clock: equal projects give equal texts.
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
                // The schema requires a time; the time of the export would make every file different.
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

/// Data specific to these editors, which others may ignore.
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
