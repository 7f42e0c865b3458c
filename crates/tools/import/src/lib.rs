//! Converts lists of PLC tags to a driver.cfg.
//!
//! [`import`] takes the bytes of a file as saved by editors and spreadsheets: a workbook (XLSX), a table as text (CSV,
//! SDF, a list of properties), PLCopen XML, L5X, files of TwinCAT, or Structured Text. Tags of the process image keep
//! their addresses. Clients' lists (PLC4X, KEPServer) have device addresses: these go to `[fieldbus.at]` unchanged, and
//! image addresses are assigned to the signals. Each unusable line is reported with its position.

mod address;
mod cells;
mod columns;
mod condensed;
mod declarations;
mod device;
mod layout;
mod logix;
mod plc_xml;
mod propose;
mod rows;
mod text;
mod workbook;
mod write;
mod xml;

use std::path::Path;

pub use condensed::condensed;
pub use device::Client;
pub use propose::{Point, Proposal, propose};
pub use write::note;

use cells::Record;
use columns::Columns;
use plc_xml::Origin;
use rows::{Image, Tag, Taken, World};
use text::FileType;
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, Mistakes, PlacedMistake};
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_image::signal::{Addressing, Area, DataType};

/// Longer files are refused: no tag list is this large.
const LONGEST: usize = 64 << 20;

/// How to read a table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ImportOptions {
    /// The unit of the numbers in addresses. `None` means the unit of the program that wrote the list, or bytes if the
    /// program is unknown.
    pub addressing: Option<Addressing>,
    /// Skip lines with mistakes instead of refusing the table.
    pub lenient: bool,
    /// The bus of the device addresses in the list; `None` to detect it.
    pub client: Option<Client>,
    /// Add [proposed](propose()) replies for the inputs.
    pub replies: bool,
}

/// The result of reading a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Imported {
    /// The text of a driver.cfg in which `tickbus check` finds no mistakes.
    pub text: String,
    /// The number of signals.
    pub signals: usize,
    /// The number of proposed replies.
    pub replies: usize,
    /// The number of signals whose addresses import assigned, because the list has none in the process image.
    pub assigned: usize,
    /// The reading of the addresses, where there is a choice.
    pub notes: Vec<String>,
    /// The lines that were left out, in line order: tags outside the process image, and lines with mistakes
    /// if those are skipped.
    pub skipped: Vec<PlacedMistake>,
}

/// A table, and the text that its positions refer to.
struct Sheet {
    /// The name in a workbook.
    name: Option<String>,
    text: String,
    records: Vec<Record>,
    /// The columns, if known.
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

/// Reads the `bytes` of a file; mistakes call it `file`. The resulting driver.cfg may name only these `kinds` of bus.
///
/// # Errors
///
/// With every mistake in the table, unless lines with mistakes are skipped; also if no signal is left.
pub fn import(
    file: &str,
    bytes: &[u8],
    reading: ImportOptions,
    kinds: &'static Kinds,
) -> Result<Imported, Mistakes> {
    let of_file = |what: String, right: &str| Err(Mistakes::of_file(file, what, right));
    if bytes.len() > LONGEST {
        return of_file(
            format!("the file is {} MiB long", bytes.len() >> 20),
            "a list of tags has at most 64 MiB; save one sheet or one tag table at a time",
        );
    }
    let mut told = Told::default();
    let mut origin = Origin::Table;
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
            origin = project.origin;
            vec![project.sheet]
        }
        FileType::Table => {
            let text = text::decoded(bytes);
            let (records, columns);
            if declarations::has_any(&text) {
                origin = if declarations::has_configuration(&text) {
                    Origin::OpenPlc
                } else {
                    Origin::Project
                };
                (records, columns) = (
                    declarations::read(&text, 0, text.len()),
                    Some(Columns::fixed()),
                );
            } else {
                let (wrong, skipped) = (Collector::new(file, &text), Collector::new(file, &text));
                let table = cells::records(&text, &wrong);
                if let Some(points) = logix::table(&table, &skipped) {
                    origin = Origin::Logix;
                    (records, columns) = (points, Some(Columns::fixed()));
                } else if let Some(mapped) = columns::codesys_mapping(&table, &skipped) {
                    origin = Origin::Codesys;
                    (records, columns) = (mapped, Some(Columns::fixed()));
                } else {
                    (records, columns) = (table, None);
                }
                Told::add(&mut told.wrong, None, wrong);
                Told::add(&mut told.skipped, None, skipped);
            }
            vec![Sheet {
                name: None,
                text,
                records,
                columns,
            }]
        }
    };
    let imported = tags_of(file, &sheets, reading, origin, told)?;
    // Mistakes that only the bus can find in the addresses are reported before the file is written.
    if let Err(mistakes) = Config::parse("driver.cfg", &imported.text, kinds) {
        let list = mistakes.iter().map(|found| PlacedMistake {
            place: None,
            mistake: found.mistake.clone(),
        });
        return Err(Mistakes::of_list(file, list.collect()));
    }
    Ok(imported)
}

/// The driver.cfg of all tags in `sheets`.
fn tags_of(
    file: &str,
    sheets: &[Sheet],
    reading: ImportOptions,
    origin: Origin,
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
    let (image, world) = world_of(sheets, &columns, reading, origin);
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
            origin,
            skipped,
        ));
    }
    let (assigned, notes) = unplaced(&mut tags, reading, image, world);
    if let Err(mistake) = layout::lay(&mut tags) {
        return Err(Mistakes::of(file, mistake));
    }
    let mut text = write::driver_cfg(Path::new(file), &tags, world);
    let proposals = if reading.replies {
        proposals(&tags)
    } else {
        Vec::new()
    };
    let sections = proposals.iter().map(|proposal| &*proposal.section);
    write::replies(&mut text, &sections.collect::<Vec<_>>());
    Ok(Imported {
        text,
        signals: tags.len(),
        replies: proposals.len(),
        assigned,
        notes,
        skipped,
    })
}

/// Replies for the inputs among the tags.
fn proposals(tags: &[Tag]) -> Vec<Proposal> {
    fn point(tag: &Tag) -> Point<'_> {
        Point {
            name: &tag.name,
            comment: &tag.comment,
            is_input: tag.area == Area::Input,
            is_bool: tag.data_type == DataType::Bool,
            is_written: false,
        }
    }
    let points: Vec<Point<'_>> = tags.iter().map(point).collect();
    propose(&points)
}

/// The kind of addresses in `sheets`.
fn world_of(
    sheets: &[Sheet],
    columns: &[Option<Columns>],
    reading: ImportOptions,
    origin: Origin,
) -> (Image, World) {
    let image = Image {
        addressing: reading.addressing.unwrap_or(match origin {
            Origin::OpenPlc | Origin::Codesys => Addressing::Elements,
            Origin::Table | Origin::Project | Origin::Logix => Addressing::Bytes,
        }),
        is_project: !matches!(origin, Origin::Table | Origin::Logix),
        is_apart: origin == Origin::OpenPlc,
    };
    let world = if origin == Origin::Logix {
        World::Modules
    } else if origin == Origin::OpenPlc {
        // Such addresses with levels look like those of a client.
        World::Image(image)
    } else {
        let lists = sheets.iter().zip(columns);
        let addresses = lists.filter_map(|(sheet, columns)| {
            let columns = columns.as_ref()?;
            let records = sheet.records[columns.first..].iter();
            Some(records.filter_map(|record| Some(record.get(columns.address)?.text.as_str())))
        });
        let client = reading.client.or_else(|| rows::client(addresses.flatten()));
        client.map_or(World::Image(image), World::Device)
    };
    (image, world)
}

/// The number of tags without an address, and notes on the reading of the others.
fn unplaced(
    tags: &mut [Tag],
    reading: ImportOptions,
    image: Image,
    world: World,
) -> (usize, Vec<String>) {
    let mut notes = Vec::new();
    let is_counted = |tag: &Tag| tag.address.is_some_and(|address| address.width.bytes() > 1);
    if reading.addressing.is_none()
        && image.addressing == Addressing::Elements
        && world == World::Image(image)
        && tags.iter().any(is_counted)
    {
        notes.push(
            "the numbers of addresses count elements, as in the program that wrote the file: %IW1 is the second word; \
             --bytes reads them as bytes"
                .to_owned(),
        );
    }
    if image.is_apart && layout::part(tags) {
        notes.push(
            "in this PLC bits and words are separate memories, and their addresses overlap: the wider values stand behind \
             the bits, each with its own address in its remark"
                .to_owned(),
        );
    }
    let assigned = tags.iter().filter(|tag| tag.address.is_none()).count();
    if assigned > 0 && matches!(world, World::Image(_)) {
        notes.push(format!(
            "{assigned} inputs and outputs have no place in the process image yet: import assigned places in order; each \
             signal's remark has its address in the PLC"
        ));
    }
    (assigned, notes)
}

/// The mistake of a list without inputs and outputs, and why its lines were left out.
fn nothing(file: &str, has_columns: bool, origin: Origin, skipped: Vec<PlacedMistake>) -> Mistakes {
    let mistake = match (origin, has_columns) {
        (Origin::Logix, _) => Mistake::new(
            format!(
                "none of its tags is an input or output of a module; {} notes say why",
                skipped.len()
            ),
            "export the whole controller or its modules as L5X, with their data",
        ),
        (Origin::Project | Origin::Codesys | Origin::OpenPlc, _) if skipped.is_empty() => {
            Mistake::new(
                "no variable in this file is an input or output",
                "name a file that declares some, such as Start AT %I* : BOOL or Lamp AT %QX0.0 : BOOL",
            )
        }
        (Origin::Project | Origin::Codesys | Origin::OpenPlc, _) => Mistake::new(
            format!(
                "none of its variables can be a signal; {} notes say why",
                skipped.len()
            ),
            "declare inputs and outputs with types that signals have; the members of a structure one by one",
        ),
        (_, true) => Mistake::new(
            format!(
                "none of its lines has a tag in %I or %Q; {} were skipped",
                skipped.len()
            ),
            "only inputs and outputs can be connected: %I0.0, %IW4, %QD8; markers and data blocks can by --bus s7-client or \
             --bus modbus-client",
        ),
        (_, false) => Mistake::new(
            "no column of this table has addresses",
            "save it with the columns name; address; type; comment",
        ),
    };
    let mut list = vec![PlacedMistake {
        place: None,
        mistake,
    }];
    list.extend(skipped);
    Mistakes::of_list(file, list)
}
