//! Finds the meaning of columns: by their headings, or by their contents.

use super::address::{ParsedAddress, place};
use super::cells::{Cell, Record};
use super::device;
use tickbus_base::toml_text::Collector;
use tickbus_image::signal::Addressing;

/// The columns of a table, and the first record after the headings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Columns {
    pub(super) name: usize,
    pub(super) address: usize,
    pub(super) kind: Option<usize>,
    pub(super) comment: Option<usize>,
    pub(super) folder: Option<usize>,
    pub(super) unit: Option<usize>,
    pub(super) order: Option<usize>,
    /// The direction column: direction, or KEPServer's client access.
    pub(super) direction: Option<usize>,
    /// KEPServer's scaling columns: type, two raw values, two scaled ones.
    pub(super) scale: Option<[usize; 5]>,
    pub(super) first: usize,
}

impl Columns {
    /// Name, address, type, comment, folder, without headings.
    pub(super) fn fixed() -> Self {
        Self {
            name: 0,
            address: 1,
            kind: Some(2),
            comment: Some(3),
            folder: Some(4),
            unit: None,
            order: None,
            direction: None,
            scale: None,
            first: 0,
        }
    }
}

/// The headings of English and German editors, in lower case.
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
/// TIA Portal calls the tag table and its groups a path.
const FOLDERS: &[&str] = &["path", "pfad", "folder", "ordner"];
const UNITS: &[&str] = &["unit", "einheit", "eng units", "eng. units"];
const DIRECTIONS: &[&str] = &["direction", "richtung", "client access"];
const SCALES: [&str; 5] = [
    "scaling",
    "raw low",
    "raw high",
    "scaled low",
    "scaled high",
];
const ORDERS: &[&str] = &["order", "byte order"];

/// The variables that CODESYS maps to channels, by its `//CoDeSys Mapping Export`: name, address, type, comment, folder.
/// `None` for any other table. Channels without a variable are reported to `skipped`.
pub(super) fn codesys_mapping(records: &[Record], skipped: &Collector<'_>) -> Option<Vec<Record>> {
    let head = records.first()?.first()?;
    if !head
        .text
        .to_ascii_lowercase()
        .starts_with("//codesys mapping")
    {
        return None;
    }
    let channels = records
        .iter()
        .filter(|record| record.len() > 4 && !record[0].text.starts_with("//"));
    let (mapped, free): (Vec<&Record>, Vec<&Record>) =
        channels.partition(|record| !record[0].text.is_empty());
    if let Some(first) = free.first() {
        skipped.report(
            first[0].at,
            format!("{} channels without a variable: skipped", free.len()),
            "map variables to those that the simulation needs",
        );
    }
    let mapped = mapped.into_iter().map(|record| {
        let kind = Cell {
            text: String::new(),
            at: record[4].at,
        };
        vec![
            record[0].clone(),
            record[4].clone(),
            kind,
            record[3].clone(),
            folder_of(&record[0]),
        ]
    });
    Some(mapped.collect())
}

/// The list or program of a mapped variable, `Application.IO` of `Application.IO.Door`.
fn folder_of(variable: &Cell) -> Cell {
    let parts: Vec<&str> = variable.text.splitn(3, '.').collect();
    // Further parts are elements of an array or structure.
    let folder = &parts[..(parts.len() - 1).min(2)];
    Cell {
        text: folder.join("."),
        at: variable.at,
    }
}

/// The number of records examined if there are no headings.
const LOOK: usize = 50;

/// The columns, if one of them contains addresses.
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
            folder: called(FOLDERS),
            unit: called(UNITS),
            order: called(ORDERS),
            direction: called(DIRECTIONS),
            scale: {
                let columns = SCALES.map(|heading| called(&[heading]));
                let all: Option<Vec<usize>> = columns.into_iter().collect();
                all.and_then(|all| all.try_into().ok())
            },
            first: 1,
        });
    }
    // Without headings: name, address, type, comment, as in our files and at the start of the SDF files of
    // TIA Portal and STEP 7; in an SDF file the comment follows some flags.
    let looked = &records[..records.len().min(LOOK)];
    let width = looked.iter().map(Vec::len).max().unwrap_or(0);
    let is_address = |record: &Record, column: usize| {
        let cell = record.get(column);
        cell.is_some_and(|cell| {
            !matches!(place(&cell.text, Addressing::Bytes), ParsedAddress::Nothing)
                || device::is_address(&cell.text)
        })
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
    let is_flag = |text: &str| matches!(text.to_lowercase().as_str(), "" | "true" | "false");
    let comment = (address + 2..width).find(|column| {
        looked
            .iter()
            .any(|record| record.get(*column).is_some_and(|cell| !is_flag(&cell.text)))
    });
    Some(Columns {
        name: usize::from(address == 0),
        address,
        kind: (address + 1 < width).then_some(address + 1),
        comment,
        folder: None,
        ..Columns::fixed()
    })
}
