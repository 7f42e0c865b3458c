//! The comment and the folder of a signal.

use tickbus_base::toml_text::{Key, Shape, Table};

/// The longest comment and the longest folder, in characters.
pub const NOTE_LIMIT: usize = 200;

/// The key `comment`.
pub(super) const COMMENT: Key = Key::new(
    "comment",
    Shape::Label(NOTE_LIMIT),
    "A comment for people, such as that of the PLC's tag list",
);

/// The key `folder`.
pub(super) const FOLDER: Key = Key::new(
    "folder",
    Shape::Label(NOTE_LIMIT),
    "The tag table, list or program of the PLC's project that has the signal, for people",
);

/// Texts about a signal, for people; each may be empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Notes {
    /// The comment, as in the PLC's project.
    pub comment: String,
    /// The tag table, list or program of the PLC's project that has the signal.
    pub folder: String,
}

/// Takes both keys out of a section; `None` if it has neither.
pub(super) fn take(table: &mut Table<'_>) -> Option<Box<Notes>> {
    const RIGHT: &str = "write a text in quotes, or leave the key out";
    let mut read = |key| {
        let value = table.take(key);
        let text = value.and_then(|value| value.label(NOTE_LIMIT, RIGHT));
        text.unwrap_or_default().to_owned()
    };
    let notes = Notes {
        comment: read("comment"),
        folder: read("folder"),
    };
    (notes != Notes::default()).then(|| Box::new(notes))
}
