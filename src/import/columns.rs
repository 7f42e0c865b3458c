//! Which column has what: by its heading, or by what stands in it.

use super::address::{Place, place};
use super::cells::Record;
use crate::signal::Addressing;

/// The columns of a table, and its first record below the headings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Columns {
    pub(super) name: usize,
    pub(super) address: usize,
    pub(super) kind: Option<usize>,
    pub(super) comment: Option<usize>,
    pub(super) unit: Option<usize>,
    pub(super) order: Option<usize>,
    pub(super) first: usize,
}

/// What headings are called in English and German editors, in small letters.
const NAMES: &[&str] = &[
    "name",
    "symbol",
    "tag",
    "tag name",
    "tagname",
    "signal",
    "variable",
    "symbolname",
];
const ADDRESSES: &[&str] = &[
    "address",
    "logical address",
    "absolute address",
    "adresse",
    "logische adresse",
    "operand",
    "addr",
];
const TYPES: &[&str] = &["type", "data type", "datatype", "datentyp", "typ"];
const COMMENTS: &[&str] = &[
    "comment",
    "description",
    "kommentar",
    "beschreibung",
    "bemerkung",
];
const UNITS: &[&str] = &["unit", "einheit"];
const ORDERS: &[&str] = &["order", "byte order"];

/// How many records are looked at where there are no headings.
const LOOK: usize = 50;

/// The columns, if one of them has addresses.
pub(super) fn find(records: &[Record]) -> Option<Columns> {
    let head = records.first()?;
    let called = |words: &[&str]| {
        head.iter()
            .position(|cell| words.contains(&cell.text.to_lowercase().as_str()))
    };
    if let Some(address) = called(ADDRESSES) {
        return Some(Columns {
            name: called(NAMES).unwrap_or(usize::from(address == 0)),
            address,
            kind: called(TYPES),
            comment: called(COMMENTS),
            unit: called(UNITS),
            order: called(ORDERS),
            first: 1,
        });
    }
    // Without headings: name; address; type; comment, as ours and the SDF files of TIA Portal and STEP 7 begin; the
    // comment of an SDF file stands behind some flags.
    let looked = &records[..records.len().min(LOOK)];
    let width = looked.iter().map(Vec::len).max().unwrap_or(0);
    let is_address = |record: &Record, column: usize| {
        let cell = record.get(column);
        cell.is_some_and(|cell| !matches!(place(&cell.text, Addressing::Bytes), Place::Nothing))
    };
    let hits = |column: usize| {
        looked
            .iter()
            .filter(|record| is_address(record, column))
            .count()
    };
    let address = (0..width)
        .rev()
        .max_by_key(|column| hits(*column))
        .filter(|column| hits(*column) > 0)?;
    let kind = (address + 1 < width).then_some(address + 1);
    let is_flag = |text: &str| matches!(text.to_lowercase().as_str(), "" | "true" | "false");
    let comment = (address + 2..width).find(|column| {
        looked
            .iter()
            .any(|record| record.get(*column).is_some_and(|cell| !is_flag(&cell.text)))
    });
    Some(Columns {
        name: usize::from(address == 0),
        address,
        kind,
        comment,
        unit: None,
        order: None,
        first: 0,
    })
}
