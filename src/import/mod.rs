//! Lists of PLC tags, made into a driver.cfg.
//!
//! [`import`] takes the bytes of a table as editors and spreadsheets save it: CSV with semicolons, commas or tabs, in
//! UTF-8, UTF-16 or Windows-1252, with or without a header. Each line that it cannot use is told at its place.

mod address;
mod cells;
mod columns;
mod rows;
mod text;
mod write;

use std::path::Path;

use crate::config::{Collector, Mistake, Mistakes};
use crate::signal::Addressing;

/// Tables longer than this are no tag tables.
const LONGEST: usize = 16 << 20;

/// How a table is to be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// What the numbers of the addresses count.
    pub addressing: Addressing,
    /// Leave lines with mistakes out instead of refusing the table.
    pub lenient: bool,
}

/// A table that was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Imported {
    /// The text of a driver.cfg that `tickbus check` finds nothing wrong with.
    pub text: String,
    /// How many signals it has.
    pub signals: usize,
    /// The lines that are not in it, in line order: tags outside of the process image, and those with mistakes if they
    /// were to be left out.
    pub skipped: Vec<Mistake>,
}

/// Reads the `bytes` of a table; `file` is what its mistakes call it.
///
/// # Errors
///
/// With every mistake in the table, unless lines with mistakes are to be left out; or when nothing is left.
pub fn import(file: &str, bytes: &[u8], reading: Reading) -> Result<Imported, Mistakes> {
    if bytes.len() > LONGEST {
        return Err(Mistakes::of_file(
            file,
            format!("the table is {} MiB long", bytes.len() >> 20),
            format!(
                "a table of tags has at most {} MiB; save one sheet or one tag table at a time",
                LONGEST >> 20
            ),
        ));
    }
    if let Some((what, right)) = text::no_table(bytes) {
        return Err(Mistakes::of_file(file, what, right));
    }
    let table = text::decoded(bytes);
    let (wrong, skipped) = (Collector::new(file, &table), Collector::new(file, &table));
    let records = cells::records(&table, &wrong);
    let columns = columns::find(&records);
    let tags = match &columns {
        Some(columns) => rows::read(&records, columns, reading.addressing, &wrong, &skipped),
        None => Vec::new(),
    };
    let wrong = wrong.finish();
    let mut skipped: Vec<Mistake> = skipped.finish().iter().flatten().cloned().collect();
    if let Some(mistakes) = wrong {
        if !reading.lenient {
            return Err(mistakes);
        }
        skipped.extend(mistakes.iter().cloned());
        skipped.sort_by_key(|mistake| mistake.place);
    }
    if tags.is_empty() {
        let (what, right) = if columns.is_none() {
            (
                "no column of this table has addresses".to_owned(),
                "save it with the columns name; address; type; comment",
            )
        } else {
            (
                format!(
                    "none of its lines has a tag in %I or %Q; {} were skipped",
                    skipped.len()
                ),
                "only inputs and outputs can be connected: %I0.0, %IW4, %QD8",
            )
        };
        return Err(Mistakes::of_file(file, what, right));
    }
    let text = write::driver_cfg(Path::new(file), &tags);
    Ok(Imported {
        text,
        signals: tags.len(),
        skipped,
    })
}
