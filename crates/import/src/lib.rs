//! Converts lists of PLC tags to a driver.cfg.
//!
//! [`import`] takes the bytes of a file as saved by editors and spreadsheets: a workbook (XLSX), a table as
//! text (CSV, SDF, a list of properties), PLCopen XML or L5X. Tags of the process image keep their addresses.
//! Clients' lists (PLC4X, KEPServer) have device addresses: these go to `[fieldbus.at]` unchanged, and image
//! addresses are assigned to the signals. Each line that cannot be used is reported with its position.

mod address;
mod cells;
mod columns;
mod device;
mod layout;
mod plc_xml;
mod rows;
mod text;
mod workbook;
mod write;

use std::path::Path;

pub use device::Client;

use cells::Record;
use columns::Columns;
use rows::{Taken, World};
use text::FileType;
use tickbus_base::toml_text::{Collector, Mistakes, PlacedMistake};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Addressing;

/// Longer files are refused: no tag list is this large.
const LONGEST: usize = 64 << 20;

/// How to read a table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ImportOptions {
    /// What the numbers of addresses count.
    pub addressing: Addressing,
    /// Skip lines with mistakes instead of refusing the table.
    pub lenient: bool,
    /// The bus of the device addresses in the list; `None` to detect it.
    pub client: Option<Client>,
}

/// The result of reading a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Imported {
    /// The text of a driver.cfg in which `tickbus check` finds no mistakes.
    pub text: String,
    /// The number of its signals.
    pub signals: usize,
    /// The lines that were left out, in line order: tags outside the process image, and lines with mistakes
    /// if those are skipped.
    pub skipped: Vec<PlacedMistake>,
}

/// A table, and the text that its positions refer to.
struct Sheet {
    /// Its name in a workbook.
    name: Option<String>,
    text: String,
    records: Vec<Record>,
    /// Its columns, if they are known.
    columns: Option<Columns>,
}

/// The mistakes and notes of all sheets.
#[derive(Default)]
struct Told {
    wrong: Vec<PlacedMistake>,
    skipped: Vec<PlacedMistake>,
}

impl Told {
    fn add(list: &mut Vec<PlacedMistake>, sheet: Option<&str>, found: Collector<'_>) {
        for found in found.finish().iter().flatten() {
            let mut found = found.clone();
            if let Some(sheet) = sheet {
                found.mistake.what = format!("sheet \"{sheet}\": {}", found.mistake.what);
            }
            list.push(found);
        }
    }
}

/// Reads the `bytes` of a file; mistakes call it `file`.
///
/// # Errors
///
/// With every mistake in the table, unless lines with mistakes are skipped; or when nothing is left.
pub fn import(file: &str, bytes: &[u8], reading: ImportOptions) -> Result<Imported, Mistakes> {
    let of_file = |what: String, right: &str| Err(Mistakes::of_file(file, what, right));
    if bytes.len() > LONGEST {
        return of_file(
            format!("the file is {} MiB long", bytes.len() >> 20),
            "a list of tags has at most 64 MiB; save one sheet or one tag table at a time",
        );
    }
    let mut told = Told::default();
    let mut is_logix = false;
    let sheets = match text::kind(bytes) {
        FileType::OldWorkbook => {
            return of_file(
                "this is a workbook of Excel before 2007, or one with a password".to_owned(),
                "open it in Excel or LibreOffice, and save it as XLSX without a password, or as CSV",
            );
        }
        FileType::Workbook => match workbook::sheets(bytes) {
            Ok(sheets) => sheets,
            Err(mistake) => return Err(Mistakes::of(file, mistake)),
        },
        FileType::Xml => {
            let text = text::decoded(bytes);
            let skipped = Collector::new(file, &text);
            let project = plc_xml::read(file, &text, &skipped)?;
            Told::add(&mut told.skipped, None, skipped);
            is_logix = project.is_logix;
            vec![project.sheet]
        }
        FileType::Table => {
            let text = text::decoded(bytes);
            let wrong = Collector::new(file, &text);
            let records = cells::records(&text, &wrong);
            Told::add(&mut told.wrong, None, wrong);
            vec![Sheet {
                name: None,
                text,
                records,
                columns: None,
            }]
        }
    };
    tags_of(file, &sheets, reading, is_logix, told)
}

/// The driver.cfg of all tags in `sheets`.
fn tags_of(
    file: &str,
    sheets: &[Sheet],
    reading: ImportOptions,
    is_logix: bool,
    mut told: Told,
) -> Result<Imported, Mistakes> {
    let columns: Vec<Option<Columns>> = sheets
        .iter()
        .map(|sheet| {
            sheet
                .columns
                .clone()
                .or_else(|| columns::find(&sheet.records))
        })
        .collect();
    let world = if is_logix {
        World::Modules
    } else {
        let lists = sheets.iter().zip(&columns);
        let addresses = lists.filter_map(|(sheet, columns)| {
            let columns = columns.as_ref()?;
            let records = sheet.records[columns.first..].iter();
            Some(records.filter_map(|record| Some(record.get(columns.address)?.text.as_str())))
        });
        let client = reading.client.or_else(|| rows::client(addresses.flatten()));
        client.map_or(World::Image(reading.addressing), World::Device)
    };
    let mut taken = Taken::default();
    let mut tags = Vec::new();
    for (sheet, columns) in sheets.iter().zip(&columns) {
        let (wrong, skipped) = (
            Collector::new(file, &sheet.text),
            Collector::new(file, &sheet.text),
        );
        match columns {
            Some(columns) => rows::read(
                &sheet.records,
                columns,
                world,
                &mut taken,
                &mut tags,
                &wrong,
                &skipped,
            ),
            None => {
                if let Some(cell) = sheet.records.first().and_then(|record| record.first())
                    && sheets.len() > 1
                {
                    skipped.report(
                        cell.at,
                        "it has no column of addresses: skipped",
                        "nothing, if it has no tags",
                    );
                }
            }
        }
        Told::add(&mut told.wrong, sheet.name.as_deref(), wrong);
        Told::add(&mut told.skipped, sheet.name.as_deref(), skipped);
    }
    let Told {
        mut wrong,
        mut skipped,
    } = told;
    if sheets.len() == 1 {
        wrong.sort_by_key(|found| found.place);
    }
    if !wrong.is_empty() {
        if !reading.lenient {
            return Err(Mistakes::of_list(file, wrong));
        }
        skipped.extend(wrong);
        skipped.sort_by_key(|found| found.place);
    }
    if tags.is_empty() {
        return Err(nothing(
            file,
            columns.iter().any(Option::is_some),
            skipped.len(),
        ));
    }
    if let Err(mistake) = layout::lay(&mut tags) {
        return Err(Mistakes::of(file, mistake));
    }
    let text = write::driver_cfg(Path::new(file), &tags, world);
    // Mistakes that only the bus can find in the addresses are reported before the file is written.
    if let Err(mistakes) = Config::parse("driver.cfg", &text) {
        let list = mistakes.iter().map(|found| PlacedMistake {
            place: None,
            mistake: found.mistake.clone(),
        });
        return Err(Mistakes::of_list(file, list.collect()));
    }
    Ok(Imported {
        text,
        signals: tags.len(),
        skipped,
    })
}

fn nothing(file: &str, has_columns: bool, skipped: usize) -> Mistakes {
    if has_columns {
        Mistakes::of_file(
            file,
            format!("none of its lines has a tag in %I or %Q; {skipped} were skipped"),
            "only inputs and outputs can be connected: %I0.0, %IW4, %QD8; markers and data blocks can by --bus s7-client or \
             --bus modbus-client",
        )
    } else {
        Mistakes::of_file(
            file,
            "no column of this table has addresses",
            "save it with the columns name; address; type; comment",
        )
    }
}
