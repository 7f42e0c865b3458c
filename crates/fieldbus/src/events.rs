//! The key `events` of a bus that knows what was written.

use tickbus_base::toml_text::{Value, shown};

/// Reads `events` of a bus that knows what was written: whether changes are reported as events, and whether every
/// write is.
pub fn read_events(value: &Value<'_>) -> Option<(bool, bool)> {
    if value.is_boolean() {
        return value.boolean().map(|events| (events, false));
    }
    let right = "write true for every change, \"writes\" for every write, changed or not, or false";
    let text = value.text(right)?;
    if text != "writes" {
        value.wrong(format!("\"{}\" is no kind of events", shown(text)), right);
        return None;
    }
    Some((true, true))
}
