//! How a driver.cfg is written: columns of equal signs, blank lines, ends of lines.

use toml_edit::{Item, Key, Table, TableLike, Value};

/// The columns before the equal signs of a table, if it has at least two keys and they stand below each other.
fn column(table: &dyn TableLike) -> Option<usize> {
    let widths = table.iter().filter(|(_, item)| item.is_value());
    let widths = widths.filter_map(|(name, _)| table.key(name)).map(width);
    let widths: Vec<usize> = widths.collect();
    let first = *widths.first()?;
    (widths.len() > 1 && widths.iter().all(|width| *width == first)).then_some(first)
}

fn width(key: &Key) -> usize {
    let suffix = key.leaf_decor().suffix().and_then(|raw| raw.as_str());
    key.display_repr().chars().count() + suffix.unwrap_or(" ").chars().count()
}

/// Inserts a key behind the others, its equal sign below theirs.
pub(crate) fn insert(table: &mut dyn TableLike, name: &str, value: Value) {
    let column = column(&*table);
    let key = aligned(name, column);
    let mut value = value;
    value.decor_mut().set_prefix(" ");
    table.entry_format(&key).or_insert(Item::Value(value));
}

/// A key whose equal sign stands in this column, or one blank behind it.
fn aligned(name: &str, column: Option<usize>) -> Key {
    let mut key = Key::new(name);
    let long = key.display_repr().chars().count();
    let blanks = column.map_or(1, |column| column.saturating_sub(long).max(1));
    key.leaf_decor_mut().set_suffix(" ".repeat(blanks));
    key
}

/// A table for a list, written as its neighbour is.
pub(crate) fn table(pairs: Vec<(String, Value)>, neighbour: Option<&Table>) -> Table {
    let mut table = Table::new();
    let own = pairs.iter().map(|(name, _)| aligned(name, None));
    let own = own.map(|key| key.display_repr().chars().count() + 1).max();
    let column = neighbour.and_then(|table| column(table)).max(own);
    for (name, mut value) in pairs {
        let key = aligned(&name, column);
        value.decor_mut().set_prefix(" ");
        table.entry_format(&key).or_insert(Item::Value(value));
    }
    table.decor_mut().set_prefix("\n");
    table
}

/// The text with the ends of lines that `before` has.
pub(crate) fn ends_as(before: &str, text: String) -> String {
    if !before.contains("\r\n") {
        return text;
    }
    text.replace("\r\n", "\n").replace('\n', "\r\n")
}
