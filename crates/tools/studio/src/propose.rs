//! Free addresses for new signals.

use std::collections::BTreeMap;

use tickbus_image::signal::{Address, Addressing, Area, Width};
use toml_edit::{ArrayOfTables, DocumentMut};

use crate::literal::cell;

const AREAS: [Area; 2] = [Area::Input, Area::Output];

const WIDTHS: [Width; 5] = [
    Width::Bit,
    Width::Byte,
    Width::Word,
    Width::Double,
    Width::Long,
];

/// The next free address behind all others of its area, by station and by area and size: `IX` to `QL`. The station of
/// signals that name none is "".
pub(crate) fn next(document: &DocumentMut) -> BTreeMap<String, BTreeMap<String, String>> {
    let unit = addressing(document);
    ends(document)
        .into_iter()
        .map(|(station, ends)| (station, proposed(ends, unit)))
        .collect()
}

/// The bits behind the last address of each of [`AREAS`], by station.
fn ends(document: &DocumentMut) -> BTreeMap<String, [usize; 2]> {
    let unit = addressing(document);
    let none = ArrayOfTables::new();
    let signals = document
        .get("signal")
        .and_then(|item| item.as_array_of_tables());
    let mut ends = BTreeMap::from([(String::new(), [0; 2])]);
    for table in signals.unwrap_or(&none) {
        let text = |key| table.get(key).map(cell).unwrap_or_default();
        let ends: &mut [usize; 2] = ends.entry(text("station")).or_default();
        if let Ok(address) = Address::parse(&text("address"), unit) {
            let end = 8 * address.byte + usize::from(address.bit) + address.width.bits();
            let known = AREAS.iter().position(|area| *area == address.area);
            if let Some(known) = known.and_then(|area| ends.get_mut(area)) {
                *known = end.max(*known);
            }
        }
    }
    ends
}

/// Free addresses of a station, one after the other.
#[derive(Debug)]
pub(crate) struct Free {
    ends: [usize; 2],
    unit: Addressing,
}

impl Free {
    /// Those behind all addresses of a station, or of the signals that name none.
    pub(crate) fn of(document: &DocumentMut, station: &str) -> Self {
        Self {
            ends: ends(document).remove(station).unwrap_or_default(),
            unit: addressing(document),
        }
    }

    /// The next address of this area and size.
    pub(crate) fn take(&mut self, area: Area, width: Width) -> String {
        let place = AREAS.iter().position(|known| *known == area);
        let Some(end) = place.and_then(|place| self.ends.get_mut(place)) else {
            return String::new();
        };
        let text = free(area, width, *end, self.unit);
        *end = end.div_ceil(width.bits()) * width.bits() + width.bits();
        text
    }
}

/// The free addresses behind these bits of [`AREAS`].
fn proposed(ends: [usize; 2], unit: Addressing) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for (area, end) in AREAS.into_iter().zip(ends) {
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
