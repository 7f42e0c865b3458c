//! Time-outs, which the vendor's functions count in milliseconds.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::Value;

/// The longest time-out: a card that is silent for longer will not answer.
const LIMIT: Nanos = Nanos::from_secs(600);

/// Reads a time-out of whole milliseconds; the default is `default`.
pub(crate) fn read(value: Option<Value<'_>>, default: Nanos) -> Option<Nanos> {
    let Some(value) = value else {
        return Some(default);
    };
    let span = value.duration_from(Nanos::from_millis(1), "the card counts in milliseconds")?;
    if span > LIMIT {
        value.wrong(
            format!("{span} is longer than anybody waits for a card"),
            format!("write at most \"{LIMIT}\""),
        );
        return None;
    }
    Some(span)
}

/// A time-out in the unit of the vendor's functions.
pub(crate) fn millis(span: Nanos) -> u32 {
    u32::try_from(span.0 / 1_000_000).unwrap_or(u32::MAX)
}
