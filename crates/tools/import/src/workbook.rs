//! The sheets of a workbook (XLSX), as saved by TIA Portal and spreadsheets.
//!
//! The crate calamine reads the cells. False statements in a file are checked before that: its unpacked size,
//! and its number of texts, for which calamine allocates memory unchecked.

use std::io::{Cursor, Read};

use calamine::{Data, Reader, Xlsx};
use tickbus_base::Mistake;
use zip::ZipArchive;

use super::Sheet;
use super::cells::{Cell, Record};

/// The largest total unpacked size.
const UNPACKED: u64 = 64 << 20;
/// The most parts, rows, columns and texts.
const PARTS: usize = 10_000;
const ROWS: u32 = 200_000;
const COLUMNS: u32 = 256;
const TEXTS: u64 = 2_000_000;

const DAMAGED: &str = "open it in Excel or LibreOffice and save it again, or save the sheet as CSV";
const TOO_LARGE: &str = "save one tag table alone, or save the sheet as CSV";

/// All sheets that are not empty.
pub(super) fn sheets(bytes: &[u8]) -> Result<Vec<Sheet>, Mistake> {
    check_parts(bytes)?;
    let damaged = |error: calamine::XlsxError| {
        Mistake::new(format!("this workbook cannot be read: {error}"), DAMAGED)
    };
    let mut workbook = Xlsx::new(Cursor::new(bytes)).map_err(damaged)?;
    let mut sheets = Vec::new();
    for name in workbook.sheet_names() {
        let mut cells = match workbook.worksheet_cells_reader(&name) {
            Ok(cells) => cells,
            // A chart sheet has no cells.
            Err(calamine::XlsxError::NotAWorksheet(_)) => continue,
            Err(error) => return Err(damaged(error)),
        };
        let mut found = Vec::new();
        while let Some(cell) = cells.next_cell().map_err(damaged)? {
            let (row, column) = cell.get_position();
            let text = Data::from(cell.get_value().clone()).to_string();
            // Spreadsheets permit line breaks within cells; names and comments are one line.
            let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
            if text.is_empty() {
                continue;
            }
            if row >= ROWS || column >= COLUMNS {
                return Err(Mistake::new(
                    format!(
                        "the sheet \"{name}\" has a cell in row {}, column {}: tables of tags have at most {ROWS} rows and \
                         {COLUMNS} columns",
                        row + 1,
                        column + 1
                    ),
                    TOO_LARGE,
                ));
            }
            found.push((row, column, text));
        }
        if !found.is_empty() {
            sheets.push(sheet(name, found));
        }
    }
    Ok(sheets)
}

/// A sheet as records. Its text has a line per row and a character per cell, so that positions in the text match those
/// in the sheet.
fn sheet(name: String, mut cells: Vec<(u32, u32, String)>) -> Sheet {
    cells.sort_by_key(|(row, column, _)| (*row, *column));
    let (mut text, mut records) = (String::new(), Vec::new());
    let mut line = 0;
    for row in cells.chunk_by(|one, other| one.0 == other.0) {
        while line < row[0].0 {
            text.push('\n');
            line += 1;
        }
        let mut record = Record::new();
        for (_, column, cell) in row {
            let column = *column as usize;
            // A damaged file may have a cell twice: the last one applies.
            record.truncate(column);
            let start = text.len();
            while record.len() <= column {
                let at = start + record.len();
                let text = String::new();
                record.push(Cell { text, at });
            }
            record[column].text.clone_from(cell);
        }
        // Pads the line, because positions count columns from the start of the row.
        text.extend(std::iter::repeat_n(' ', record.len()));
        records.push(record);
    }
    text.push('\n');
    Sheet {
        name: Some(name),
        text,
        records,
        columns: None,
    }
}

/// Unpacks all parts once, and checks their stated sizes.
fn check_parts(bytes: &[u8]) -> Result<(), Mistake> {
    let damaged = |error: &dyn std::fmt::Display| {
        Mistake::new(
            format!("this workbook cannot be unpacked: {error}"),
            DAMAGED,
        )
    };
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| damaged(&error))?;
    if archive.len() > PARTS {
        return Err(Mistake::new(
            format!("this workbook has {} parts", archive.len()),
            TOO_LARGE,
        ));
    }
    let mut left = UNPACKED;
    let mut part = Vec::new();
    for number in 0..archive.len() {
        part.clear();
        let file = archive.by_index(number).map_err(|error| damaged(&error))?;
        let read = file.take(left + 1).read_to_end(&mut part);
        let read = read.map_err(|error| damaged(&error))? as u64;
        if read > left {
            return Err(Mistake::new(
                format!("this workbook unpacks to more than {} MiB", UNPACKED >> 20),
                TOO_LARGE,
            ));
        }
        left -= read;
        if let Some(texts) = stated_texts(&part).filter(|texts| *texts > TEXTS) {
            return Err(Mistake::new(
                format!(
                    "this workbook says that it has {texts} texts; tables of tags have at most {TEXTS}"
                ),
                TOO_LARGE,
            ));
        }
    }
    Ok(())
}

/// The largest number after a `uniqueCount`.
fn stated_texts(part: &[u8]) -> Option<u64> {
    const KEY: &[u8] = b"uniqueCount";
    let places = part
        .windows(KEY.len())
        .enumerate()
        .filter(|(_, bytes)| *bytes == KEY);
    let numbers = places.map(|(at, _)| {
        let rest = part[at + KEY.len()..].iter();
        let digits = rest
            .skip_while(|byte| !byte.is_ascii_digit() && **byte != b'>')
            .take_while(|byte| byte.is_ascii_digit());
        digits.fold(0_u64, |number, digit| {
            number
                .saturating_mul(10)
                .saturating_add(u64::from(digit - b'0'))
        })
    });
    numbers.max()
}
