//! Structured Text: for CODESYS and TwinCAT, and for `OpenPLC` and others that compile with `iec2c`.
//!
//! The sources hold the records as 16-bit registers, as Modbus transfers them, and copy between these and one variable
//! per signal.

pub(super) mod codesys;
mod life;
pub(super) mod openplc;
mod registers;
mod telegrams;

use std::fmt::Write as _;

use super::head;
use super::names::Names;
use super::record::{PlacedSignal, Record};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::{Area, DataType, Width};

/// Names that the sources use themselves.
const TAKEN: [&str; 6] = ["Simulated", "In", "Out", "bits_32", "bits_64", "Hardware"];

/// The names that a source declares in addition to its signals: the common ones, and `more`.
fn taken(more: impl IntoIterator<Item = String>) -> Names {
    let mut names = Names::default();
    for name in TAKEN {
        names.give(name);
    }
    for name in more {
        names.give(&name);
    }
    names
}

/// Both records, each station at a multiple of `aligned` bytes; names are unique across both directions.
fn records<'a>(config: &'a Config, aligned: usize, names: &mut Names) -> [Record<'a>; 2] {
    [Area::Input, Area::Output].map(|area| Record::aligned(&config.table, area, aligned, names))
}

/// Adds a line.
fn add(text: &mut String, content: &str) {
    writeln!(text, "{content}").expect("a String takes all");
}

/// The variables used by the statements for a record of outputs: name and type.
fn temporaries(outputs: &Record<'_>) -> Vec<(&'static str, &'static str)> {
    let has = |width| {
        let mut places = outputs.places.iter();
        places.any(|place| place.data_type().width() == width)
    };
    let all = [
        (Width::Double, ("bits_32", "DWORD")),
        (Width::Long, ("bits_64", "LWORD")),
    ];
    let needed = all.into_iter().filter(|(width, _)| has(*width));
    needed.map(|(_, variable)| variable).collect()
}

/// A comment of IEC 61131-3.
fn comment(text: &str) -> String {
    // Not every compiler supports nested comments.
    let text = text.replace("(*", "( *").replace("*)", "* )");
    format!("(* {text} *)")
}

/// The head of a source; each station starts at a multiple of `aligned` bytes.
fn source(config: &Config, aligned: usize, what: &str, editor: &str, compiled: &str) -> String {
    let mut lines = head(config, what, editor, compiled);
    lines.extend(Record::stations_aligned(&config.table, aligned));
    let mut text = String::new();
    for line in lines {
        text.push_str(&comment(&line));
        text.push('\n');
    }
    text.push('\n');
    text
}

/// The comment of a signal's variable.
fn remark(place: &PlacedSignal<'_>) -> String {
    let mut text = place.remark();
    if place.data_type() == DataType::Lreal {
        text.push_str(", the bits of an LREAL");
    }
    text
}

/// The statements that copy the inputs, and those that copy the outputs, given how registers are written.
fn copies(
    [inputs, outputs]: &[Record<'_>; 2],
    variable: &dyn Fn(&str) -> String,
    incoming: registers::Register<'_>,
    outgoing: registers::Register<'_>,
) -> [Vec<String>; 2] {
    let bring = inputs
        .places
        .iter()
        .map(|place| {
            format!(
                "{} := {};",
                variable(&place.name),
                registers::value(place, incoming)
            )
        })
        .collect();
    let mut used: Vec<usize> = outputs
        .places
        .iter()
        .flat_map(|place| place.byte / 2..=(place.end() - 1) / 2)
        .collect();
    used.dedup();
    let mut take: Vec<String> = used
        .iter()
        .map(|register| format!("{} := WORD#16#0000;", outgoing(*register)))
        .collect();
    for place in &outputs.places {
        take.extend(registers::put(place, &variable(&place.name), outgoing));
    }
    [bring, take]
}
