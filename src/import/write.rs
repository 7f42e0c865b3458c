//! The driver.cfg that a table becomes.

use std::fmt::Write as _;
use std::path::Path;

use super::rows::Tag;
use crate::signal::ByteOrder;

/// The longest comment that is taken over, in characters.
const LONGEST_COMMENT: usize = 200;

/// The text of a driver.cfg with these tags.
pub(super) fn driver_cfg(file: &Path, tags: &[Tag]) -> String {
    let source = file
        .file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default();
    let stem = file
        .file_stem()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default();
    let name: String = stem.chars().filter(|c| !c.is_control()).take(100).collect();
    let name = if name.trim().is_empty() {
        "Machine"
    } else {
        name.trim()
    };
    let mut out = format!(
        "# Made by tickbus import from {}.\n\
         #\n\
         # Directions are the PLC's: %I is a PLC input, which the simulation writes; %Q is a PLC output, which it reads.\n\n\
         [driver]\n\
         id   = 1                       # a number that no other driver of the simulator has\n\
         name = {}\n\n\
         [fieldbus]\n\
         kind    = \"socket\"             # docs/which-bus.md tells which bus suits which PLC\n\
         address = \"127.0.0.1:20030\"\n",
        comment(&source),
        text(name)
    );
    for tag in tags {
        let Tag {
            address, data_type, ..
        } = tag;
        out.push_str("\n[[signal]]\n");
        writeln!(out, "name    = {}", text(&tag.name)).expect("a String takes all");
        let remark = comment(&tag.comment);
        let remark = if remark.is_empty() {
            remark
        } else {
            format!("   # {remark}")
        };
        writeln!(out, "address = \"{address}\"{remark}").expect("a String takes all");
        if address.width.data_type() != *data_type {
            writeln!(out, "type    = \"{data_type}\"").expect("a String takes all");
        }
        if tag.order != ByteOrder::default() {
            writeln!(out, "order   = \"{}\"", tag.order).expect("a String takes all");
        }
        if let Some(unit) = &tag.unit {
            writeln!(out, "unit    = {}", text(unit)).expect("a String takes all");
        }
    }
    out
}

/// A text of TOML, in quotes.
fn text(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// A text that may stand in a comment.
fn comment(text: &str) -> String {
    let mut comment: String = text
        .chars()
        .filter(|c| !c.is_control())
        .take(LONGEST_COMMENT)
        .collect();
    comment.truncate(comment.trim_end().len());
    comment
}
