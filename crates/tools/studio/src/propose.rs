//! Free addresses for new signals.

use std::collections::BTreeMap;

use tickbus_image::signal::{Address, Addressing, Area, Width};
use toml_edit::{ArrayOfTables, DocumentMut, Table};

use crate::literal::cell;

const WIDTHS: [Width; 5] = [
    Width::Bit,
    Width::Byte,
    Width::Word,
    Width::Double,
    Width::Long,
];

/// The next free address behind all others of its area, by area and size: `IX` to `QL`. With several stations, in that
/// of the last signal.
pub(crate) fn next(document: &DocumentMut) -> BTreeMap<String, String> {
    let unit = addressing(document);
    let none = ArrayOfTables::new();
    let signals = document
        .get("signal")
        .and_then(|item| item.as_array_of_tables());
    let signals = signals.unwrap_or(&none);
    let station = |table: &Table| table.get("station").map(cell);
    let last = signals.iter().last().and_then(station);
    let mut found = BTreeMap::new();
    for area in [Area::Input, Area::Output] {
        let here = signals.iter().filter(|table| station(table) == last);
        let addresses = here.filter_map(|table| table.get("address").map(cell));
        let addresses = addresses.filter_map(|text| Address::parse(&text, unit).ok());
        let bits = addresses.filter(|address| address.area == area);
        let end = bits.map(|it| 8 * it.byte + usize::from(it.bit) + it.width.bits());
        let end = end.max().unwrap_or(0);
        for width in WIDTHS {
            let key = format!("{}{}", &area.to_string()[1..], width.letter());
            found.insert(key, free(area, width, end, unit));
        }
    }
    found
}

/// The unit of the numbers in the addresses of a file.
pub(crate) fn addressing(document: &DocumentMut) -> Addressing {
    let unit = document
        .get("driver")
        .and_then(|table| table.get("addressing"));
    if unit.map(cell).is_some_and(|unit| unit == "iec") {
        Addressing::Elements
    } else {
        Addressing::Bytes
    }
}

/// An address as a file with this unit writes it; `None` if it begins within an element.
pub(crate) fn written(address: Address, unit: Addressing) -> Option<String> {
    let bytes = address.width.bytes();
    if unit == Addressing::Bytes || address.width == Width::Bit {
        return Some(address.to_string());
    }
    let (area, letter) = (address.area, address.width.letter());
    address
        .byte
        .is_multiple_of(bytes)
        .then(|| format!("{area}{letter}{}", address.byte / bytes))
}

/// The first address of a size at or behind this bit.
fn free(area: Area, width: Width, end: usize, unit: Addressing) -> String {
    if width == Width::Bit {
        return format!("{area}X{}.{}", end / 8, end % 8);
    }
    let number = end.div_ceil(width.bits());
    let number = match unit {
        Addressing::Elements => number,
        Addressing::Bytes => number * width.bytes(),
    };
    format!("{area}{}{number}", width.letter())
}
