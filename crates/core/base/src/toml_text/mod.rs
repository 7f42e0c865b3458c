//! Reading configuration text: spans, collected mistakes, nearest names.
//!
//! [`read_text`] parses TOML and passes its root [`Table`] on, and [`parse_text`] returns all mistakes. A reader takes the keys one by one and reports each
//! mistake to the text's [`Collector`] at its position, so that the user sees all of them at once. Nothing here knows
//! the meaning of the keys.

mod key;
mod mistakes;
mod nearest;
mod number;
mod source;
mod syntax;
mod table;

pub use key::{Key, RequiredKey, Shape, TableKind, kind_names, names};
pub use mistakes::{Collector, Mistakes, PlacedMistake, is_unprintable, printable, shown};
pub use nearest::{did_you_mean, nearest};
pub use number::short_number;
pub use source::{load_text, parse_text, read_text};
pub use table::{Table, Value};
