//! The name of a signal, in all places of a driver.cfg that name signals.

use toml_edit::{DocumentMut, InlineTable, Item, Key, Table, TableLike, Value};

use crate::literal::cell;

/// The keys of a reply whose inline tables have keys of their own; in other keys such a table has names of signals.
const PARTS: [&str; 5] = ["sensors", "exits", "places", "flows", "ramp"];

/// The keys of a reply that name something else.
const OTHERS: [&str; 2] = ["kind", "name"];

/// The keys of a fault and of a drive that name signals.
const NAMING: [(&str, &[&str]); 2] = [
    ("fault", &["signal", "when", "while"]),
    ("drive", &["fault", "warning"]),
];

/// The operators of comparisons.
const OPERATORS: [&str; 6] = ["==", "!=", "<=", ">=", "<", ">"];

/// Lets all other places follow a signal that has become `to`, unless another signal has either name. Returns where that
/// was, in words; empty if there was none.
pub(crate) fn follow(document: &mut DocumentMut, was: &str, to: &str) -> String {
    let name = Renaming { was, to };
    let signals = document.get("signal").and_then(Item::as_array_of_tables);
    let names = signals.into_iter().flatten().map(name_of);
    let names: Vec<String> = names.collect();
    let others = |text: &str| names.iter().filter(|name| *name == text).count();
    if to.is_empty() || was.is_empty() || others(was) > 0 || others(to) > 1 {
        return String::new();
    }
    let mut places = Vec::new();
    let tables = |document: &DocumentMut, list: &str| {
        let tables = document.get(list).and_then(Item::as_array_of_tables);
        tables.map_or(0, toml_edit::ArrayOfTables::len)
    };
    for (list, one, many) in [
        ("reply", "reply", "replies"),
        ("fault", "fault", "faults"),
        ("drive", "drive", "drives"),
    ] {
        let mut count = 0;
        for index in 0..tables(document, list) {
            let table = document[list].as_array_of_tables_mut();
            let Some(table) = table.and_then(|tables| tables.get_mut(index)) else {
                continue;
            };
            count += usize::from(name.table(list, table));
        }
        match count {
            0 => {}
            1 => places.push(format!("1 {one}")),
            count => places.push(format!("{count} {many}")),
        }
    }
    // The signals of an axis have names, too.
    let has_axes = document.contains_key("axis");
    if let Some(bus) = document
        .get_mut("fieldbus")
        .and_then(Item::as_table_like_mut)
    {
        for key in ["at", "nodes"] {
            let Some(item) = bus.get_mut(key) else {
                continue;
            };
            if !has_axes {
                name.make_room(item);
            }
            if name.keys(item) {
                places.push(format!("fieldbus.{key}"));
            }
        }
        for key in ["alive", "heartbeat"] {
            if bus.get_mut(key).is_some_and(|item| name.watched(item)) {
                places.push(key.to_owned());
            }
        }
    }
    match &places[..] {
        [] => String::new(),
        [one] => format!("also renamed in {one}"),
        [all @ .., last] => format!("also renamed in {} and {last}", all.join(", ")),
    }
}

pub(crate) fn name_of(table: &Table) -> String {
    table.get("name").map(cell).unwrap_or_default()
}

/// The old name and the new one.
#[derive(Clone, Copy)]
struct Renaming<'a> {
    was: &'a str,
    to: &'a str,
}

impl Renaming<'_> {
    /// Renames in one table of a list; true if the name was there.
    fn table(self, list: &str, table: &mut Table) -> bool {
        let naming = NAMING
            .iter()
            .find(|(of, _)| *of == list)
            .map(|(_, keys)| *keys);
        let mut is_found = false;
        for (key, item) in table.iter_mut() {
            let is_name = match naming {
                Some(keys) => keys.contains(&key.get()),
                None => !OTHERS.contains(&key.get()),
            };
            if is_name && let Some(value) = item.as_value_mut() {
                is_found |= self.value(value, PARTS.contains(&key.get()));
            }
        }
        is_found
    }

    /// Renames in a value. An inline table of `parts` has keys of its own; in another one they are names.
    fn value(self, value: &mut Value, parts: bool) -> bool {
        match value {
            Value::String(text) => match self.text(text.value()) {
                Some(new) => {
                    let decor = text.decor().clone();
                    *value = new.into();
                    *value.decor_mut() = decor;
                    true
                }
                None => false,
            },
            Value::Array(all) => {
                let mut is_found = false;
                for value in all.iter_mut() {
                    is_found |= self.value(value, parts);
                }
                is_found
            }
            Value::InlineTable(table) if parts => {
                let mut is_found = false;
                for (_, value) in table.iter_mut() {
                    is_found |= self.value(value, false);
                }
                is_found
            }
            Value::InlineTable(table) => self.inline_keys(table),
            _ => false,
        }
    }

    /// The name, or the condition about it, with the new name; `None` if the text is about something else.
    fn text(self, text: &str) -> Option<String> {
        let trimmed = text.trim();
        if trimmed == self.was {
            return Some(self.to.to_owned());
        }
        if let Some(name) = trimmed.strip_prefix("not ")
            && name.trim() == self.was
        {
            return Some(format!("not {}", self.to));
        }
        let rest = trimmed.strip_prefix(self.was)?;
        let words = rest.trim();
        let is_edge = ["rises", "falls", "changes"].contains(&words) && rest.starts_with(' ');
        let is_comparison = OPERATORS.iter().any(|sign| words.starts_with(sign));
        (is_edge || is_comparison).then(|| format!("{}{rest}", self.to))
    }

    /// Removes the line with the new name, which a signal that is gone has left: it would become this signal's.
    fn make_room(self, item: &mut Item) {
        if let Some(table) = item.as_table_like_mut()
            && self.was != self.to
            && table.contains_key(self.was)
        {
            table.remove(self.to);
        }
    }

    /// Renames a key of a table of names.
    fn keys(self, item: &mut Item) -> bool {
        match item {
            Item::Table(table) => self.table_keys(table),
            Item::Value(Value::InlineTable(table)) => self.inline_keys(table),
            _ => false,
        }
    }

    fn table_keys(self, table: &mut Table) -> bool {
        if table.contains_key(self.to) || !table.contains_key(self.was) {
            return false;
        }
        let mut renamed = table.clone();
        renamed.clear();
        for (name, _) in table.iter() {
            if let Some((key, item)) = table.get_key_value(name) {
                renamed.insert_formatted(&self.key(key), item.clone());
            }
        }
        *table = renamed;
        true
    }

    fn inline_keys(self, table: &mut InlineTable) -> bool {
        if table.contains_key(self.to) || !table.contains_key(self.was) {
            return false;
        }
        let mut renamed = table.clone();
        renamed.clear();
        for (name, value) in table.iter() {
            if let Some(key) = TableLike::key(table, name) {
                renamed.insert_formatted(&self.key(key), value.clone());
            }
        }
        *table = renamed;
        true
    }

    /// The key with the new name, if it has the old one. The column of the equal sign stays, as far as the new name leaves
    /// room for it.
    fn key(self, key: &Key) -> Key {
        if key.get() != self.was {
            return key.clone();
        }
        let before = key.display_repr().chars().count();
        let mut new = Key::new(self.to).with_leaf_decor(key.leaf_decor().clone());
        if let Some(blanks) = key.leaf_decor().suffix().and_then(|it| it.as_str()) {
            let end = before + blanks.chars().count();
            let blanks = end.saturating_sub(new.display_repr().chars().count());
            new.leaf_decor_mut().set_suffix(" ".repeat(blanks.max(1)));
        }
        new
    }

    /// Renames the signal of `alive` or `heartbeat`: a table, or a list of them.
    fn watched(self, item: &mut Item) -> bool {
        let mut is_found = false;
        let mut take = |table: &mut dyn TableLike| {
            if let Some(Item::Value(value @ Value::String(_))) = table.get_mut("signal")
                && value.as_str() == Some(self.was)
            {
                is_found |= self.value(value, false);
            }
        };
        match item {
            Item::Value(Value::Array(all)) => {
                let tables = all.iter_mut().filter_map(Value::as_inline_table_mut);
                tables.for_each(|table| take(table));
            }
            Item::ArrayOfTables(tables) => tables.iter_mut().for_each(|table| take(table)),
            item => {
                if let Some(table) = item.as_table_like_mut() {
                    take(table);
                }
            }
        }
        is_found
    }
}
