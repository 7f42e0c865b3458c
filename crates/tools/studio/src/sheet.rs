//! The cells of a text: its tables as the page shows them.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Map, Value as Json, json};
use toml_edit::{Document, DocumentMut, Item, TableLike};

use crate::document::body;
use crate::literal::cell;
use crate::propose::next;

/// The tables that have cells.
const SHOWN: [&str; 4] = ["driver", "fieldbus", "signal", "station"];

/// The cells of a file.
#[derive(Debug, Serialize)]
pub(crate) struct Sheet {
    /// The kind of bus; empty without one.
    kind: String,
    driver: Map<String, Json>,
    fieldbus: Map<String, Json>,
    /// The addresses in the device, by the names of signals.
    at: Map<String, Json>,
    /// Each a map of its keys.
    signals: Vec<Map<String, Json>>,
    stations: Vec<String>,
    /// Other tables, which the page shows in the text alone.
    others: Vec<String>,
    /// Free addresses, by station and by area and size, such as `IW`.
    next: BTreeMap<String, BTreeMap<String, String>>,
}

impl Sheet {
    /// The cells of a text.
    ///
    /// # Errors
    ///
    /// The text is no TOML.
    pub(crate) fn of(text: &str) -> Result<Self, String> {
        let document = Document::parse(body(text)).map_err(|error| error.message().to_owned())?;
        Ok(Self::read(&document.into_mut()))
    }

    /// The kind of bus; empty without one.
    pub(crate) fn kind(&self) -> &str {
        &self.kind
    }

    fn read(document: &DocumentMut) -> Self {
        let cells = |name: &str| document.get(name).map(cells_of).unwrap_or_default();
        let mut fieldbus = cells("fieldbus");
        let at = document.get("fieldbus").and_then(|table| table.get("at"));
        fieldbus.remove("at");
        let list = |name: &str| {
            let tables = document.get(name).and_then(Item::as_array_of_tables);
            let tables = tables.into_iter().flatten();
            tables.map(|table| cells_in(table)).collect::<Vec<_>>()
        };
        let name = |mut table: Map<String, Json>| match table.remove("name") {
            Some(Json::String(name)) => name,
            _ => String::new(),
        };
        let others = document.iter().map(|(name, _)| name);
        let others = others.filter(|name| !SHOWN.contains(name));
        Self {
            kind: crate::edit::kind(document),
            driver: cells("driver"),
            at: at.map(cells_of).unwrap_or_default(),
            fieldbus,
            signals: list("signal"),
            stations: list("station").into_iter().map(name).collect(),
            others: others.map(str::to_owned).collect(),
            next: next(document),
        }
    }
}

fn cells_of(item: &Item) -> Map<String, Json> {
    item.as_table_like().map(cells_in).unwrap_or_default()
}

fn cells_in(table: &dyn TableLike) -> Map<String, Json> {
    let cells = table
        .iter()
        .map(|(name, item)| (name.to_owned(), json!(cell(item))));
    cells.collect()
}
