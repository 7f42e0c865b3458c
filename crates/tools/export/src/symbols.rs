//! The symbol table as CSV, for spreadsheets and for `tickbus import`.

use std::fmt::Write as _;

use super::File;
use super::names::Names;
use super::record::{PlacedSignal, Record, block_prefix, facts};
use super::siemens::{address, spelling};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Area;

/// The file. It starts with the byte order mark that spreadsheets look for.
pub(super) fn file(config: &Config) -> File {
    let mut text = String::from("\u{feff}name;address;type;comment\r\n");
    let mut names = Names::default();
    for area in [Area::Input, Area::Output] {
        for place in &Record::of(&config.table, area, &mut names).places {
            let cells = [
                place.signal.name.clone(),
                address(place),
                spelling(place.data_type()).to_owned(),
                comment(place, area),
            ];
            let cells = cells.map(|cell| quoted(&cell));
            write!(text, "{}\r\n", cells.join(";")).expect("a String takes all");
        }
    }
    let name = format!("{}_tags.csv", block_prefix(&config.name));
    File { name, text }
}

/// The comment of a signal, or its direction, station, unit and scale if it has none.
pub(super) fn comment(place: &PlacedSignal<'_>, area: Area) -> String {
    // Alone, so that the comment stays the same when a PLC tool reads the list and tickbus reads that tool's list.
    if !place.signal.comment().is_empty() {
        return place.signal.comment().to_owned();
    }
    let mut parts = vec![
        match area {
            Area::Input => "simulation to PLC",
            Area::Output => "PLC to simulation",
        }
        .to_owned(),
    ];
    if !place.station.is_empty() {
        parts.push(format!("station {}", place.station));
    }
    parts.extend(facts(place.signal));
    parts.join(", ")
}

/// A cell, in quotes if necessary.
fn quoted(cell: &str) -> String {
    // A spreadsheet would take these for formulas.
    if cell.contains([';', '"', ',', '\t']) || cell.starts_with(['=', '+', '-', '@', '#', ' ']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}
