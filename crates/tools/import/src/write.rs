//! Writes the driver.cfg for a table.

use std::fmt::Write as _;
use std::path::Path;

use super::device::Client;
use super::rows::{Tag, World};
use tickbus_base::toml_text::is_unprintable;
use tickbus_image::signal::{Address, Addressing, ByteOrder, NOTE_LIMIT, Width};

/// The text of a driver.cfg with these tags.
pub(super) fn driver_cfg(file: &Path, tags: &[Tag], world: World) -> String {
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
         # Directions are the PLC's: %I is a PLC input, which the simulation writes; %Q is a PLC output, which it reads.\n\
         {}{}\n\
         [driver]\n\
         id   = 1                       # a number that no other driver of the simulator has\n\
         name = {}\n{}\n\
         [fieldbus]\n{}",
        note(&source),
        remark(world),
        if matches!(world, World::Image(_)) && tags.iter().any(|tag| !tag.at.is_empty()) {
            ASSIGNED
        } else {
            ""
        },
        text(name),
        match addressing(world) {
            Addressing::Elements => COUNTS_ELEMENTS,
            Addressing::Bytes => "",
        },
        bus(world)
    );
    if matches!(world, World::Device(_)) {
        out.push_str("\n[fieldbus.at]\n");
        for tag in tags {
            writeln!(out, "{} = {}", text(&tag.name), text(&tag.at)).expect("a String takes all");
        }
    }
    for tag in tags {
        signal(&mut out, tag, world);
    }
    out
}

/// Adds proposed replies.
pub(super) fn replies(out: &mut String, sections: &[&str]) {
    if sections.is_empty() {
        return;
    }
    out.push_str(
        "\n# Proposed by the names of the signals: read them, and write the times of your machine into them (docs/replies.md).\n",
    );
    for section in sections {
        out.push('\n');
        out.push_str(section);
    }
}

/// The key with which the addresses stay as the PLC has them, here and for a hosted program.
const COUNTS_ELEMENTS: &str =
    "addressing = \"iec\"             # as in the PLC: %IW1 is the second word\n";

/// The unit of the numbers in the addresses that are written.
const fn addressing(world: World) -> Addressing {
    match world {
        World::Image(image) => image.addressing,
        World::Device(_) | World::Modules => Addressing::Bytes,
    }
}

/// An address in the unit of the file.
fn printed(address: Address, addressing: Addressing) -> String {
    match (addressing, address.width) {
        (Addressing::Bytes, _) | (_, Width::Bit) => address.to_string(),
        (Addressing::Elements, width) => {
            let number = address.byte / width.bytes();
            format!("{}{}{number}", address.area, width.letter())
        }
    }
}

/// The remark about addresses that do not exist in the PLC.
const ASSIGNED: &str = "# Signals with another address in their remark have that one in the PLC, and here one that import assigned, in order:\n\
                        # let the PLC's program or its I/O configuration copy between the two.\n";

/// The remark about the addresses below it.
const fn remark(world: World) -> &'static str {
    match world {
        World::Image(_) => "",
        World::Device(_) => {
            "# Where each signal lies in the device stands in [fieldbus.at]. A list of tags does not say who writes a tag: those\n\
             # that can be both are read. Where the simulation is to write one, change the %Q of its address into %I; what\n\
             # stays free in %Q does no harm.\n"
        }
        World::Modules => {
            "# The inputs and outputs of the modules, laid out one after another: the PLC's program copies between them and the bus.\n"
        }
    }
}

/// The keys of `[fieldbus]`.
const fn bus(world: World) -> &'static str {
    match world {
        World::Image(_) => {
            "kind    = \"socket\"             # docs/which-bus.md tells which bus suits which PLC\n\
             address = \"127.0.0.1:20030\"\n"
        }
        World::Device(Client::Modbus) => {
            "kind    = \"modbus-client\"\n\
             address = \"192.168.0.1:502\"    # put the device's address here\n\
             # Nothing is written until write_to names the device: docs/modbus.md. Values of 32 bits whose words come in the\n\
             # other order (KEPServer: \"First word low\", which is its default) need order = \"CDAB\" in their [[signal]].\n"
        }
        World::Device(Client::S7) => {
            "kind    = \"s7-client\"\n\
             address = \"192.168.0.1\"        # put the CPU's address here; slot = 2 for an S7-300\n\
             # Nothing is written until write_to names the CPU: docs/s7.md.\n"
        }
        World::Modules => {
            "kind    = \"modbus-server\"      # docs/which-bus.md tells which bus suits which PLC\n\
             address = \"127.0.0.1:1502\"     # 0.0.0.0:502 for other machines\n"
        }
    }
}

fn signal(out: &mut String, tag: &Tag, world: World) {
    let Some(address) = tag.address else {
        return;
    };
    let mut remark = String::new();
    if !matches!(world, World::Device(_)) && !tag.at.is_empty() && tag.at != tag.name {
        remark = format!("   # {}", note(&tag.at));
    }
    out.push_str("\n[[signal]]\n");
    let mut line = |key: &str, value: String| {
        writeln!(out, "{key:<7} = {value}").expect("a String takes all");
    };
    line("name", text(&tag.name));
    line(
        "address",
        format!("\"{}\"{remark}", printed(address, addressing(world))),
    );
    if address.width.data_type() != tag.data_type {
        line("type", format!("\"{}\"", tag.data_type));
    }
    if tag.order != ByteOrder::default() {
        line("order", format!("\"{}\"", tag.order));
    }
    if let Some(unit) = &tag.unit {
        line("unit", text(unit));
    }
    if let Some([low, high, from, to]) = tag.scale {
        line(
            "scale",
            format!("{{ raw = [{low:?}, {high:?}], value = [{from:?}, {to:?}] }}"),
        );
    }
    for (key, words) in [("comment", &tag.comment), ("folder", &tag.folder)] {
        let words = note(words);
        if !words.is_empty() {
            line(key, text(&words));
        }
    }
}

/// A text of TOML, in quotes.
pub(super) fn text(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// A text as the value of "comment" or "folder": one line, of printable characters, not too long.
pub fn note(text: &str) -> String {
    let printable: String = text
        .chars()
        .map(|c| if c.is_whitespace() { ' ' } else { c })
        .filter(|c| !is_unprintable(*c))
        .collect();
    let note: String = printable.trim().chars().take(NOTE_LIMIT).collect();
    note.trim_end().to_owned()
}
