//! Inputs and outputs in projects of Studio 5000: L5X, and its table of tags as CSV.
//!
//! Modules have structures of data, `Local:1:I` and `Drive:O`. A project names points in them by aliases, or uses them
//! directly, with comments on members and bits.

use std::collections::{HashMap, HashSet};

mod table;

pub(crate) use table::table;

use roxmltree::Node;

use super::cells::{Cell, Record};
use super::device;
use super::rows::MOST;
use super::xml::{Names, child, in_folder, named, place, record, scope, words};
use tickbus_base::toml_text::{Collector, shown};

/// A value in a module's data.
struct Point {
    /// `Local:1:I.Ch0Data`.
    path: String,
    kind: String,
    at: usize,
    /// An alias names the whole point.
    is_named: bool,
    /// The bits of the point that aliases name.
    bits: HashSet<String>,
}

/// The inputs and outputs of all modules.
#[derive(Default)]
struct Points {
    list: Vec<Point>,
    /// By path, in upper case: names in Logix have no case.
    by_path: HashMap<String, usize>,
    /// The points of each structure, `LOCAL:1:I`.
    by_structure: HashMap<String, Vec<usize>>,
    /// Structures that are a part of another one: `RACK:1:I` of `Rack:I.Slot[1]`.
    parts: HashMap<String, String>,
    comments: HashMap<String, String>,
}

impl Points {
    fn add(&mut self, path: String, kind: &str, at: usize) {
        let key = path.to_ascii_uppercase();
        if self.by_path.contains_key(&key) {
            return;
        }
        let structure = key.split('.').next().unwrap_or_default().to_owned();
        let points = self.by_structure.entry(structure).or_default();
        points.push(self.list.len());
        self.by_path.insert(key, self.list.len());
        self.list.push(Point {
            path,
            kind: if kind == "BIT" { "BOOL" } else { kind }.to_owned(),
            at,
            is_named: false,
            bits: HashSet::new(),
        });
    }

    /// The values in `node`, which has the data called `path`, or one member or element of these.
    fn collect(&mut self, node: Node<'_, '_>, path: &str) {
        // Depth is bounded by the XML parser, and structures of modules have three levels.
        let mut open = vec![(node, path.to_owned())];
        while let Some((node, path)) = open.pop() {
            let mut inner = Vec::new();
            for member in node.children().filter(Node::is_element) {
                let name = member.attribute("Name").unwrap_or_default();
                match member.tag_name().name() {
                    "Structure" => inner.push((member, path.clone())),
                    "StructureMember" => inner.push((member, format!("{path}.{name}"))),
                    "DataValueMember" => {
                        let kind = member.attribute("DataType").unwrap_or_default();
                        self.add(format!("{path}.{name}"), kind, member.range().start);
                    }
                    "ArrayMember" => {
                        let kind = member.attribute("DataType").unwrap_or_default();
                        for element in member.children().filter(Node::is_element) {
                            let index = element.attribute("Index").unwrap_or_default();
                            let path = format!("{path}.{name}{index}");
                            if element.has_attribute("Value") {
                                self.add(path, kind, element.range().start);
                            } else {
                                inner.push((element, path));
                            }
                        }
                    }
                    _ => {}
                }
            }
            open.extend(inner.into_iter().rev());
        }
    }

    /// The structures of one module, and their comments.
    fn module(&mut self, module: Node<'_, '_>) {
        let name = module.attribute("Name").unwrap_or_default();
        let parent = module.attribute("ParentModule").unwrap_or_default();
        let mut ports = named(module, "Port");
        let port = ports.find(|port| port.attribute("Upstream") == Some("true"));
        let slot = port.and_then(|port| port.attribute("Address"));
        // On a network a module has its own name; in a chassis, the name of the chassis and its slot.
        let is_network = port.is_some_and(|port| {
            matches!(
                port.attribute("Type"),
                Some("Ethernet" | "ControlNet" | "DeviceNet")
            )
        });
        let slot = slot.filter(|slot| {
            !is_network && !slot.is_empty() && slot.bytes().all(|byte| byte.is_ascii_digit())
        });
        for node in module.descendants().filter(Node::is_element) {
            let (side, is_part) = match node.tag_name().name() {
                "InputTag" => ("I", false),
                "OutputTag" => ("O", false),
                "InAliasTag" => ("I", true),
                "OutAliasTag" => ("O", true),
                _ => continue,
            };
            let path = match slot {
                Some(slot) => format!("{parent}:{slot}:{side}"),
                None => format!("{name}:{side}"),
            };
            if is_part && let Some(slot) = slot {
                // The adapter has the data of its rack in one structure.
                let parts =
                    ["Slot", "Data"].map(|member| format!("{parent}:{side}.{member}[{slot}]"));
                self.parts
                    .insert(path.to_ascii_uppercase(), parts.join("\n"));
            }
            let comments = child(node, "Comments");
            for comment in comments
                .into_iter()
                .flat_map(|comments| named(comments, "Comment"))
            {
                let operand = comment.attribute("Operand").unwrap_or_default();
                let key = format!("{path}{operand}").to_ascii_uppercase();
                self.comments.insert(key, words(Some(comment)));
            }
            for data in named(node, "Data") {
                self.collect(data, &path);
            }
        }
    }

    /// `target` as the path of a point, as the start of several, or as the bit of one.
    fn resolved(&self, target: &str) -> String {
        let upper = target.to_ascii_uppercase();
        let end = upper.find('.').unwrap_or(upper.len());
        let Some(parts) = self.parts.get(&upper[..end]) else {
            return upper;
        };
        let rest = &upper[end..];
        for part in parts.to_ascii_uppercase().lines() {
            // The adapter of a rack has `Slot[1].Data`, or `Data[1]`.
            let candidates = [
                format!("{part}{rest}"),
                format!("{part}{}", rest.strip_prefix(".DATA").unwrap_or(rest)),
            ];
            for candidate in candidates {
                let whole = bit(&candidate).map_or(candidate.as_str(), |(whole, _)| whole);
                if self.by_path.contains_key(whole) {
                    return candidate;
                }
            }
        }
        upper
    }

    /// The points of a whole structure.
    fn within(&self, path: &str) -> Vec<usize> {
        let structure = path.split('.').next().unwrap_or_default();
        let points = self.by_structure.get(structure).into_iter().flatten();
        let points = points.copied().filter(|index| {
            let rest = self.list[*index].path.get(path.len()..);
            let start = self.list[*index].path.get(..path.len());
            start.is_some_and(|start| start.eq_ignore_ascii_case(path))
                && rest.is_some_and(|rest| rest.starts_with(['.', '[']))
        });
        points.collect()
    }
}

/// Splits a path that ends in a bit, `….Data.3`.
fn bit(path: &str) -> Option<(&str, &str)> {
    let (whole, bit) = path.rsplit_once('.')?;
    let is_bit = !bit.is_empty() && bit.bytes().all(|byte| byte.is_ascii_digit());
    is_bit.then_some((whole, bit))
}

/// The points of modules in an L5X, named by aliases where the project has any; they have the path in the module
/// (`Local:1:I.Data.0`) instead of an address.
pub(super) fn l5x(root: Node<'_, '_>, skipped: &Collector<'_>) -> Vec<Record> {
    let mut points = Points::default();
    for module in named(root, "Module") {
        points.module(module);
    }
    for tag in named(root, "Tag") {
        let name = tag.attribute("Name").unwrap_or_default();
        if device::module_side(name).is_some() {
            for data in named(tag, "Data") {
                points.collect(data, name);
            }
        }
    }
    let mut records = aliases(root, &mut points, skipped);
    // A comment on an adapter's rack belongs to the module in it.
    let comments: Vec<(String, String)> = points.comments.drain().collect();
    let comments: HashMap<String, String> = comments
        .into_iter()
        .map(|(path, comment)| (points.resolved(&path), comment))
        .collect();
    let mut bits: HashMap<&str, Vec<&str>> = HashMap::new();
    for path in comments.keys() {
        if let Some((whole, bit)) = bit(path) {
            bits.entry(whole).or_default().push(bit);
        }
    }
    for point in points.list.iter().filter(|point| !point.is_named) {
        let key = point.path.to_ascii_uppercase();
        let mut commented = bits.remove(key.as_str()).unwrap_or_default();
        commented.sort_by_key(|bit| bit.parse::<u32>().unwrap_or(u32::MAX));
        let mut add = |path: &str, kind: &str| {
            let comment = comments.get(&path.to_ascii_uppercase());
            let comment = comment.map_or("", String::as_str);
            records.push(cells([path, path, kind, comment], [point.at; 4]));
        };
        for bit in &commented {
            if !point.bits.contains(*bit) {
                add(&format!("{}.{bit}", point.path), "BOOL");
            }
        }
        if commented.is_empty() && point.bits.is_empty() {
            add(&point.path, &point.kind);
        }
    }
    records
}

/// The aliases of points, and of whole structures; marks the points that they name.
fn aliases(root: Node<'_, '_>, points: &mut Points, skipped: &Collector<'_>) -> Vec<Record> {
    let (mut records, mut others) = (Vec::new(), Vec::new());
    let mut names = Names::default();
    for tag in named(root, "Tag") {
        let name = tag.attribute("Name").unwrap_or_default();
        let target = tag.attribute("AliasFor").unwrap_or_default();
        if device::module_side(target).is_none() {
            if device::module_side(name).is_none() {
                others.push(tag);
            }
            continue;
        }
        let at = place(tag, "AliasFor");
        let program = scope(tag, &["Program"], "Name");
        let path = points.resolved(target);
        let known = points.by_path.get(&path).copied();
        let within = if known.is_none() && records.len() < MOST {
            points.within(&path)
        } else {
            Vec::new()
        };
        if !within.is_empty() {
            let name = names.give(tag, name, &["Program"], "Name");
            for index in within {
                let point = &mut points.list[index];
                point.is_named = true;
                let name = format!("{name}{}", &point.path[path.len()..]);
                let record = cells(
                    [&name, &point.path, &point.kind, ""],
                    [place(tag, "Name"), at, at, at],
                );
                records.push(in_folder(record, program));
            }
            continue;
        }
        let mut kind = tag.attribute("DataType").unwrap_or_default().to_owned();
        if let Some(index) = known {
            points.list[index].is_named = true;
            kind.clone_from(&points.list[index].kind);
        } else if let Some((whole, bit)) = bit(&path) {
            let index = points.by_path.get(whole).copied();
            if let Some(index) = index {
                points.list[index].bits.insert(bit.to_owned());
            }
            "BOOL".clone_into(&mut kind);
        } else if kind.is_empty() {
            let is_float = tag.attribute("Radix") == Some("Float");
            kind_by_name(target, is_float)
                .unwrap_or_default()
                .clone_into(&mut kind);
        }
        if kind.is_empty() {
            let name = names.give(tag, name, &["Program"], "Name");
            let comments = child(tag, "Comments");
            let comments = comments
                .into_iter()
                .flat_map(|comments| named(comments, "Comment"));
            let before = records.len();
            let mut members = HashSet::new();
            records.extend(comments.filter_map(|comment| {
                let operand = comment.attribute("Operand").unwrap_or_default();
                let (member, kind) = commented_point(operand)?;
                let is_new = members.insert(member.to_ascii_uppercase());
                is_new.then(|| {
                    let texts = [&name, target].map(|whole| format!("{whole}{member}"));
                    let record = cells(
                        [&texts[0], &texts[1], kind, &words(Some(comment))],
                        [place(comment, "Operand"), at, at, at],
                    );
                    in_folder(record, program)
                })
            }));
            unknown(skipped, at, target, records.len() > before, "file");
            continue;
        }
        let name = &names.give(tag, name, &["Program"], "Name");
        let comment = words(child(tag, "Description"));
        let mut record = record(
            tag,
            name,
            (target, at),
            (&kind, place(tag, "DataType")),
            &comment,
        );
        record[0].at = place(tag, "Name");
        records.push(in_folder(record, program));
    }
    if let Some(first) = others.first() {
        skipped.report(
            first.range().start,
            format!(
                "{} tags that are no aliases of a module's inputs or outputs, \"{}\" the first: skipped",
                others.len(),
                shown(first.attribute("Name").unwrap_or_default())
            ),
            "make aliases of those that the simulation needs",
        );
    }
    records
}

/// The type of a point whose module is not in the file, by its radix, or by the member names of modules that have a
/// structure per point: `Local:1:I.Pt00.Data`, `Local:2:I.Ch03.Data`.
fn kind_by_name(path: &str, is_float: bool) -> Option<&'static str> {
    if bit(path).is_some() {
        return Some("BOOL");
    }
    if is_float {
        return Some("REAL");
    }
    let (point, member) = path.rsplit_once('.')?;
    let (letters, number) = point.rsplit_once('.')?.1.split_at_checked(2)?;
    if !member.eq_ignore_ascii_case("Data") || number.parse::<u8>().is_err() {
        None
    } else if letters.eq_ignore_ascii_case("Pt") {
        Some("BOOL")
    } else {
        letters.eq_ignore_ascii_case("Ch").then_some("REAL")
    }
}

/// The point of a comment, and its type: `.PT00` and `.PT00.DATA` are one point.
fn commented_point(operand: &str) -> Option<(String, &'static str)> {
    let kind = |member: &str| kind_by_name(&format!("I{member}"), false);
    if let Some(kind) = kind(operand) {
        return Some((operand.to_owned(), kind));
    }
    let data = format!("{operand}.DATA");
    kind(&data).map(|kind| (data, kind))
}

/// Reports an alias of a structure that is not in the `file`; points with a comment may be known.
fn unknown(skipped: &Collector<'_>, at: usize, target: &str, has_points: bool, file: &str) {
    let target = shown(target);
    let what = if has_points {
        format!(
            "of \"{target}\" only the points with a comment stand in the {file}: the others are skipped"
        )
    } else {
        format!("the type of \"{target}\" stands nowhere in the {file}: skipped")
    };
    skipped.report(
        at,
        what,
        "export the whole controller as L5X, with its modules, or add a [[signal]] by hand",
    );
}

fn cells(texts: [&str; 4], at: [usize; 4]) -> Record {
    let cells = texts.into_iter().zip(at);
    let cells = cells.map(|(text, at)| Cell {
        text: text.to_owned(),
        at,
    });
    cells.collect()
}
