//! The keys of a table, declared beside the code that reads them: for the schema with which editors complete and check
//! a file.

use std::ops::RangeInclusive;

/// One key of a table.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// The key as the file writes it.
    pub name: &'static str,
    /// The values that it can have.
    pub shape: Shape,
    /// The meaning, in one line: for people.
    pub doc: &'static str,
    /// True if a table without this key is wrong.
    pub is_required: bool,
    /// The value of a table without this key, as the file writes it; `None` if the value depends on other keys, or if
    /// there is none.
    pub default: Option<&'static str>,
}

impl Key {
    /// Returns a key that can be left out.
    pub const fn new(name: &'static str, shape: Shape, doc: &'static str) -> Self {
        Self {
            name,
            shape,
            doc,
            is_required: false,
            default: None,
        }
    }

    /// Returns a key that every such table has.
    pub const fn required(name: &'static str, shape: Shape, doc: &'static str) -> Self {
        Self {
            is_required: true,
            ..Self::new(name, shape, doc)
        }
    }

    /// Adds the value of a table without this key.
    #[must_use]
    pub const fn or(self, default: &'static str) -> Self {
        Self {
            default: Some(default),
            ..self
        }
    }
}

/// The keys of one kind of tables, where a key `kind` says which keys belong to a table.
#[derive(Clone, Copy, Debug)]
pub struct TableKind {
    /// The kind's name.
    pub name: &'static str,
    /// The keys that it needs.
    pub required: &'static [RequiredKey],
    /// The keys that it can have.
    pub optional: &'static [&'static str],
    /// True if a table of this kind needs a name: elsewhere a name is for messages only.
    pub needs_name: bool,
}

/// A key that one kind of tables needs.
#[derive(Clone, Copy, Debug)]
pub struct RequiredKey {
    /// The key.
    pub name: &'static str,
    /// The values that it has in tables of this kind.
    pub shape: Shape,
    /// The remedy for a table without it.
    pub right: &'static str,
}

impl TableKind {
    /// Returns a kind whose tables need no name.
    pub const fn new(
        name: &'static str,
        required: &'static [RequiredKey],
        optional: &'static [&'static str],
    ) -> Self {
        Self {
            name,
            required,
            optional,
            needs_name: false,
        }
    }

    /// Returns all of its own keys.
    pub fn keys(&self) -> impl Iterator<Item = &'static str> {
        let required = self.required.iter().map(|key| key.name);
        required.chain(self.optional.iter().copied())
    }
}

/// Returns the names of kinds of tables.
pub const fn kind_names<const N: usize>(kinds: &[TableKind; N]) -> [&'static str; N] {
    let mut names = [""; N];
    let mut index = 0;
    while index < N {
        names[index] = kinds[index].name;
        index += 1;
    }
    names
}

/// The values that a key can have, as far as they can be checked without the rest of the file.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// Any text.
    Text,
    /// A [label](super::Value::label) of at most this many characters.
    Label(usize),
    /// A text in a certain notation: a regular expression that the whole text matches.
    Pattern(&'static str),
    /// One of these names.
    Choice(&'static [&'static str]),
    /// One of these names, in capitals or in small letters.
    AnyCase(&'static [&'static str]),
    /// True or false.
    Boolean,
    /// A whole number from the first to the second.
    Whole(i128, i128),
    /// One of these whole numbers.
    Numbers(&'static [u32]),
    /// A number, with or without a fraction.
    Number,
    /// A duration in quotes, with its unit.
    Duration,
    /// A list of elements of one shape: at least and at most so many.
    List(&'static Self, usize, usize),
    /// A table with these keys.
    Table(&'static [Key]),
    /// A table whose keys the user chooses; their values have this shape.
    Map(&'static Self),
    /// A value of any of these shapes.
    Any(&'static [Self]),
}

impl Shape {
    /// A host and a port: `127.0.0.1:20030`.
    pub const ADDRESS: Self = Self::Pattern("[^\\s]+:[0-9]+");

    /// Returns the shape of a whole number in `range`.
    pub const fn whole(range: &RangeInclusive<i128>) -> Self {
        Self::Whole(*range.start(), *range.end())
    }
}

/// Returns the names in the pairs from which [`choice`](super::Value::choice) chooses.
pub const fn names<T, const N: usize>(choices: &[(&'static str, T); N]) -> [&'static str; N] {
    let mut names = [""; N];
    let mut index = 0;
    while index < N {
        names[index] = choices[index].0;
        index += 1;
    }
    names
}
