//! Blocks and programs in Structured Text as `PLCopen` XML (TC6, version 2).
//!
//! The elements are those of the schema `tc6_xml_v201.xsd`. The namespace is that of version 2.00, as in the output of
//! `tickbus export`: CODESYS, TwinCAT, Beremiz and OpenPLC Editor read it.

use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};

use super::code::Code;
use super::outline::{Section, Unit, UnitKind, outline};
use super::words;

const NAMESPACE: &str = "http://www.plcopen.org/xml/tc6_0200";
const XHTML: &str = "http://www.w3.org/1999/xhtml";

type Xml = Writer<Vec<u8>>;

/// A variable: its name, address, type and initial value.
pub(crate) type Variable<'t> = (&'t str, Option<&'t str>, &'t str, Option<&'t str>);

/// A file with all function blocks and programs of a source, which must be valid for [`pous`].
pub(crate) fn document(name: &str, source: &str) -> String {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    write_document(&mut xml, name, source).expect("memory takes all");
    text(xml) + "\n"
}

/// The `pou` elements of a source: elementary types, blocks, and no arrays or structures.
pub(crate) fn pous(source: &str) -> String {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    write_units(&mut xml, source).expect("memory takes all");
    text(xml)
}

/// A list of variables in an element of this name.
pub(crate) fn variables(element: &str, variables: &[Variable<'_>]) -> String {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    write_variables(&mut xml, element, variables).expect("memory takes all");
    text(xml)
}

/// Statements as the body of a unit.
pub(crate) fn statements(statements: &str) -> String {
    let mut xml = Writer::new(Vec::new());
    let write = |xml: &mut Xml| {
        within(xml, "ST", |xml| {
            let element = xml.create_element("xhtml").with_attribute(("xmlns", XHTML));
            element.write_text_content(BytesText::new(statements))?;
            Ok(())
        })
    };
    write(&mut xml).expect("memory takes all");
    text(xml)
}

fn text(xml: Xml) -> String {
    String::from_utf8(xml.into_inner()).expect("it was made of text")
}

fn write_document(xml: &mut Xml, name: &str, source: &str) -> io::Result<()> {
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("utf-8"), None)))?;
    let project = xml.create_element("project");
    let project = project.with_attribute(("xmlns", NAMESPACE));
    project.write_inner_content(|xml| {
        xml.create_element("fileHeader")
            .with_attribute(("companyName", ""))
            .with_attribute(("productName", "tickbus"))
            .with_attribute(("productVersion", env!("CARGO_PKG_VERSION")))
            // The schema requires a time; the current one would make every file different.
            .with_attribute(("creationDateTime", "2000-01-01T00:00:00"))
            .write_empty()?;
        let header = xml
            .create_element("contentHeader")
            .with_attribute(("name", name));
        header.write_inner_content(|xml| {
            let comment = format!("Made from plc/iec61131/{name}.st of tickbus: change that file.");
            xml.create_element("Comment")
                .write_text_content(BytesText::new(&comment))?;
            within(xml, "coordinateInfo", |xml| {
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
            })
        })?;
        within(xml, "types", |xml| {
            xml.create_element("dataTypes").write_empty()?;
            within(xml, "pous", |xml| write_units(xml, source))
        })?;
        within(xml, "instances", |xml| {
            xml.create_element("configurations").write_empty()?;
            Ok(())
        })
    })?;
    Ok(())
}

fn write_units(xml: &mut Xml, source: &str) -> io::Result<()> {
    let code = Code::new(source);
    let read = outline(&code).expect("our own sources can be read");
    // The comments before the first unit concern all of them.
    read.units
        .iter()
        .try_for_each(|unit| write_unit(xml, &code, unit))
}

fn write_unit(xml: &mut Xml, code: &Code<'_>, unit: &Unit) -> io::Result<()> {
    let kind = match unit.kind {
        UnitKind::Program => "program",
        UnitKind::Block => "functionBlock",
        UnitKind::Function => "function",
    };
    let element = xml.create_element("pou");
    let element = element.with_attributes([("name", code.word(unit.name)), ("pouType", kind)]);
    element.write_inner_content(|xml| {
        within(xml, "interface", |xml| {
            for section in &unit.sections {
                let element = match code.capitals(section.inner.start - 1).as_str() {
                    "VAR_INPUT" => "inputVars",
                    "VAR_OUTPUT" => "outputVars",
                    "VAR_EXTERNAL" => "externalVars",
                    _ => "localVars",
                };
                write_variables(xml, element, &declarations(code, section))?;
            }
            Ok(())
        })?;
        within(xml, "body", |xml| {
            within(xml, "ST", |xml| {
                let body = code.bytes(&unit.body).unwrap_or_default();
                // The statements with the blanks before them, so that all lines are indented alike.
                let start = code.text[..body.start].rfind('\n').map_or(0, |at| at + 1);
                let element = xml.create_element("xhtml").with_attribute(("xmlns", XHTML));
                element.write_text_content(BytesText::new(&code.text[start..body.end]))?;
                Ok(())
            })
        })
    })?;
    Ok(())
}

/// `a, b AT %IX0.0 : BOOL := TRUE;`
fn declarations<'t>(code: &Code<'t>, section: &Section) -> Vec<Variable<'t>> {
    let mut found = Vec::new();
    let tokens: Vec<usize> = section.inner.clone().collect();
    for declaration in tokens.split(|at| code.word(*at) == ";") {
        let position = |word: &str| declaration.iter().position(|at| code.word(*at) == word);
        let Some(colon) = position(":") else { continue };
        let address = declaration[..colon]
            .iter()
            .find(|at| code.word(**at).starts_with('%'))
            .map(|at| code.word(*at));
        let value = position(":=").map(|assign| code.word(declaration[assign + 1]));
        let names = declaration[..colon].iter().map(|at| code.word(*at));
        for name in names.filter(|name| !matches!(*name, "," | "AT") && !name.starts_with('%')) {
            found.push((name, address, code.word(declaration[colon + 1]), value));
        }
    }
    found
}

fn write_variables(xml: &mut Xml, element: &str, variables: &[Variable<'_>]) -> io::Result<()> {
    within(xml, element, |xml| {
        variables
            .iter()
            .try_for_each(|(name, address, kind, value)| {
                let mut element = xml
                    .create_element("variable")
                    .with_attribute(("name", *name));
                if let Some(address) = address {
                    element = element.with_attribute(("address", *address));
                }
                element.write_inner_content(|xml| {
                    within(xml, "type", |xml| {
                        if matches!(*kind, "STRING" | "WSTRING") {
                            // The only types in small letters.
                            xml.create_element(kind.to_lowercase()).write_empty()?;
                        } else if words::is_elementary(kind) {
                            xml.create_element(plcopen_type(kind)).write_empty()?;
                        } else {
                            let derived = xml.create_element("derived");
                            derived.with_attribute(("name", *kind)).write_empty()?;
                        }
                        Ok(())
                    })?;
                    if let Some(value) = value {
                        within(xml, "initialValue", |xml| {
                            let simple = xml.create_element("simpleValue");
                            simple.with_attribute(("value", *value)).write_empty()?;
                            Ok(())
                        })?;
                    }
                    Ok(())
                })?;
                Ok(())
            })
    })
}

/// The element of an elementary type: the schema has the short names only.
fn plcopen_type(kind: &str) -> &str {
    match kind {
        "TIME_OF_DAY" => "TOD",
        "DATE_AND_TIME" => "DT",
        other => other,
    }
}

fn within(
    xml: &mut Xml,
    name: &str,
    content: impl FnOnce(&mut Xml) -> io::Result<()>,
) -> io::Result<()> {
    xml.create_element(name).write_inner_content(content)?;
    Ok(())
}
