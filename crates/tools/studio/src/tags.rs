//! A list of tags from a PLC tool, dropped on the page.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use tickbus_base::toml_text::{Mistakes, shown};
use tickbus_driver_cfg::Kinds;
use tickbus_image::signal::{Address, Addressing};
use tickbus_import::{ImportOptions, condensed, import};
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table};

use crate::document::{self, parsed};
use crate::edit::kind;
use crate::layout;
use crate::literal::cell;
use crate::propose::{addressing, written};

/// Adds the signals of a list to a text: those whose names it does not have. Returns the new text and what was done.
///
/// # Errors
///
/// The list cannot be read, or the text cannot take its signals.
pub(crate) fn add(
    text: &str,
    file: &str,
    body: &str,
    kinds: &'static Kinds,
) -> Result<(String, String), String> {
    let bytes = STANDARD.decode(body);
    let bytes = bytes.map_err(|_| "the file did not arrive whole; drop it again".to_owned())?;
    let reading = ImportOptions {
        lenient: true,
        ..ImportOptions::default()
    };
    let imported = import(file, &bytes, reading, kinds).map_err(|mistakes| {
        let list: Vec<_> = mistakes.iter().cloned().collect();
        Mistakes::of_list(mistakes.file(), condensed(&list)).to_string()
    })?;
    let mut new = parsed(&imported.text)?;
    let mut document = parsed(text)?;
    align(&mut document, &mut new)?;
    let (added, known) = append(&mut document, &new)?;
    // Writing to a text cannot fail.
    let mut told = format!("imported {added} signals of {}", shown(file));
    if known > 0 {
        let _ = write!(told, ", {known} were there already");
    }
    if !imported.skipped.is_empty() {
        let skipped = Mistakes::of_list(file, condensed(&imported.skipped));
        let _ = write!(told, ", {} left out:\n{skipped}", imported.skipped.len());
    }
    for note in &imported.notes {
        let _ = write!(told, "\n{note}");
    }
    Ok((document::written(text, &document), told))
}

/// Gives the addresses of `new` the unit of the document; a document without signals gets that of `new`.
fn align(document: &mut DocumentMut, new: &mut DocumentMut) -> Result<(), String> {
    let (ours, theirs) = (addressing(document), addressing(new));
    if ours == theirs {
        return Ok(());
    }
    if document.get("signal").is_none() && theirs == Addressing::Elements {
        let driver = document
            .entry("driver")
            .or_insert_with(|| Item::Table(Table::new()));
        let driver = driver
            .as_table_like_mut()
            .ok_or("driver is no table; mend that in the text")?;
        driver.remove("addressing");
        layout::insert(driver, "addressing", "iec".into());
        return Ok(());
    }
    let signals = new.get_mut("signal").and_then(Item::as_array_of_tables_mut);
    for table in signals.into_iter().flat_map(ArrayOfTables::iter_mut) {
        let text = table.get("address").map(cell).unwrap_or_default();
        let Ok(address) = Address::parse(&text, theirs) else {
            continue;
        };
        let text = written(address, ours).ok_or_else(|| {
            let name = table.get("name").map(cell).unwrap_or_default();
            format!(
                "{} has {text}, which is byte {} of the image, and no address in a file with addressing = \"iec\" begins \
                 there; add the list to a file without that key",
                shown(&name),
                address.byte
            )
        })?;
        if let Some(Item::Value(value)) = table.get_mut("address") {
            let decor = value.decor().clone();
            *value = text.into();
            *value.decor_mut() = decor;
        }
    }
    Ok(())
}

/// Returns how many signals were added, and how many were there.
fn append(document: &mut DocumentMut, new: &DocumentMut) -> Result<(usize, usize), String> {
    let bus = kind(new);
    let at = new.get("fieldbus").and_then(|table| table.get("at"));
    let at = at.and_then(Item::as_table);
    if at.is_some() && kind(document).is_empty() {
        fieldbus(document)?.insert("kind", toml_edit::value(bus.as_str()));
    }
    if at.is_some() && kind(document) != bus {
        let present = kind(document);
        return Err(format!(
            "the addresses of this list are those of a device for {bus}, and this file has {present}; choose {bus} first"
        ));
    }
    let none = ArrayOfTables::new();
    let theirs = new.get("signal").and_then(Item::as_array_of_tables);
    let ours = document
        .entry("signal")
        .or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()));
    let ours = ours
        .as_array_of_tables_mut()
        .ok_or("the file does not write each signal as [[signal]]; add the list in its text")?;
    let name = |table: &Table| table.get("name").map(cell).unwrap_or_default();
    let mut names: std::collections::BTreeSet<String> = ours.iter().map(name).collect();
    let (mut added, mut known) = (0, 0);
    let mut places = Vec::new();
    for table in theirs.unwrap_or(&none) {
        if !names.insert(name(table)) {
            known += 1;
            continue;
        }
        let mut table = table.clone();
        table.set_position(None);
        places.push(name(&table));
        ours.push(table);
        added += 1;
    }
    if let Some(at) = at {
        let table = fieldbus(document)?
            .entry("at")
            .or_insert_with(|| Item::Table(Table::new()));
        let table = table
            .as_table_like_mut()
            .ok_or("fieldbus.at is no table; mend that in the text")?;
        for name in places {
            if let Some(Item::Value(value)) = at.get(&name) {
                layout::insert(table, &name, value.clone().decorated("", ""));
            }
        }
    }
    Ok((added, known))
}

fn fieldbus(document: &mut DocumentMut) -> Result<&mut dyn toml_edit::TableLike, String> {
    let item = document
        .entry("fieldbus")
        .or_insert_with(|| Item::Table(Table::new()));
    item.as_table_like_mut()
        .ok_or_else(|| "fieldbus is no table; mend that in the text".to_owned())
}
