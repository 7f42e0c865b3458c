//! Edits of a driver.cfg, which keep its comments, its order and its columns.

use serde::Deserialize;
use tickbus_base::toml_text::{Key, Shape, shown};
use toml_edit::{ArrayOfTables, DocumentMut, Item, TableLike, Value};

use crate::document::{parsed, written};
use crate::layout;
use crate::literal::{cell, literal, shape_of};
use crate::places::{Step, Way};
use crate::rename::{follow, name_of};
use crate::tables::{Unmade, list_mut, shift, table_at};
use crate::take::{Taken, take};

/// One change of the file.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum Edit {
    /// A cell gets another text; without text the key goes. `was` is what the editor saw there, and `of` the name in
    /// the table.
    Set {
        at: Way,
        #[serde(default)]
        was: String,
        to: String,
        #[serde(default)]
        of: Option<String>,
    },
    /// A new table in a list, such as a `[[signal]]`, at this place; its cells are keys and texts, in order.
    Add {
        list: String,
        index: usize,
        cells: Vec<(String, String)>,
    },
    /// A table of a list goes. `was` is the name that the editor saw in it.
    Remove {
        list: String,
        index: usize,
        was: String,
    },
    /// A table of a list goes to another place in it.
    Move {
        list: String,
        index: usize,
        was: String,
        to: usize,
    },
    /// Signals for tags of the PLC, behind the first `index` signals, each with its address in the device.
    Take {
        tags: Vec<Taken>,
        index: usize,
        #[serde(default)]
        station: String,
    },
    /// The whole text is replaced. `was` is the number of the version that the editor saw.
    Text { was: u64, to: String },
}

/// A text that an edit has made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Made {
    pub(crate) text: String,
    /// The edit in words.
    pub(crate) done: String,
    /// Changes beside the cell that was edited, in words; can be empty.
    pub(crate) told: String,
}

/// The keys of a driver.cfg, as an edit needs to know them.
pub(crate) trait Shapes {
    /// The keys of a table of the file, such as `driver`, or of each in a list of tables.
    fn keys(&self, table: &str, kind: &str) -> Vec<&'static Key>;
}

/// Makes an edit in a text.
pub(crate) fn make(text: &str, edit: &Edit, shapes: &dyn Shapes) -> Result<Made, Unmade> {
    // This is how a text that is no TOML gets mended.
    if let Edit::Text { to, .. } = edit {
        return Ok(Made {
            text: layout::ends_as(text, to.clone()),
            done: "edited the text".to_owned(),
            told: String::new(),
        });
    }
    let mut told = String::new();
    let mut document = parsed(text).map_err(Unmade::Impossible)?;
    let done = match edit {
        Edit::Set { at, was, to, of } => {
            if let (Some(of), [Step::Key(list), Step::Index(index), ..]) = (of, &at[..]) {
                find(list_mut(&mut document, list)?, list, *index, of)?;
            }
            let mut done = set(&mut document, at, was, to, shapes)?;
            if let [Step::Key(list), Step::Index(_), Step::Key(key)] = &at[..]
                && (list.as_str(), key.as_str()) == ("signal", "name")
            {
                told = follow(&mut document, was, to.trim());
                if !told.is_empty() {
                    done = format!("{done}; {told}");
                }
            }
            done
        }
        Edit::Add { list, index, cells } => add(&mut document, list, *index, cells, shapes)?,
        Edit::Remove { list, index, was } => {
            let tables = list_mut(&mut document, list)?;
            find(tables, list, *index, was)?;
            tables.remove(*index);
            format!("removed {list} {}", quoted(was))
        }
        Edit::Move {
            list,
            index,
            was,
            to,
        } => {
            let tables = list_mut(&mut document, list)?;
            find(tables, list, *index, was)?;
            shift(tables, *index, *to);
            format!("moved {list} {}", quoted(was))
        }
        Edit::Take {
            tags,
            index,
            station,
        } => {
            told = take(&mut document, tags, *index, station)?;
            told.clone()
        }
        Edit::Text { .. } => String::new(),
    };
    Ok(Made {
        text: written(text, &document),
        done,
        told,
    })
}

/// Puts the keys of a `[fieldbus]` table, which is a text of TOML, into that of a file. Returns the new text, and what was
/// done.
pub(crate) fn adopt(text: &str, table: &str) -> Result<(String, String), Unmade> {
    let found = parsed(table).map_err(Unmade::Impossible)?;
    let mut document = parsed(text).map_err(Unmade::Impossible)?;
    let own = table_at(&mut document, &[Step::Key("fieldbus".to_owned())])?;
    let keys = found.get("fieldbus").and_then(Item::as_table_like);
    for (name, item) in keys.into_iter().flat_map(TableLike::iter) {
        let Some(value) = item.as_value() else {
            continue;
        };
        let mut value = value.clone().decorated("", "");
        if let Some(Item::Value(old)) = own.get_mut(name) {
            *value.decor_mut() = old.decor().clone();
            *old = value;
        } else {
            own.remove(name);
            layout::insert(own, name, value);
        }
    }
    Ok((written(text, &document), "took over a device".to_owned()))
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", shown(text))
}

/// A text of a cell for people: a conflict shows it.
fn or_nothing(text: &str) -> String {
    if text.is_empty() {
        "nothing".to_owned()
    } else {
        quoted(text)
    }
}

fn set(
    document: &mut DocumentMut,
    at: &[Step],
    was: &str,
    to: &str,
    shapes: &dyn Shapes,
) -> Result<String, Unmade> {
    let [first @ .., Step::Key(name)] = at else {
        return Err(Unmade::Impossible("an edit names no key".to_owned()));
    };
    let kind = kind(document);
    let table = table_at(document, first)?;
    let present = table.get(name).map(cell).unwrap_or_default();
    if present != was {
        return Err(Unmade::Conflict(format!(
            "{name} has become {} meanwhile, and was {}",
            or_nothing(&present),
            or_nothing(was)
        )));
    }
    let of = match first {
        [Step::Key(table), ..] => table.as_str(),
        _ => "",
    };
    let label = label(first, table, name);
    if to.trim().is_empty() {
        table.remove(name);
        return Ok(format!("{label}: removed {name}"));
    }
    let keys = shapes.keys(of, &kind);
    let map = [Step::Key("fieldbus".to_owned()), Step::Key("at".to_owned())];
    let shape = if first == map {
        Some(&Shape::Text)
    } else {
        shape_of(keys.iter().copied(), name)
    };
    let mut value = literal(shape, to);
    match table.get_mut(name) {
        Some(Item::Value(old)) => {
            *value.decor_mut() = old.decor().clone();
            *old = value;
        }
        Some(item) => *item = Item::Value(value),
        None => layout::insert(table, name, value),
    }
    Ok(format!("{label}: {name} {}", quoted(to.trim())))
}

/// The subject of an edit: the name of the signal, or the table.
fn label(way: &[Step], table: &dyn TableLike, key: &str) -> String {
    let name = table.get("name").map(cell).filter(|_| key != "name");
    match (way, name) {
        ([Step::Key(list), Step::Index(index), ..], None) => format!("{list} {}", index + 1),
        ([_, Step::Index(_), ..], Some(name)) => shown(&name),
        _ => {
            let keys = way.iter().filter_map(|step| match step {
                Step::Key(name) => Some(name.as_str()),
                Step::Index(_) => None,
            });
            let keys: Vec<&str> = keys.collect();
            format!("[{}]", keys.join("."))
        }
    }
}

/// The kind of bus, as far as the file states one.
pub(crate) fn kind(document: &DocumentMut) -> String {
    let kind = document.get("fieldbus").and_then(|table| table.get("kind"));
    kind.map(cell).unwrap_or_default()
}

/// Checks that the table that the editor saw is still there.
fn find(tables: &ArrayOfTables, list: &str, index: usize, was: &str) -> Result<(), Unmade> {
    if tables.get(index).map(name_of).as_deref() == Some(was) {
        return Ok(());
    }
    Err(Unmade::Conflict(format!(
        "{list} {} is not at its place any more; look at the list, which has changed",
        quoted(was)
    )))
}

fn add(
    document: &mut DocumentMut,
    list: &str,
    index: usize,
    cells: &[(String, String)],
    shapes: &dyn Shapes,
) -> Result<String, Unmade> {
    let kind = kind(document);
    let keys = shapes.keys(list, &kind);
    let tables = list_mut(document, list)?;
    let index = index.min(tables.len());
    let mut pairs: Vec<(String, Value)> = Vec::new();
    let mut name = "";
    for (key, text) in cells {
        if key == "name" {
            name = text;
        }
        if !text.trim().is_empty() && !pairs.iter().any(|(known, _)| known == key) {
            let shape = shape_of(keys.iter().copied(), key);
            pairs.push((key.clone(), literal(shape, text)));
        }
    }
    let neighbour = index.checked_sub(1).and_then(|index| tables.get(index));
    let table = layout::table(pairs, neighbour.or_else(|| tables.get(index)));
    tables.push(table);
    let last = tables.len() - 1;
    shift(tables, last, index);
    Ok(format!("added {list} {}", quoted(name)))
}
