//! SCL sources for TIA Portal, for an S7-1500 or an S7-1200, and the tags in TIA Portal's import format.
//!
//! Three sources, in the order in which TIA Portal has to read them: the types and data blocks of both
//! images, the block that communicates with the simulation, and the two blocks for the beginning and the end
//! of OB1.

mod body;
mod connection;
mod copy;
mod data;
mod link;
mod members;
mod modbus;
mod readme;
mod s7comm;
mod socket;
mod tags;

use std::fmt::Write as _;

use super::names::Names;
use super::record::{Record, block_prefix};
use super::{Export, File, head};
use members::{Member, Members};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::{Area, Width};

/// The supported CPUs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cpu {
    S71500,
    S71200,
}

impl Cpu {
    const fn name(self) -> &'static str {
        match self {
            Self::S71500 => "S7-1500",
            Self::S71200 => "S7-1200",
        }
    }

    /// Returns true if 64-bit values can be in %I, %Q and blocks with standard access. An S7-1200 has no `LWord`,
    /// `LInt` and `ULInt`, and cannot address an `LReal`.
    const fn has_long(self) -> bool {
        matches!(self, Self::S71500)
    }

    /// The most bytes of one GET and one PUT. An S7-1200 fails above these numbers (system manual V4.2.3, PUT and GET
    /// with `ADDR_1` only). An S7-1500 negotiates a larger PDU: 400 bytes fit into one of 480.
    const fn get_and_put(self) -> (usize, usize) {
        match self {
            Self::S71500 => (400, 400),
            Self::S71200 => (222, 212),
        }
    }
}

/// The input of all texts.
struct Plan<'a> {
    config: &'a Config,
    cpu: Cpu,
    /// The prefix of all block names.
    prefix: String,
    inputs: Image<'a>,
    outputs: Image<'a>,
}

/// One direction as a structure.
struct Image<'a> {
    record: Record<'a>,
    /// The name of the structure's type.
    type_name: String,
    /// The name of the structure's data block.
    block: String,
    members: Vec<Member>,
}

impl<'a> Image<'a> {
    fn of(config: &'a Config, area: Area, prefix: &str, cpu: Cpu) -> Self {
        let record = Record::of(&config.table, area, &mut Names::default());
        let (word, block) = match area {
            Area::Input => ("inputs", "in"),
            Area::Output => ("outputs", "out"),
        };
        Self {
            members: Members::of(&record, cpu),
            type_name: format!("{prefix}_{word}"),
            block: format!("{prefix}_{block}"),
            record,
        }
    }

    /// A member in quotation marks.
    fn member(&self, name: &str) -> String {
        format!("\"{}\".Image.\"{name}\"", self.block)
    }
}

/// The sources for `config`.
pub(super) fn export(config: &Config, cpu: Cpu) -> Export {
    let prefix = block_prefix(&config.name);
    let plan = Plan {
        inputs: Image::of(config, Area::Input, &prefix, cpu),
        outputs: Image::of(config, Area::Output, &prefix, cpu),
        config,
        cpu,
        prefix,
    };
    let mut notes = Vec::new();
    let link = link::body(&plan, &mut notes);
    notes.extend(long_values(&plan));
    let file = |number: usize, what: &str, text: String| File {
        name: format!("{}_{number}_{what}.scl", plan.prefix),
        text,
    };
    let mut files = vec![
        file(1, "data", data::text(&plan, &link)),
        file(2, "link", link::text(&plan, &link)),
        file(3, "copy", copy::text(&plan)),
    ];
    files.push(File {
        name: format!("{}_README.txt", plan.prefix),
        text: readme::text(&plan, &notes),
    });
    files.push(tags::file(&plan));
    Export { files, notes }
}

/// A note about values for which the CPU has no type.
fn long_values(plan: &Plan<'_>) -> Option<String> {
    let images = [&plan.inputs, &plan.outputs];
    let places = images.into_iter().flat_map(|image| &image.record.places);
    let names: Vec<String> = places
        .filter(|place| !plan.cpu.has_long() && place.data_type().width() == Width::Long)
        .map(|place| format!("\"{}\" ({})", place.signal.name, place.data_type()))
        .collect();
    (!names.is_empty()).then(|| {
        format!(
            "an S7-1200 has no values of 64 bits in %I and %Q: {} lie there as eight bytes each, the most significant first \
             unless a byte order is stated",
            names.join(", ")
        )
    })
}

/// The head of a source. The byte order mark at the start makes TIA Portal recognise UTF-8.
fn source(plan: &Plan<'_>, what: &str) -> String {
    let mut text = String::from("\u{feff}");
    for head in head_lines(plan, what) {
        line(&mut text, &format!("// {head}"));
    }
    line(&mut text, "");
    text
}

fn head_lines(plan: &Plan<'_>, what: &str) -> Vec<String> {
    let mut lines = head(
        plan.config,
        what,
        &format!("TIA Portal, {}", plan.cpu.name()),
        "Never compiled in TIA Portal: expect to correct a line, and tell us which.",
    );
    lines.extend(Record::stations(&plan.config.table));
    lines
}

/// Adds a line; sources have Windows line ends.
fn line(text: &mut String, content: &str) {
    write!(text, "{content}\r\n").expect("a String takes all");
}
