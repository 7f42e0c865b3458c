//! The text that a user types into a cell, as a value of TOML.

use tickbus_base::toml_text::{Key, Shape};
use toml_edit::{Item, Value};

/// The value for a key of this shape. What does not fit the shape stays as typed, in quotes: the checker then says what
/// would be right.
pub(crate) fn literal(shape: Option<&Shape>, typed: &str) -> Value {
    let text = typed.trim();
    let quoted = || Value::from(text);
    match shape {
        Some(shape) if is_text(shape) => quoted(),
        Some(shape) if is_number(shape) => number(text).unwrap_or_else(|| other(text)),
        _ => other(text),
    }
}

/// How a cell shows a value: a text without its quotes, everything else as the file has it.
pub(crate) fn cell(item: &Item) -> String {
    match item {
        Item::Value(Value::String(text)) => text.value().clone(),
        Item::Value(value) => value.clone().decorated("", "").to_string(),
        Item::Table(table) => {
            let mut inline = table.clone().into_inline_table();
            inline.fmt();
            Value::InlineTable(inline).to_string()
        }
        _ => String::new(),
    }
}

/// The shape of the key with this name.
pub(crate) fn shape_of<'k>(
    keys: impl IntoIterator<Item = &'k Key>,
    name: &str,
) -> Option<&'k Shape> {
    let mut keys = keys.into_iter();
    keys.find(|key| key.name == name).map(|key| &key.shape)
}

fn is_text(shape: &Shape) -> bool {
    match shape {
        Shape::Text
        | Shape::Label(_)
        | Shape::Pattern(_)
        | Shape::Choice(_)
        | Shape::AnyCase(_)
        | Shape::Duration => true,
        Shape::Any(shapes) => shapes.iter().all(is_text),
        _ => false,
    }
}

fn is_number(shape: &Shape) -> bool {
    match shape {
        Shape::Whole(..) | Shape::Numbers(_) | Shape::Number => true,
        Shape::Any(shapes) => shapes.iter().any(is_number),
        _ => false,
    }
}

/// A number, with a comma or a point.
fn number(text: &str) -> Option<Value> {
    let plain = text.replace('−', "-");
    let point = plain.replace(',', ".");
    let is_decimal = plain.matches(',').count() == 1 && !plain.contains('.');
    let text = if is_decimal { point } else { plain };
    text.parse::<Value>()
        .ok()
        .filter(|value| value.is_integer() || value.is_float())
}

/// A value of TOML as typed, or else the text in quotes.
fn other(text: &str) -> Value {
    let is_whole = |value: &Value| !value.is_datetime();
    let parsed = text.parse::<Value>().ok().filter(is_whole);
    parsed.unwrap_or_else(|| Value::from(text))
}
