//! Reading the file.

use std::collections::BTreeMap;

use tickbus_base::toml_text::{Collector, Table, Value, read_text, shown};
use tickbus_image::signal::section::NAME_LIMIT;

use super::{List, Set};

/// How the other signals are grouped; the first is what a list has without the key.
const GROUPS: [(&str, &str); 4] = [
    ("station", "station"),
    ("prefix", "prefix"),
    ("folder", "folder"),
    ("none", "none"),
];

/// The orders of the other signals.
const ORDERS: [(&str, &str); 2] = [("file", "file"), ("changed", "changed")];

/// The formats of a value.
const FORMATS: [(&str, &str); 4] = [
    ("decimal", "decimal"),
    ("hex", "hex"),
    ("binary", "binary"),
    ("scientific", "scientific"),
];

/// The remedy where a name should be.
const NAME: &str = "name it, such as name = \"Level control\"";

/// The content of the file.
#[derive(Debug, Default)]
pub(super) struct Contents {
    pub(super) lists: Vec<List>,
    pub(super) sets: Vec<Set>,
    /// The names of signals: the line, what names it, and the name.
    pub(super) places: Vec<(usize, String, String)>,
}

/// Reads a file; also returns its mistakes, each with its place and what would be right.
pub(super) fn read(file: &str, text: &str) -> (Contents, Vec<String>) {
    let mut collector = Collector::new(file, text);
    let contents = read_text(&mut collector, text, |root| Some(contents(root)));
    let mistakes = collector.finish().map(|mistakes| mistakes.to_string());
    let lines = mistakes.iter().flat_map(|text| text.lines());
    (
        contents.unwrap_or_default(),
        lines.map(str::to_owned).collect(),
    )
}

fn contents(mut root: Table<'_>) -> Contents {
    let mut contents = Contents::default();
    let lists = root.take("list");
    for table in lists.iter().flat_map(|lists| lists.tables("[[list]]")) {
        let names: Vec<&str> = contents.lists.iter().map(|it| it.name.as_str()).collect();
        if let Some(list) = list(table, &names, &mut contents.places) {
            contents.lists.push(list);
        }
    }
    let sets = root.take("set");
    for table in sets.iter().flat_map(|sets| sets.tables("[[set]]")) {
        let names: Vec<&str> = contents.sets.iter().map(|it| it.name.as_str()).collect();
        if let Some(set) = set(table, &names, &mut contents.places) {
            contents.sets.push(set);
        }
    }
    root.finish();
    contents
}

type Places = Vec<(usize, String, String)>;

/// The name of a list or a set, which no earlier one has.
fn name(table: &mut Table<'_>, earlier: &[&str]) -> Option<String> {
    let value = table.require("name", NAME)?;
    let name = value.label(NAME_LIMIT, NAME)?;
    if earlier.contains(&name) {
        let what = format!("the name \"{}\" stands twice", shown(name));
        value.wrong(what, "give one of them another name");
        return None;
    }
    Some(name.to_owned())
}

fn list(mut table: Table<'_>, earlier: &[&str], places: &mut Places) -> Option<List> {
    const RIGHT: &str = "write [list.formats], with lines such as \"Status\" = \"hex\"";
    const PINS: &str = "write the names of signals, such as [\"Level\", \"Valve\"]";
    let name = name(&mut table, earlier);
    let owner = format!("the list \"{}\"", name.as_deref().unwrap_or_default());
    let mut pins: Vec<String> = Vec::new();
    for value in table
        .take("pins")
        .and_then(|value| value.list(PINS))
        .unwrap_or_default()
    {
        let Some(pin) = value.text(PINS) else {
            continue;
        };
        if pins.iter().any(|known| known == pin) {
            let what = format!("\"{}\" is pinned twice", shown(pin));
            value.wrong(what, "remove one of them");
        }
        places.push((value.line(), owner.clone(), pin.to_owned()));
        pins.push(pin.to_owned());
    }
    let choice = |value: Option<Value<'_>>, kinds, choices: &[(&str, &'static str)]| {
        let value = value.and_then(|value| value.choice(kinds, choices));
        value.unwrap_or(choices[0].1).to_owned()
    };
    let group = choice(table.take("group"), "groups", &GROUPS);
    let order = choice(table.take("order"), "orders", &ORDERS);
    let mut formats = BTreeMap::new();
    let given = table.take("formats");
    let given = given.and_then(|value| value.table("[list.formats]", RIGHT));
    for (signal, value) in given.iter().flat_map(Table::all) {
        if let Some(format) = value.choice("formats", &FORMATS) {
            places.push((value.line(), owner.clone(), signal.to_owned()));
            formats.insert(signal.to_owned(), format.to_owned());
        }
    }
    table.finish();
    Some(List {
        name: name?,
        pins,
        group,
        order,
        formats,
    })
}

fn set(mut table: Table<'_>, earlier: &[&str], places: &mut Places) -> Option<Set> {
    const RIGHT: &str = "write [set.values], with lines such as \"Valve\" = true";
    let name = name(&mut table, earlier);
    let owner = format!("the set \"{}\"", name.as_deref().unwrap_or_default());
    let given = table.require("values", RIGHT);
    let given = given.and_then(|value| value.table("[set.values]", RIGHT));
    let mut values: Vec<(usize, (String, String))> = Vec::new();
    for (signal, value) in given.iter().flat_map(Table::all) {
        if let Some(text) = text_of(&value) {
            places.push((value.line(), owner.clone(), signal.to_owned()));
            values.push((value.at(), (signal.to_owned(), text)));
        }
    }
    // The parser sorts by name; the order of the file is that of people.
    values.sort_by_key(|(at, _)| *at);
    table.finish();
    Some(Set {
        name: name?,
        values: values.into_iter().map(|(_, value)| value).collect(),
    })
}

/// The value of a signal, as it is forced: of 64 bits, or with a base, in quotes.
fn text_of(value: &Value<'_>) -> Option<String> {
    const RIGHT: &str = "write a number, true, false, or a literal in quotes such as \"16#6C00\"";
    if value.is_boolean() {
        return value
            .boolean()
            .map(|on| if on { "TRUE" } else { "FALSE" }.to_owned());
    }
    if value.is_integer() {
        let range = i128::from(i64::MIN)..=i128::from(u64::MAX);
        return value.whole(range).map(|number| number.to_string());
    }
    if let Some(text) = value.as_text() {
        return Some(text.to_owned());
    }
    value.number(RIGHT).map(|number| number.to_string())
}
