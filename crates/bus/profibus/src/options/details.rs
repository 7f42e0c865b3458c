//! A station's details, for `tickbus check`: its device, modules and parameters.

use std::ops::Range;
use std::path::Path;

use tickbus_base::toml_text::shown;
use tickbus_image::signal::Area;

use super::station::read_gsd;
use super::{Device, StationOptions};
use crate::configuration::{SlotModule, hex};
use crate::device::LineOptions;
use crate::station::Identity;

impl StationOptions {
    /// The lines, each with its heading; `None` for a station with mistakes. `line` is the line of a device, which
    /// answers there.
    pub(super) fn details(
        &self,
        line: Option<&LineOptions>,
        folder: &Path,
        identity: &Identity,
        has_places: [bool; 2],
    ) -> Option<Vec<(String, String)>> {
        let mut lines = Vec::new();
        let mut put = |head: &str, text: String| lines.push((head.to_owned(), text));
        let (address, ident) = (self.address, identity.ident);
        let mut notes = Vec::new();
        if let Device::Gsd { file, .. } = &self.device {
            let gsd = read_gsd(&folder.join(file)).ok()?;
            let (model, vendor) = (shown(&gsd.model), shown(&gsd.vendor));
            let text = format!("station {address}: \"{model}\" of \"{vendor}\", ident {ident:04X}");
            put("device", text);
            if let Some(line) = line {
                let baud = line.settings.baud;
                match gsd.rates.get(&baud) {
                    None => notes.push(format!("its GSD file does not support {baud} baud")),
                    Some(most) if line.max_tsdr > *most => notes.push(format!(
                        "this end answers within {} bits, its GSD file says {most}: set a longer slot time in the \
                         PLC's project",
                        line.max_tsdr
                    )),
                    Some(_) => {}
                }
            }
        } else {
            put(
                "device",
                format!("station {address}: ident {ident:04X}, without a GSD file"),
            );
        }
        if identity.configuration.has_sizes_only() {
            put("slots", "any modules that have these sizes".to_owned());
        } else {
            for (slot, module) in (1..).zip(identity.configuration.modules()) {
                put(&format!("slot {slot}"), in_words(module, has_places));
            }
        }
        for record in &identity.acyclic.records {
            let (count, plural) = (
                record.octets.len(),
                if record.octets.len() == 1 { "" } else { "s" },
            );
            let access = if record.is_writable {
                "read and written"
            } else {
                "read"
            };
            put(
                "record",
                format!(
                    "{} of slot {}: {count} octet{plural}, {access}",
                    record.index, record.slot
                ),
            );
        }
        for parameter in &identity.acyclic.parameters {
            let count = parameter.octets.len() / parameter.format.octets();
            let (elements, access) = (
                if parameter.is_array {
                    format!("[{count}]")
                } else {
                    String::new()
                },
                if parameter.is_writable {
                    "read and written"
                } else {
                    "read"
                },
            );
            put(
                "parameter",
                format!(
                    "{}{elements}, {:?}, {access}",
                    parameter.number, parameter.format
                ),
            );
        }
        let defaults = identity.user.defaults();
        if !defaults.is_empty() {
            put("Set_Prm", format!("{} by default", hex(defaults)));
        }
        for text in identity.user.in_words() {
            put("", text);
        }
        for text in notes {
            put("note", format!("station {address}: {text}"));
        }
        Some(lines)
    }
}

/// A module: its name, its identifiers, and the position of its bytes in the image; or in the telegrams, if signals of
/// the area have their own positions.
fn in_words(module: &SlotModule, has_places: [bool; 2]) -> String {
    let name = if module.name.is_empty() {
        String::new()
    } else {
        format!("\"{}\", ", shown(&module.name))
    };
    let areas = [
        (Area::Input, &module.inputs),
        (Area::Output, &module.outputs),
    ];
    let bytes: Vec<String> = areas
        .into_iter()
        .zip(has_places)
        .filter_map(|((area, range), has_places)| bytes(area, range, has_places))
        .collect();
    let bytes = if bytes.is_empty() {
        "no I/O".to_owned()
    } else {
        bytes.join(", ")
    };
    format!("{name}{}: {bytes}", hex(&module.identifiers))
}

fn bytes(area: Area, range: &Range<usize>, has_places: bool) -> Option<String> {
    let (first, last) = (range.start, range.end.checked_sub(1)?);
    let is_one = last.checked_sub(first)? == 0;
    let (letter, name) = match area {
        Area::Input => ('I', "inputs"),
        Area::Output => ('Q', "outputs"),
    };
    Some(match (has_places, is_one) {
        (false, true) => format!("%{letter}B{last}"),
        (false, false) => format!("%{letter}B{first} to %{letter}B{last}"),
        (true, true) => format!("byte {last} of the {name}"),
        (true, false) => format!("bytes {first} to {last} of the {name}"),
    })
}
