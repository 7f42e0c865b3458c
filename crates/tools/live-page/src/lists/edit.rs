//! A changed list or set in the text of the file: everything else, also comments, stays as it is.

use tickbus_base::toml_text::did_you_mean;
use tickbus_image::signal::Signal;
use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, Value};

use super::file::Contents;
use super::{List, Set};
use crate::value::parse;

/// The heading of a new file.
const HEADING: &str =
    "# Lists of signals and stored sets of values, for the live page (docs/live-page.md).\n\n";

/// A list or a set.
pub(super) trait Entry: PartialEq + Sized {
    /// The key of its tables.
    const KEY: &str;

    fn all(contents: &Contents) -> &[Self];

    fn name(&self) -> &str;

    /// Checks what only the driver's signals can tell.
    fn check(&self, signals: &[Signal]) -> Result<(), String>;

    /// Writes it into its table.
    fn write(&self, table: &mut Table);
}

impl Entry for List {
    const KEY: &str = "list";

    fn all(contents: &Contents) -> &[Self] {
        &contents.lists
    }

    fn name(&self) -> &str {
        &self.name
    }

    /// Signals that the driver does not have stay in their list.
    fn check(&self, _: &[Signal]) -> Result<(), String> {
        Ok(())
    }

    fn write(&self, table: &mut Table) {
        put(table, "name", &self.name);
        put(table, "group", &self.group);
        put(table, "order", &self.order);
        let written = table.get("pins").and_then(Item::as_array);
        let written = written.map(|pins| pins.iter().map(Value::as_str).collect::<Vec<_>>());
        let pins: Vec<Option<&str>> = self.pins.iter().map(|pin| Some(pin.as_str())).collect();
        // Pins that are the same stay with their comments.
        if written.as_ref() != Some(&pins) {
            set(table, "pins", Value::from(lines(&self.pins)));
        }
        keep_only(table, "formats", |name| self.formats.contains_key(name));
        for (signal, format) in &self.formats {
            put(sub_table(table, "formats"), signal, format);
        }
    }
}

impl Entry for Set {
    const KEY: &str = "set";

    fn all(contents: &Contents) -> &[Self] {
        &contents.sets
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn check(&self, signals: &[Signal]) -> Result<(), String> {
        if self.values.is_empty() {
            return Err("a set has at least one signal; force those that belong to it".to_owned());
        }
        for (name, text) in &self.values {
            let Some(signal) = signals.iter().find(|signal| signal.name == *name) else {
                let names: Vec<&str> = signals.iter().map(|it| it.name.as_str()).collect();
                let right = did_you_mean(name, "signals", &names);
                return Err(format!("there is no signal \"{name}\"; {right}"));
            };
            parse(text, signal)?;
        }
        Ok(())
    }

    fn write(&self, table: &mut Table) {
        put(table, "name", &self.name);
        keep_only(table, "values", |name| {
            self.values.iter().any(|(signal, _)| signal == name)
        });
        let values = sub_table(table, "values");
        for (signal, text) in &self.values {
            // Literals with a base stay texts, and so does a whole number that TOML does not have.
            let whole = text.parse::<i64>().map(Value::from).ok();
            let real = || {
                let real = text.parse::<f64>().ok();
                real.filter(|_| text.contains(['.', 'e', 'E']))
                    .map(Value::from)
            };
            let new = match text.as_str() {
                "TRUE" => Value::from(true),
                "FALSE" => Value::from(false),
                _ => whole.or_else(real).unwrap_or_else(|| Value::from(text)),
            };
            set(values, signal, new);
        }
    }
}

/// A list of texts, one a line.
fn lines(texts: &[String]) -> Array {
    let mut list = Array::new();
    for text in texts {
        let mut text = Value::from(text);
        text.decor_mut().set_prefix("\n    ");
        list.push_formatted(text);
    }
    if !list.is_empty() {
        list.set_trailing("\n");
        list.set_trailing_comma(true);
    }
    list
}

/// Puts a text, and leaves one that is the same as it is written.
fn put(table: &mut Table, key: &str, text: &str) {
    if table.get(key).and_then(Item::as_str) != Some(text) {
        set(table, key, Value::from(text));
    }
}

/// Puts a value into the place of the old one, with its comment.
fn set(table: &mut Table, key: &str, mut new: Value) {
    if let Some(old) = table.get(key).and_then(Item::as_value) {
        *new.decor_mut() = old.decor().clone();
    }
    table[key] = Item::Value(new);
}

fn keep_only(table: &mut Table, key: &str, is_kept: impl Fn(&str) -> bool) {
    if let Some(items) = table.get_mut(key).and_then(Item::as_table_like_mut) {
        let names: Vec<String> = items.iter().map(|(name, _)| name.to_owned()).collect();
        for name in names.iter().filter(|name| !is_kept(name)) {
            items.remove(name);
        }
        if items.is_empty() {
            table.remove(key);
        }
    }
}

/// The table under a key; an inline one becomes a table of lines.
fn sub_table<'t>(table: &'t mut Table, key: &str) -> &'t mut Table {
    let item = table
        .entry(key)
        .or_insert_with(|| Item::Table(Table::new()));
    if let Item::Value(Value::InlineTable(inline)) = item {
        *item = Item::Table(std::mem::take(inline).into_table());
    }
    item.as_table_mut().expect("the reader has checked it")
}

/// The text with the entry of this name replaced, added or, with `None`, removed.
pub(super) fn replaced<T: Entry>(text: &str, name: &str, is: Option<&T>) -> Result<String, String> {
    let mut document: DocumentMut = text.parse().map_err(|error| format!("{error}"))?;
    if text.is_empty() {
        document.decor_mut().set_prefix(HEADING);
    }
    let item = document
        .entry(T::KEY)
        .or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()));
    if let Some(array) = item.as_array() {
        *item = if array.is_empty() {
            Item::ArrayOfTables(ArrayOfTables::new())
        } else {
            let tables = std::mem::take(item).into_array_of_tables();
            tables.map_or(Item::None, Item::ArrayOfTables)
        };
    }
    let tables = item
        .as_array_of_tables_mut()
        .ok_or_else(|| format!("write [[{}]], with two brackets", T::KEY))?;
    let is_named = |table: &Table| table.get("name").and_then(Item::as_str) == Some(name);
    let place = tables.iter().position(is_named);
    match (place, is) {
        (Some(place), Some(is)) => is.write(tables.get_mut(place).expect("it was found")),
        (Some(place), None) => drop(tables.remove(place)),
        (None, Some(is)) => {
            let mut table = Table::new();
            table
                .decor_mut()
                .set_prefix(if text.is_empty() { "" } else { "\n" });
            is.write(&mut table);
            tables.push(table);
        }
        (None, None) => {}
    }
    if tables.is_empty() {
        document.remove(T::KEY);
    }
    Ok(document.to_string())
}
