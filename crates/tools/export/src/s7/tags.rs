//! The tags in the format SDF, as TIA Portal exports and imports a tag table.
//!
//! Each line has nine quoted cells: name, address, type, three flags (visible in an HMI, accessible from it,
//! retentive), comment, supervision, writable from an HMI.

use std::fmt::Write as _;

use super::Plan;
use crate::File;
use crate::exported::Exported;
use crate::record::PlacedSignal;
use crate::siemens::{address, spelling};
use crate::symbols::comment;
use tickbus_image::signal::{Area, DataType, Signal, Width};

/// Returns true if `[fieldbus.at]` gives the place of a signal, and not the signal's address.
pub(super) fn is_elsewhere(plan: &Plan<'_>, signal: &Signal) -> bool {
    match Exported::of(&plan.config.bus) {
        Exported::S7Client(options) => options.variables.contains_key(&signal.name),
        Exported::ModbusClient(options) => options.at.contains_key(&signal.name),
        Exported::Loopback
        | Exported::Socket(_)
        | Exported::ModbusServer(_)
        | Exported::S7Server(_)
        | Exported::OpcuaClient
        | Exported::OpcuaServer(_)
        | Exported::ByHand => false,
    }
}

/// The file. Signals with a place from `[fieldbus.at]` already have tags in the PLC's program.
pub(super) fn file(plan: &Plan<'_>) -> File {
    let mut text = String::new();
    for (image, area) in [(&plan.inputs, Area::Input), (&plan.outputs, Area::Output)] {
        let places = image.record.places.iter();
        for place in places.filter(|place| !is_elsewhere(plan, place.signal)) {
            let comment = comment(place, area);
            let name = &place.signal.name;
            if place.data_type().width() != Width::Long {
                let kind = spelling(place.data_type());
                tag(&mut text, name, &address(place), kind, &comment);
            } else if plan.cpu.has_long() {
                let bit = format!("{area}{}.0", place.byte);
                tag(&mut text, name, &bit, spelling(place.data_type()), &comment);
            } else {
                halves(&mut text, place, area, &comment);
            }
        }
    }
    let name = format!("{}_tags.sdf", plan.prefix);
    File { name, text }
}

/// A 64-bit value if no type exists: two tags of 32 bits each, in order of their addresses.
fn halves(text: &mut String, place: &PlacedSignal<'_>, area: Area, comment: &str) {
    let kind = spelling(DataType::Dword);
    for (half, byte) in [("first half", place.byte), ("second half", place.byte + 4)] {
        let name = format!("{} ({half})", place.signal.name);
        let comment = format!("{comment}, {half} of a {}", place.data_type());
        tag(text, &name, &format!("{area}D{byte}"), kind, &comment);
    }
}

fn tag(text: &mut String, name: &str, address: &str, kind: &str, comment: &str) {
    let cells = [
        name, address, kind, "True", "True", "False", comment, "", "True",
    ];
    let cells = cells.map(|cell| format!("\"{}\"", cell.replace('"', "\"\"")));
    write!(text, "{}\r\n", cells.join(",")).expect("a String takes all");
}
