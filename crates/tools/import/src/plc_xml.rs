//! Variables of a PLC project as XML: PLCopen XML (CODESYS, TwinCAT, Beremiz, OpenPLC Editor), L5X (Studio 5000),
//! TwinCAT's own files, and the tag tables of TIA Portal.

use roxmltree::{Document, Node, ParsingOptions};

use super::Sheet;
use super::cells::Record;
use super::columns::Columns;
use super::xml::{Names, child, in_folder, named, place, record, scope, words};
use super::{declarations, logix};
use tickbus_base::toml_text::{Collector, Mistakes};

/// Files with more nodes than this are refused: no list of variables is this large.
const NODES: u32 = 3_000_000;

/// The relevant parts of a project.
pub(super) struct Project {
    pub(super) sheet: Sheet,
    pub(super) origin: Origin,
}

/// The program that wrote a list, as far as its addresses depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// A table, which any program can have written.
    Table,
    /// A project of CODESYS, TwinCAT or TIA Portal.
    Project,
    /// A project of CODESYS: addresses count elements.
    Codesys,
    /// A project of OpenPLC or Beremiz: addresses count elements, and each size has its own memory.
    OpenPlc,
    /// Studio 5000: points of modules, which have no image addresses.
    Logix,
}

/// The variables in `text` that are inputs or outputs; the others are reported to `skipped`.
pub(super) fn read(file: &str, text: &str, skipped: &Collector<'_>) -> Result<Project, Mistakes> {
    let options = ParsingOptions {
        nodes_limit: NODES,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(text, options).map_err(|error| {
        let wrong = Collector::new(file, text);
        wrong.report(
            offset(text, error.pos()),
            format!("this XML cannot be read: {error}"),
            "export it again from the PLC's editor",
        );
        wrong.finish().expect("one was reported")
    })?;
    let root = document.root_element();
    let (records, origin) = match root.tag_name().name() {
        "project" => (plcopen(root, skipped), plcopen_origin(root)),
        "RSLogix5000Content" => (logix::l5x(root, skipped), Origin::Logix),
        "TcPlcObject" => (twincat(root, text), Origin::Project),
        "Tagtable" | "Tagtables" => (tag_table(root), Origin::Project),
        "Document" if named(root, "SW.Tags.PlcTagTable").next().is_some() => {
            (openness(root), Origin::Project)
        }
        other => {
            return Err(Mistakes::of_file(
                file,
                format!(
                    "this is XML with the root element \"{}\"",
                    tickbus_base::toml_text::shown(other)
                ),
                "PLCopen XML (\"project\"), L5X (\"RSLogix5000Content\"), TwinCAT's .TcPOU and .TcGVL (\"TcPlcObject\") and \
                 tag tables of TIA Portal (\"Tagtable\") are read; from TIA Portal export the tags as XLSX, SDF or XML",
            ));
        }
    };
    let sheet = Sheet {
        name: None,
        text: text.to_owned(),
        records,
        columns: Some(Columns::fixed()),
    };
    Ok(Project { sheet, origin })
}

/// The program that wrote PLCopen XML. OpenPLC and Beremiz write a different version from the others.
fn plcopen_origin(root: Node<'_, '_>) -> Origin {
    let namespace = root.tag_name().namespace().unwrap_or_default();
    let product = child(root, "fileHeader").and_then(|header| header.attribute("productName"));
    if namespace.ends_with("tc6_0201") {
        Origin::OpenPlc
    } else if product.is_some_and(|product| product.to_ascii_uppercase().contains("CODESYS")) {
        Origin::Codesys
    } else {
        Origin::Project
    }
}

/// The variables with an address in the declarations of a TwinCAT object.
fn twincat(root: Node<'_, '_>, text: &str) -> Vec<Record> {
    let declarations = named(root, "Declaration").filter_map(|node| {
        let range = node.range();
        // The text as in the file, so that its positions are those of the file.
        let from = range.start + text[range.clone()].find("<![CDATA[")?;
        let records = declarations::read(text, from, range.end);
        let folder = scope(node, &["POU", "GVL"], "Name");
        Some(records.into_iter().map(move |it| in_folder(it, folder)))
    });
    declarations.flatten().collect()
}

/// The tags of a table exported by TIA Portal.
fn tag_table(root: Node<'_, '_>) -> Vec<Record> {
    let tags = named(root, "Tag").map(|tag| {
        let attribute = |name: &str| tag.attribute(name).unwrap_or_default();
        let record = record(
            tag,
            &words(Some(tag)),
            (attribute("addr"), place(tag, "addr")),
            (attribute("type"), place(tag, "type")),
            attribute("remark"),
        );
        in_folder(record, scope(tag, &["Tagtable"], "name"))
    });
    tags.collect()
}

/// The tags of a table exported by TIA Portal Openness.
fn openness(root: Node<'_, '_>) -> Vec<Record> {
    let tags = named(root, "SW.Tags.PlcTag").filter_map(|tag| {
        let mut around = tag.ancestors();
        let table = around.find(|node| node.tag_name().name() == "SW.Tags.PlcTagTable");
        let table = table.and_then(|table| child(child(table, "AttributeList")?, "Name"));
        let attributes = child(tag, "AttributeList")?;
        let attribute = |name: &str| {
            let node = child(attributes, name);
            (words(node), node.unwrap_or(tag).range().start)
        };
        let (address, kind) = (attribute("LogicalAddress"), attribute("DataTypeName"));
        // One text for each language of the project.
        let mut texts = named(tag, "Text").map(|text| words(Some(text)));
        let comment = texts.find(|text| !text.is_empty()).unwrap_or_default();
        let record = record(
            tag,
            &attribute("Name").0,
            (&address.0, address.1),
            (&kind.0, kind.1),
            &comment,
        );
        Some(in_folder(record, Some(&words(table))))
    });
    tags.collect()
}

/// The byte offset of roxmltree's row and column, which count characters from 1.
fn offset(text: &str, at: roxmltree::TextPos) -> usize {
    let (row, column) = (at.row as usize, at.col as usize);
    let mut start = 0;
    for line in text.split_inclusive('\n').take(row.saturating_sub(1)) {
        start += line.len();
    }
    let rest = text[start..].char_indices().nth(column.saturating_sub(1));
    rest.map_or(text.len(), |(at, _)| start + at)
}

/// Variables with an `address`, in lists of global variables and in programs.
fn plcopen(root: Node<'_, '_>, skipped: &Collector<'_>) -> Vec<Record> {
    const SCOPES: [&str; 2] = ["pou", "globalVars"];
    let (mut records, mut without) = (Vec::new(), Vec::new());
    let mut names = Names::default();
    for variable in named(root, "variable") {
        let Some(address) = variable.attribute("address") else {
            // Only declarations have types; graphical elements are also called `variable`.
            if child(variable, "type").is_some() {
                without.push(variable);
            }
            continue;
        };
        let kind = child(variable, "type").and_then(|kind| kind.first_element_child());
        let called = kind.map_or("", |kind| match kind.tag_name().name() {
            "derived" => kind.attribute("name").unwrap_or("derived"),
            name => name,
        });
        let at = place(variable, "address");
        let kind_at = kind.map_or(at, |kind| kind.range().start);
        let name = variable.attribute("name").unwrap_or_default();
        let name = &names.give(variable, name, &SCOPES, "name");
        let comment = words(child(variable, "documentation"));
        let record = record(variable, name, (address, at), (called, kind_at), &comment);
        records.push(in_folder(record, scope(variable, &SCOPES, "name")));
    }
    if let Some(first) = without.first() {
        skipped.report(
            first.range().start,
            format!(
                "{} variables without an address, \"{}\" the first, are no inputs or outputs: skipped",
                without.len(),
                tickbus_base::toml_text::shown(first.attribute("name").unwrap_or_default())
            ),
            "give those that the simulation needs an address in the PLC's editor",
        );
    }
    records
}
