//! Keys and their shapes as JSON schemas.

use serde_json::{Map, Value, json};
use tickbus_base::toml_text::{Key, Shape};

/// A text without blanks around it.
const TRIMMED: &str = "^\\S(.*\\S)?$";

/// A duration, as [`Nanos`](tickbus_base::time::Nanos) reads it.
const DURATION: &str = "^\\s*[0-9]+(\\.[0-9]+)?\\s*(h|min|s|ms|us|ns)\\s*$";

/// Returns the schema of a key, with its description and its default.
pub(crate) fn described(key: &Key) -> Value {
    let mut schema = of(&key.shape);
    schema["description"] = json!(key.doc);
    if let Some(default) = key.default {
        // A text, a number, a boolean and a list of texts are written in TOML as in JSON.
        schema["default"] = serde_json::from_str(default).expect("a default without tables");
    }
    schema
}

/// Returns the schema of a table with these keys and no others; it has at least one of `one_of`, unless that is empty.
pub(crate) fn table(keys: &[Key], one_of: &[&str]) -> Value {
    let properties: Map<String, Value> = keys
        .iter()
        .map(|key| (key.name.to_owned(), described(key)))
        .collect();
    let required = keys.iter().filter(|key| key.is_required);
    let required: Vec<&str> = required.map(|key| key.name).collect();
    let mut table = json!({
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": false,
    });
    if !one_of.is_empty() {
        let one_of = one_of.iter().map(|key| json!({ "required": [key] }));
        table["anyOf"] = one_of.collect();
    }
    table
}

/// Returns the schema of a value.
pub(crate) fn of(shape: &Shape) -> Value {
    match *shape {
        Shape::Text => json!({ "type": "string" }),
        Shape::Label(longest) => {
            json!({ "type": "string", "pattern": TRIMMED, "maxLength": longest })
        }
        Shape::Pattern(pattern) => {
            json!({ "type": "string", "pattern": format!("^(?:{pattern})$") })
        }
        Shape::Choice(names) => json!({ "type": "string", "enum": names }),
        Shape::AnyCase(names) => {
            let patterns: Vec<String> = names.iter().map(|name| any_case(name)).collect();
            let pattern = format!("^(?:{})$", patterns.join("|"));
            // The names are for editors, which offer them.
            json!({ "type": "string", "anyOf": [{ "enum": names }, { "pattern": pattern }] })
        }
        Shape::Boolean => json!({ "type": "boolean" }),
        Shape::Whole(least, greatest) => {
            json!({ "type": "integer", "minimum": number(least), "maximum": number(greatest) })
        }
        Shape::Numbers(numbers) => json!({ "type": "integer", "enum": numbers }),
        Shape::Number => json!({ "type": "number" }),
        Shape::Duration => json!({ "type": "string", "pattern": DURATION }),
        Shape::List(element, least, most) => {
            let mut list = json!({ "type": "array", "items": of(element) });
            if least > 0 {
                list["minItems"] = json!(least);
            }
            if most < usize::MAX {
                list["maxItems"] = json!(most);
            }
            list
        }
        Shape::Table(keys) => table(keys, &[]),
        Shape::Map(value) => json!({ "type": "object", "additionalProperties": of(value) }),
        Shape::Any(shapes) => json!({ "anyOf": shapes.iter().map(of).collect::<Value>() }),
    }
}

/// Returns a regular expression for `name` in capitals or in small letters.
fn any_case(name: &str) -> String {
    let letters = name.chars();
    let either = letters.map(|letter| {
        format!(
            "[{}{}]",
            letter.to_ascii_uppercase(),
            letter.to_ascii_lowercase()
        )
    });
    either.collect()
}

/// Returns a limit as JSON can have it: all limits are within 64 bits, with or without a sign.
fn number(limit: i128) -> Value {
    match u64::try_from(limit) {
        Ok(limit) => json!(limit),
        Err(_) => json!(i64::try_from(limit).unwrap_or(i64::MIN)),
    }
}
