//! The checker's words about the text, each with the cell that they are about.

use std::path::Path;

use serde::Serialize;
use tickbus_base::toml_text::Mistakes;
use tickbus_driver_cfg::{Config, Kinds};
use toml_edit::Document;

use crate::document::body;
use crate::places::{Places, Way};

/// A mistake, and its cell.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Told {
    /// The way to the key or value; empty if the text has none there.
    pub(crate) at: Way,
    /// From 1; 0 if the mistake is the whole file's.
    line: usize,
    column: usize,
    what: String,
    right: String,
}

/// The result of a check.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct Checked {
    pub(crate) mistakes: Vec<Told>,
    /// Settings that contradict each other, in a file without mistakes, and what the table does not show.
    pub(crate) notes: Vec<String>,
    /// True if signals can have addresses in the device on this bus; `None` if a mistake hides it.
    #[serde(rename = "hasPlaces")]
    pub(crate) has_places: Option<bool>,
}

/// Checks the text; a file that has it on the disk is checked with the files that it names.
pub(crate) fn check(path: &Path, text: &str, is_on_disk: bool, kinds: &'static Kinds) -> Checked {
    let read = if is_on_disk {
        Config::load(path, kinds)
    } else {
        Config::parse(&path.display().to_string(), text, kinds)
    };
    match read {
        Ok(config) => Checked {
            notes: (config.contradictions().iter())
                .map(ToString::to_string)
                .collect(),
            has_places: Some(config.bus.has_addresses()),
            ..Checked::default()
        },
        Err(mistakes) => Checked {
            mistakes: placed(text, &mistakes),
            ..Checked::default()
        },
    }
}

fn placed(text: &str, mistakes: &Mistakes) -> Vec<Told> {
    let body = body(text);
    let document = Document::parse(body).ok();
    let places = document.as_ref().map(Places::of).unwrap_or_default();
    let starts: Vec<usize> = std::iter::once(0)
        .chain(body.match_indices('\n').map(|(at, _)| at + 1))
        .collect();
    let tell = |found: &tickbus_base::toml_text::PlacedMistake| {
        let (line, column) = found.place.unwrap_or_default();
        let at = (line.checked_sub(1))
            .and_then(|line| starts.get(line))
            .map(|start| {
                let ahead = body[*start..].chars().take(column.saturating_sub(1));
                start + ahead.map(char::len_utf8).sum::<usize>()
            });
        Told {
            at: at.map(|at| places.at(at)).unwrap_or_default(),
            line,
            column,
            what: found.mistake.what.clone(),
            right: found.mistake.right.clone(),
        }
    };
    mistakes.iter().map(tell).collect()
}
