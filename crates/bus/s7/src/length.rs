//! The length of PDUs.

use tickbus_base::toml_text::Value;

/// The longest PDU that our server agrees to, as of the largest CPUs.
pub(super) const LONGEST: u16 = 960;

/// The PDU length of the smallest CPUs.
pub(super) const LEAST: u16 = 240;

/// The shortest PDU with room for an item.
pub(super) const SHORTEST: u16 = 64;

/// Reads the longest PDU length to agree to.
pub(crate) fn read_length(value: &Value<'_>) -> Option<u16> {
    let range = i128::from(LEAST)..=i128::from(LONGEST);
    value
        .whole(range)
        .and_then(|length| u16::try_from(length).ok())
}
