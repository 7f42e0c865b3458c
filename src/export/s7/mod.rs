//! SCL sources for TIA Portal: an S7-1500, or an S7-1200.
//!
//! Three sources, in the order in which TIA Portal is to read them: the types and data blocks of both images, the
//! block that talks to the simulation, and the two that go at the beginning and the end of OB1.

mod connection;
mod copy;
mod data;
mod link;
mod members;
mod modbus;
mod s7comm;
mod socket;

use std::collections::HashMap;
use std::fmt::Write as _;

use super::names::Names;
use super::record::{Group, Record, Shape, block_prefix};
use super::{Export, File, head};
use crate::driver::Config;
use crate::signal::Area;
use members::{Member, Members, byte_names, is_native};

/// Everything that the texts need to know.
struct Plan<'a> {
    config: &'a Config,
    /// What the names of all blocks begin with.
    prefix: String,
    inputs: Image<'a>,
    outputs: Image<'a>,
}

/// One direction as a structure.
struct Image<'a> {
    record: Record<'a>,
    /// Name of its type.
    type_name: String,
    /// Name of its data block.
    block: String,
    members: Vec<Member>,
    /// Types of structures in it: name, members, bytes.
    types: Vec<(String, Vec<Member>)>,
    /// For each place of the record, where its value is in the structure: one path, or one for each of its bytes.
    paths: Vec<Path>,
}

/// Where a signal's value is in a structure, with dots and quotation marks.
enum Path {
    Value(String),
    Bytes(Vec<String>),
}

impl<'a> Image<'a> {
    fn of(config: &'a Config, area: Area, prefix: &str) -> Self {
        let mut names = Names::default();
        let record = Record::of(&config.table, area, &mut names);
        let (word, kind) = match area {
            Area::Input => ("inputs", "feedback"),
            Area::Output => ("outputs", "command"),
        };
        let groups = record.groups();
        let group_names: Vec<String> = groups.iter().map(|group| names.give(&group.name)).collect();
        let mut uses: HashMap<Shape, usize> = HashMap::new();
        for group in &groups {
            *uses.entry(group.shape()).or_insert(0) += 1;
        }
        let mut known: HashMap<Shape, String> = HashMap::new();
        let mut types = Vec::new();
        let mut type_of = Vec::with_capacity(groups.len());
        for (group, name) in groups.iter().zip(&group_names) {
            let shape = group.shape();
            let type_name = known.entry(shape).or_insert_with_key(|shape| {
                let name = if uses[shape] > 1 {
                    format!("{prefix}_{kind}_{}", types.len() + 1)
                } else {
                    format!("{prefix}_{kind}_{name}")
                };
                types.push((name.clone(), Members::of_group(group)));
                name
            });
            type_of.push(type_name.clone());
        }
        let members = Members::of_record(&record, &groups, &type_of, &group_names);
        let paths = paths(&record, &groups, &group_names);
        Self {
            members,
            paths,
            types,
            type_name: format!("{prefix}_{word}"),
            block: format!(
                "{prefix}_{}",
                if area == Area::Input { "in" } else { "out" }
            ),
            record,
        }
    }
}

fn paths(record: &Record<'_>, groups: &[Group<'_, '_>], group_names: &[String]) -> Vec<Path> {
    let mut paths: Vec<Path> = Vec::with_capacity(record.places.len());
    let mut groups = groups.iter().zip(group_names).peekable();
    while let Some(place) = record.places.get(paths.len()) {
        let mut add = |place: &super::record::Place<'_>, before: &str, name: &str| {
            paths.push(if is_native(place, place.byte) {
                Path::Value(format!("{before}\"{name}\""))
            } else {
                let names = byte_names(name, place.size());
                Path::Bytes(
                    names
                        .iter()
                        .map(|name| format!("{before}\"{name}\""))
                        .collect(),
                )
            });
        };
        if let Some((group, name)) = groups.next_if(|(group, _)| group.byte == place.byte) {
            for (place, member) in group.places.iter().zip(group.members()) {
                add(place, &format!("\"{name}\"."), &member);
            }
        } else {
            add(place, "", &place.name);
        }
    }
    paths
}

/// The sources for `config`.
pub(super) fn export(config: &Config) -> Export {
    let prefix = block_prefix(&config.name);
    let plan = Plan {
        inputs: Image::of(config, Area::Input, &prefix),
        outputs: Image::of(config, Area::Output, &prefix),
        config,
        prefix,
    };
    let mut notes = Vec::new();
    let link = link::text(&plan, &mut notes);
    let file = |number: usize, what: &str, text: String| File {
        name: format!("{}_{number}_{what}.scl", plan.prefix),
        text,
    };
    let mut files = vec![
        file(1, "data", data::text(&plan)),
        file(2, "link", link),
        file(3, "copy", copy::text(&plan)),
    ];
    files.push(File {
        name: format!("{}_README.txt", plan.prefix),
        text: readme(&plan, &notes),
    });
    Export { files, notes }
}

/// The head of a source. It begins with the mark by which TIA Portal knows UTF-8.
fn source(plan: &Plan<'_>, what: &str) -> String {
    let mut text = String::from("\u{feff}");
    for line in head_lines(plan.config, what) {
        text.push_str("// ");
        text.push_str(&line);
        text.push_str("\r\n");
    }
    text.push_str("\r\n");
    text
}

fn head_lines(config: &Config, what: &str) -> Vec<String> {
    let mut lines = head(
        config,
        what,
        "TIA Portal, S7-1500 or S7-1200",
        "Never compiled in TIA Portal: expect to correct a line, and tell us which.",
    );
    lines.extend(Record::stations(&config.table));
    lines
}

/// Adds a line; sources have the line ends of Windows.
fn line(text: &mut String, content: &str) {
    write!(text, "{content}\r\n").expect("a String takes all");
}

/// What to do with the files, step by step.
fn readme(plan: &Plan<'_>, notes: &[String]) -> String {
    let prefix = &plan.prefix;
    let mut text = String::new();
    for head in head_lines(plan.config, "How to use the files beside this one.") {
        line(&mut text, &head);
    }
    line(&mut text, "");
    let mut steps = vec![format!(
        "External source files > Add new external file: {prefix}_1_data.scl, {prefix}_2_link.scl, {prefix}_3_copy.scl. \
             Generate blocks from source, in this order."
    )];
    steps.extend(link::steps(plan));
    steps.extend([
        format!(
            "Make an instance data block \"{prefix}_link_DB\" for the function block \"{prefix}_link\", unless the source \
             has made it."
        ),
        format!("OB1, first network: call \"{prefix}_begin\". OB1, last network: call \"{prefix}_end\"."),
        format!(
            "While \"{prefix}\".Simulated is TRUE, %I comes from the simulation. While it is FALSE, its start value, \
             both blocks do nothing and the connection is closed: the same program runs the real machine."
        ),
        "Outputs are copied, not taken away: with real output modules plugged, the real machine moves as well. Leave \
         them out of the hardware configuration, or switch their power off."
            .to_owned(),
        format!(
            "{prefix}_tags.csv has name, address, type and comment of every signal; paste its columns from a spreadsheet \
             into a tag table."
        ),
    ]);
    for (number, step) in steps.iter().enumerate() {
        line(&mut text, &format!("{}. {step}", number + 1));
    }
    if !notes.is_empty() {
        line(&mut text, "");
        for note in notes {
            line(&mut text, &format!("Note: {note}"));
        }
    }
    text
}
