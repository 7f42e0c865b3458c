//! The tables of a document: found by their way, and their lists with new and moved ones.

use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, TableLike};

use crate::places::Step;

/// Why an edit was not made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Unmade {
    /// Somebody else has changed the same place meanwhile.
    Conflict(String),
    /// The file does not have what the edit names.
    Impossible(String),
}

/// The table at the end of this way; tables that are missing are added.
pub(crate) fn table_at<'d>(
    document: &'d mut DocumentMut,
    way: &[Step],
) -> Result<&'d mut dyn TableLike, Unmade> {
    let gone = || Unmade::Conflict("this place has gone meanwhile".to_owned());
    let mut steps = way.iter().peekable();
    let mut table: &mut dyn TableLike = document.as_table_mut();
    while let Some(step) = steps.next() {
        let Step::Key(name) = step else {
            return Err(gone());
        };
        if let Some(Step::Index(index)) = steps.peek() {
            steps.next();
            let tables = table.get_mut(name).and_then(Item::as_array_of_tables_mut);
            table = tables
                .and_then(|tables| tables.get_mut(*index))
                .ok_or_else(gone)?;
        } else {
            let item = table
                .entry(name)
                .or_insert_with(|| Item::Table(Table::new()));
            table = item.as_table_like_mut().ok_or_else(|| {
                Unmade::Impossible(format!("{name} is no table; mend that in the text"))
            })?;
        }
    }
    Ok(table)
}

pub(crate) fn list_mut<'d>(
    document: &'d mut DocumentMut,
    list: &str,
) -> Result<&'d mut ArrayOfTables, Unmade> {
    let item = document
        .entry(list)
        .or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()));
    item.as_array_of_tables_mut().ok_or_else(|| {
        Unmade::Impossible(format!(
            "the file does not write each {list} as [[{list}]]; edit it in its text"
        ))
    })
}

/// Puts new tables into a list, behind the first `index`.
pub(crate) fn splice(tables: &mut ArrayOfTables, index: usize, mut new: Vec<Table>) {
    let mut all: Vec<Table> = std::mem::take(tables).into_iter().collect();
    let index = index.min(all.len());
    if index == 0 {
        // Ahead of the next: another table may be last in the text, such as [fieldbus.at].
        let first = all.first().and_then(Table::position);
        for table in &mut new {
            table.set_position(first);
        }
    }
    all.splice(index..index, new);
    *tables = all.into_iter().collect();
}

/// Takes a table to another place of its list, with all that is in it.
pub(crate) fn shift(tables: &mut ArrayOfTables, from: usize, to: usize) {
    let mut all: Vec<Table> = std::mem::take(tables).into_iter().collect();
    let mut table = all.remove(from);
    // Written behind the one before it, and not at the place where it was.
    unplace(&mut table);
    if to == 0 {
        // Without one before it, ahead of the next: another table may be last in the text, such as [fieldbus.at].
        table.set_position(all.first().and_then(Table::position));
    }
    all.insert(to.min(all.len()), table);
    *tables = all.into_iter().collect();
}

fn unplace(table: &mut Table) {
    table.set_position(None);
    for (_, item) in table.iter_mut() {
        match item {
            Item::Table(inner) => unplace(inner),
            Item::ArrayOfTables(inner) => inner.iter_mut().for_each(unplace),
            _ => {}
        }
    }
}
