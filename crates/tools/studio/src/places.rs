//! Which key of a driver.cfg a place in its text belongs to.

use std::ops::Range;

use serde::{Deserialize, Serialize};
use toml_edit::{Document, Item, TableLike, Value};

/// One step towards a value: a key of a table, or the place in a list, from 0.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub(crate) enum Step {
    Index(usize),
    Key(String),
}

/// The way from the file to a value, such as `signal`, 3, `address`.
pub(crate) type Way = Vec<Step>;

/// The keys and values of a text, by their places in it.
#[derive(Debug, Default)]
pub(crate) struct Places(Vec<(Range<usize>, Way)>);

impl Places {
    /// The places of a document that was parsed and not changed.
    pub(crate) fn of(document: &Document<&str>) -> Self {
        let mut places = Self::default();
        places.table(document.as_table(), &mut Way::new());
        places
    }

    /// The innermost value around this byte of the text, or at its end; empty if there is none.
    pub(crate) fn at(&self, byte: usize) -> Way {
        let around = |range: &Range<usize>| range.start <= byte && byte <= range.end;
        let found = (self.0.iter()).filter(|(range, _)| around(range));
        let found = found.max_by_key(|(range, way)| (way.len(), range.start));
        found.map(|(_, way)| way.clone()).unwrap_or_default()
    }

    fn add(&mut self, span: Option<Range<usize>>, way: &Way) {
        if let Some(span) = span {
            self.0.push((span, way.clone()));
        }
    }

    fn table(&mut self, table: &dyn TableLike, way: &mut Way) {
        for (name, item) in table.iter() {
            way.push(Step::Key(name.to_owned()));
            self.add(table.key(name).and_then(toml_edit::Key::span), way);
            self.item(item, way);
            way.pop();
        }
    }

    fn item(&mut self, item: &Item, way: &mut Way) {
        self.add(item.span(), way);
        match item {
            Item::Table(table) => self.table(table, way),
            Item::ArrayOfTables(tables) => {
                for (index, table) in tables.iter().enumerate() {
                    way.push(Step::Index(index));
                    self.add(table.span(), way);
                    self.table(table, way);
                    way.pop();
                }
            }
            Item::Value(Value::InlineTable(table)) => self.table(table, way),
            _ => {}
        }
    }
}
