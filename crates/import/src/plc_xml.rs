//! Variables of a PLC project as XML: PLCopen XML (CODESYS, TwinCAT, Beremiz, OpenPLC Editor), and L5X (Studio 5000).

use std::collections::{HashMap, HashSet};

use roxmltree::{Document, Node, ParsingOptions};

use super::Sheet;
use super::cells::{Cell, Record};
use super::columns::Columns;
use super::device;
use tickbus_base::toml_text::{Collector, Mistakes};

/// Files with more nodes than this are refused: no list of variables is this large.
const NODES: u32 = 3_000_000;

/// What is needed from a project.
pub(super) struct Project {
    pub(super) sheet: Sheet,
    /// The variables have no image addresses in the file; they are assigned.
    pub(super) is_logix: bool,
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
            "export it anew from the PLC's editor",
        );
        wrong.finish().expect("one was reported")
    })?;
    let root = document.root_element();
    let (records, is_logix) = match root.tag_name().name() {
        "project" => (plcopen(root, skipped), false),
        "RSLogix5000Content" => (logix(root, skipped), true),
        other => {
            return Err(Mistakes::of_file(
                file,
                format!(
                    "this is XML with the root element \"{}\"",
                    tickbus_base::toml_text::shown(other)
                ),
                "PLCopen XML (\"project\") and L5X (\"RSLogix5000Content\") are read; from TIA Portal export the tags \
                 as XLSX or SDF",
            ));
        }
    };
    let sheet = Sheet {
        name: None,
        text: text.to_owned(),
        records,
        columns: Some(Columns::fixed()),
    };
    Ok(Project { sheet, is_logix })
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

/// Elements called `name` in any namespace: versions of PLCopen XML differ only in that.
fn named<'a, 'i>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.descendants()
        .filter(move |node| node.is_element() && node.tag_name().name() == name)
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children()
        .find(|child| child.is_element() && child.tag_name().name() == name)
}

/// The text within, as one line; if it is long, only the beginning.
fn words(node: Option<Node<'_, '_>>) -> String {
    const PIECES: usize = 1000;
    let pieces = node
        .into_iter()
        .flat_map(|node| node.descendants().take(PIECES));
    let pieces: Vec<&str> = pieces
        .filter(Node::is_text)
        .filter_map(|piece| piece.text())
        .flat_map(str::split_whitespace)
        .collect();
    pieces.join(" ")
}

/// The offset of an attribute's value, or else of its element.
fn place(node: Node<'_, '_>, attribute: &str) -> usize {
    let attribute = node.attribute_node(attribute);
    attribute.map_or(node.range().start, |attribute| {
        attribute.range_value().start
    })
}

fn record(
    node: Node<'_, '_>,
    name: &str,
    address: (&str, usize),
    kind: (&str, usize),
    comment: &str,
) -> Record {
    let cell = |text: &str, at| Cell {
        text: text.split_whitespace().collect::<Vec<_>>().join(" "),
        at,
    };
    vec![
        cell(name, place(node, "name")),
        cell(address.0, address.1),
        cell(kind.0, kind.1),
        cell(comment, node.range().start),
    ]
}

/// The names of variables so far.
#[derive(Default)]
struct Names {
    given: HashSet<String>,
}

impl Names {
    /// The name of a variable; if it is taken, prefixed by the program or list that the variable is local to.
    fn give(
        &mut self,
        variable: Node<'_, '_>,
        name: &str,
        scopes: &[&str],
        attribute: &str,
    ) -> String {
        let mut wanted = name.to_owned();
        if self.given.contains(name) {
            let mut around = variable.ancestors();
            let scope = around.find(|node| scopes.contains(&node.tag_name().name()));
            if let Some(scope) = scope.and_then(|scope| scope.attribute(attribute)) {
                wanted = format!("{scope}.{name}");
            }
        }
        self.given.insert(wanted.clone());
        wanted
    }
}

/// Variables with an `address`, in lists of global variables and in programs.
fn plcopen(root: Node<'_, '_>, skipped: &Collector<'_>) -> Vec<Record> {
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
        let name = &names.give(variable, name, &["pou", "globalVars"], "name");
        let comment = words(child(variable, "documentation"));
        records.push(record(
            variable,
            name,
            (address, at),
            (called, kind_at),
            &comment,
        ));
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

/// Tags that are aliases of module inputs and outputs; they have the alias (`Local:1:I.Data.0`) instead of an
/// address.
fn logix(root: Node<'_, '_>, skipped: &Collector<'_>) -> Vec<Record> {
    let types = member_types(root);
    let (mut records, mut others) = (Vec::new(), Vec::new());
    let mut names = Names::default();
    for tag in named(root, "Tag") {
        let name = tag.attribute("Name").unwrap_or_default();
        let target = tag.attribute("AliasFor").unwrap_or_default();
        if device::module_side(target).is_none() {
            others.push(tag);
            continue;
        }
        let last = target.rsplit('.').next().unwrap_or_default();
        let is_bit = !last.is_empty() && last.bytes().all(|byte| byte.is_ascii_digit());
        let is_point = target
            .rsplit('.')
            .nth(1)
            .is_some_and(|part| part.starts_with("Pt"))
            && last == "Data";
        let kind = match tag.attribute("DataType") {
            Some(kind) => kind,
            None if is_bit || is_point => "BOOL",
            None => {
                let (module, path) = target.split_once('.').unwrap_or((target, ""));
                let member = path.rsplit('.').next().unwrap_or_default();
                let known = types.get(&(module.to_owned(), member));
                known.copied().flatten().unwrap_or_default()
            }
        };
        let at = place(tag, "AliasFor");
        if kind.is_empty() {
            skipped.report(
                at,
                format!(
                    "the type of \"{}\" stands nowhere in the file: skipped",
                    tickbus_base::toml_text::shown(target)
                ),
                "export the whole controller, with its modules, or add a [[signal]] by hand",
            );
            continue;
        }
        let name = &names.give(tag, name, &["Program"], "Name");
        let mut record = record(
            tag,
            name,
            (target, at),
            (kind, place(tag, "DataType")),
            &words(child(tag, "Description")),
        );
        record[0].at = place(tag, "Name");
        records.push(record);
    }
    if let Some(first) = others.first() {
        skipped.report(
            first.range().start,
            format!(
                "{} tags that are no aliases of a module's inputs or outputs, \"{}\" the first: skipped",
                others.len(),
                tickbus_base::toml_text::shown(first.attribute("Name").unwrap_or_default())
            ),
            "make aliases of those that the simulation needs",
        );
    }
    records
}

/// The types of the members of all modules' inputs and outputs, by module (`Local:3:I`, `Drive:O`) and
/// member; `None` if a name occurs in several structures with different types.
fn member_types<'a>(root: Node<'a, '_>) -> HashMap<(String, &'a str), Option<&'a str>> {
    let mut types = HashMap::new();
    let modules = child(root, "Controller").and_then(|controller| child(controller, "Modules"));
    let modules = modules.into_iter().flat_map(|modules| modules.children());
    for module in modules.filter(Node::is_element) {
        let name = module.attribute("Name").unwrap_or_default();
        let parent = module.attribute("ParentModule").unwrap_or_default();
        let mut slot = None;
        // The direction of the connection, and the end of its element.
        let mut side = ("", 0);
        for node in module.descendants().filter(Node::is_element) {
            match node.tag_name().name() {
                "Port" if node.attribute("Upstream") == Some("true") => {
                    slot = slot.or(node.attribute("Address"));
                }
                "InputTag" => side = ("I", node.range().end),
                "OutputTag" => side = ("O", node.range().end),
                "DataValueMember" if node.range().start < side.1 => {
                    let (Some(member), Some(kind)) =
                        (node.attribute("Name"), node.attribute("DataType"))
                    else {
                        continue;
                    };
                    let in_rack = slot.map(|slot| format!("{parent}:{slot}:{}", side.0));
                    for key in in_rack.into_iter().chain([format!("{name}:{}", side.0)]) {
                        let known = types.entry((key, member)).or_insert(Some(kind));
                        *known = known.filter(|known| *known == kind);
                    }
                }
                _ => {}
            }
        }
    }
    types
}
