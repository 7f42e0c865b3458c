//! The tags of a table, each checked by itself and against those before it.

use std::collections::HashMap;

use super::address::{Place, place};
use super::cells::{Cell, Record};
use super::columns::Columns;
use crate::config::{Collector, did_you_mean, shown};
use crate::signal::section::NAME_LIMIT;
use crate::signal::{AREA_LIMIT, Address, Addressing, Area, ByteOrder, DataType, Width};

/// The most signals of one driver.cfg.
const MOST: usize = 100_000;

/// The longest unit, in characters.
const LONGEST_UNIT: usize = 40;

/// One tag that becomes a signal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Tag {
    pub(super) name: String,
    pub(super) address: Address,
    pub(super) data_type: DataType,
    pub(super) order: ByteOrder,
    pub(super) unit: Option<String>,
    pub(super) comment: String,
}

/// What the tags before have taken.
struct Taken {
    /// Line of each name.
    names: HashMap<String, usize>,
    /// For each bit of %I and %Q, the line of the tag that has it; 0 for none.
    bits: [Vec<u32>; 2],
}

/// Reads the records below the headings.
pub(super) fn read(
    records: &[Record],
    columns: &Columns,
    addressing: Addressing,
    wrong: &Collector<'_>,
    skipped: &Collector<'_>,
) -> Vec<Tag> {
    let mut taken = Taken {
        names: HashMap::new(),
        bits: [Vec::new(), Vec::new()],
    };
    let mut tags = Vec::new();
    for record in &records[columns.first..] {
        if tags.len() == MOST {
            wrong.report(
                record[0].at,
                format!("there are more than {MOST} tags in %I and %Q"),
                "split the table over several drivers",
            );
            break;
        }
        tags.extend(tag(record, columns, addressing, &mut taken, wrong, skipped));
    }
    tags
}

fn tag(
    record: &Record,
    columns: &Columns,
    addressing: Addressing,
    taken: &mut Taken,
    wrong: &Collector<'_>,
    skipped: &Collector<'_>,
) -> Option<Tag> {
    let cell = |column: Option<usize>| column.and_then(|column| record.get(column));
    let text = |column| cell(column).map_or("", |cell| cell.text.as_str());
    let Some(at_address) = cell(Some(columns.address)).filter(|cell| !cell.text.is_empty()) else {
        wrong.report(
            record[0].at,
            format!(
                "this line has no address: {}",
                quoted(text(Some(columns.name)))
            ),
            "write one such as %I0.0 or %QW4",
        );
        return None;
    };
    let address = match place(&at_address.text, addressing) {
        Place::Image(address) => address,
        Place::Elsewhere(what) => {
            skipped.report(
                at_address.at,
                format!(
                    "{} is {what}, no part of the process image: skipped",
                    quoted(&at_address.text)
                ),
                "let the PLC program copy it from %I or to %Q if the simulation needs it",
            );
            return None;
        }
        Place::Wrong(error) => {
            // A bit in a wide type is how TIA Portal writes addresses of 64 bits: judged below by the type.
            wrong.report(at_address.at, error.what, error.right);
            return None;
        }
        Place::Nothing => {
            wrong.report(
                at_address.at,
                format!("{} is no address", quoted(&at_address.text)),
                "addresses look like %I0.0, %IB4, %QW2, %ID8",
            );
            return None;
        }
    };
    let (data_type, address) = kind(cell(columns.kind), address, wrong)?;
    let name = name(cell(Some(columns.name)), at_address, wrong)?;
    let order = order(cell(columns.order), data_type, wrong)?;
    let line = wrong.line(record[0].at);
    if let Some(first) = taken.names.get(name) {
        wrong.report(
            cell(Some(columns.name)).unwrap_or(at_address).at,
            format!(
                "the name {} is that of the tag on line {first}",
                quoted(name)
            ),
            "give each tag a name of its own",
        );
        return None;
    }
    let bits = &mut taken.bits[usize::from(address.area == Area::Output)];
    let range = address.bits();
    if bits.len() < range.end {
        bits.resize(range.end, 0);
    }
    if let Some(first) = bits[range.clone()].iter().find(|line| **line > 0) {
        wrong.report(
            at_address.at,
            format!(
                "{} ({address}) overlaps the tag on line {first}",
                quoted(name)
            ),
            "each bit belongs to one signal: keep one of the two",
        );
        return None;
    }
    taken.names.insert(name.to_owned(), line);
    bits[range].fill(u32::try_from(line).unwrap_or(u32::MAX));
    let unit = text(columns.unit);
    let unit: String = unit
        .chars()
        .filter(|c| !c.is_control())
        .take(LONGEST_UNIT)
        .collect();
    let unit = unit.trim();
    Some(Tag {
        name: name.to_owned(),
        address,
        data_type,
        order,
        unit: (!unit.is_empty()).then(|| unit.to_owned()),
        comment: text(columns.comment).to_owned(),
    })
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", shown(text))
}

/// The type, and the address in its size.
fn kind(
    cell: Option<&Cell>,
    address: Address,
    wrong: &Collector<'_>,
) -> Option<(DataType, Address)> {
    let Some(cell) = cell.filter(|cell| !cell.text.is_empty()) else {
        return Some((address.width.data_type(), address));
    };
    let Ok(data_type) = cell.text.trim_matches('"').parse::<DataType>() else {
        let right = match cell.text.to_ascii_uppercase().as_str() {
            "TIME" => "a TIME is a DINT of milliseconds: write DINT".to_owned(),
            "CHAR" => "write BYTE or USINT".to_owned(),
            "TIME_OF_DAY" | "TOD" => "write UDINT".to_owned(),
            "DATE" => "write UINT".to_owned(),
            _ => did_you_mean(&cell.text, "types", &DataType::ALL.map(DataType::name)),
        };
        wrong.report(
            cell.at,
            format!("{} is no type that a signal can have", quoted(&cell.text)),
            right,
        );
        return None;
    };
    if data_type.width() == address.width {
        return Some((data_type, address));
    }
    // How TIA Portal writes addresses of types with 64 bits, which have no letter of their own there.
    if data_type.width() == Width::Long && address.width == Width::Bit && address.bit == 0 {
        let long = Address {
            width: Width::Long,
            ..address
        };
        if long.byte + Width::Long.bytes() <= AREA_LIMIT {
            return Some((data_type, long));
        }
    }
    let fitting: Vec<&str> = DataType::ALL
        .into_iter()
        .filter(|candidate| candidate.width() == address.width)
        .map(DataType::name)
        .collect();
    wrong.report(
        cell.at,
        format!(
            "{data_type} does not fit {address}: the one has {} bits, the other {}",
            data_type.width().bits(),
            address.width.bits()
        ),
        format!("{address} takes {}", fitting.join(", ")),
    );
    None
}

fn name<'c>(cell: Option<&'c Cell>, at_address: &Cell, wrong: &Collector<'_>) -> Option<&'c str> {
    let Some(cell) = cell.filter(|cell| !cell.text.is_empty()) else {
        wrong.report(
            at_address.at,
            format!("the tag at {} has no name", quoted(&at_address.text)),
            "give it one",
        );
        return None;
    };
    let name = cell.text.as_str();
    if name.chars().any(char::is_control) {
        wrong.report(
            cell.at,
            format!("the name {} has a control character in it", quoted(name)),
            "write it with printable characters only",
        );
    } else if name.starts_with("bus.") {
        wrong.report(
            cell.at,
            format!("the name {} begins with \"bus.\"", quoted(name)),
            "choose another; that beginning is kept for bus.age, bus.sequence, bus.status",
        );
    } else if name.chars().nth(NAME_LIMIT).is_some() {
        wrong.report(
            cell.at,
            format!(
                "the name {} is longer than {NAME_LIMIT} characters",
                quoted(name)
            ),
            "shorten it",
        );
    } else {
        return Some(name);
    }
    None
}

fn order(cell: Option<&Cell>, data_type: DataType, wrong: &Collector<'_>) -> Option<ByteOrder> {
    let Some(cell) = cell.filter(|cell| !cell.text.is_empty()) else {
        return Some(ByteOrder::default());
    };
    let known = ByteOrder::ALL
        .into_iter()
        .find(|order| order.name().eq_ignore_ascii_case(&cell.text));
    match known {
        Some(order) if data_type.size_bytes() > 1 || order == ByteOrder::default() => Some(order),
        _ => {
            wrong.report(
                cell.at,
                format!(
                    "{} is no byte order that a signal of type {data_type} can have",
                    quoted(&cell.text)
                ),
                "byte orders are ABCD, CDAB, BADC, DCBA, of values with two bytes and more",
            );
            None
        }
    }
}
