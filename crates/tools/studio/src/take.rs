//! Signals for tags of the PLC.

use std::collections::BTreeSet;

use serde::Deserialize;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::section::NAME_LIMIT;
use tickbus_image::signal::{Area, DataType};
use tickbus_import::note;
use toml_edit::{DocumentMut, Item, Value};

use crate::layout;
use crate::literal::cell;
use crate::places::Step;
use crate::propose::Free;
use crate::rename::name_of;
use crate::tables::{Unmade, list_mut, splice, table_at};

/// A tag that becomes a signal.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Taken {
    /// The name of the tag.
    name: String,
    /// The name of the folder that it is in; can be empty.
    #[serde(default)]
    within: String,
    /// The comment of the PLC; can be empty.
    #[serde(default)]
    comment: String,
    /// The address in the device.
    at: String,
    /// The data type, such as `INT`.
    data_type: String,
    /// `I` or `Q`.
    area: String,
}

/// Adds a signal for each tag, behind the first `index` signals, and a line in `[fieldbus.at]`. Returns what was done.
pub(crate) fn take(
    document: &mut DocumentMut,
    tags: &[Taken],
    index: usize,
    station: &str,
) -> Result<String, Unmade> {
    let mut free = Free::of(document, station);
    let map = [Step::Key("fieldbus".to_owned()), Step::Key("at".to_owned())];
    let mut known: BTreeSet<String> = table_at(document, &map)?
        .iter()
        .map(|(_, item)| cell(item))
        .collect();
    let signals = list_mut(document, "signal")?;
    let mut names: BTreeSet<String> = signals.iter().map(name_of).collect();
    let index = index.min(signals.len());
    let neighbour = index.checked_sub(1).and_then(|before| signals.get(before));
    let neighbour = neighbour.or_else(|| signals.get(index)).cloned();
    let (mut new, mut lines, mut was_known) = (Vec::new(), Vec::new(), 0);
    for tag in tags {
        let (data_type, area) = kind_of(tag)?;
        // A tag can be in two folders.
        if !known.insert(tag.at.clone()) {
            was_known += 1;
            continue;
        }
        let name = free_name(tag, &names);
        let address = free.take(area, data_type.width());
        let mut pairs: Vec<(String, Value)> = vec![
            ("name".to_owned(), name.as_str().into()),
            ("address".to_owned(), address.into()),
        ];
        if data_type != DataType::Bool {
            pairs.push(("type".to_owned(), data_type.name().into()));
        }
        if !station.is_empty() {
            pairs.push(("station".to_owned(), station.into()));
        }
        let comment = note(&tag.comment);
        if !comment.is_empty() {
            pairs.push(("comment".to_owned(), comment.into()));
        }
        new.push(layout::table(pairs, neighbour.as_ref()));
        names.insert(name.clone());
        lines.push((name, tag.at.as_str()));
    }
    splice(signals, index, new);
    let told = match &lines[..] {
        [(name, _)] => format!("added signal \"{}\"", shown(name)),
        lines => format!("added {} signals", lines.len()),
    };
    let table = table_at(document, &map)?;
    for (name, place) in lines {
        // A line that no signal had is not in the way of the new one.
        match table.get_mut(&name) {
            Some(item) => *item = Item::Value(place.into()),
            None => layout::insert(table, &name, place.into()),
        }
    }
    Ok(match was_known {
        0 => told,
        1 => format!("{told}; 1 tag was a signal already"),
        count => format!("{told}; {count} tags were signals already"),
    })
}

fn kind_of(tag: &Taken) -> Result<(DataType, Area), Unmade> {
    let data_type = tag.data_type.parse::<DataType>().ok();
    let area = match &*tag.area {
        "I" => Some(Area::Input),
        "Q" => Some(Area::Output),
        _ => None,
    };
    data_type.zip(area).ok_or_else(|| {
        Unmade::Impossible(format!(
            "\"{}\" has neither a type of a signal nor a direction; browse again",
            shown(&tag.name)
        ))
    })
}

/// A name that no signal has: that of the tag, the folder's before it, or a number behind it.
fn free_name(tag: &Taken, names: &BTreeSet<String>) -> String {
    let short = |text: &str| {
        let text: String = text.trim().chars().take(NAME_LIMIT - 8).collect();
        text.trim_end().to_owned()
    };
    let plain = short(&tag.name);
    let plain = if plain.is_empty() {
        "Tag".to_owned()
    } else {
        plain
    };
    let within = short(&format!("{}.{plain}", tag.within.trim()));
    let numbered = (2..).map(|number| format!("{plain} {number}"));
    let mut all = std::iter::once(plain.clone())
        .chain((!tag.within.trim().is_empty()).then_some(within))
        .chain(numbered);
    let found = all.find(|name| !names.contains(name));
    found.unwrap_or(plain)
}
