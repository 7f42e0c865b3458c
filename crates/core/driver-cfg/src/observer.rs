//! The keys that the driver.cfg of an observer cannot have: those about values that an end writes.

use tickbus_base::toml_text::{Table, Value};

/// The keys of `[fieldbus]` and `[[station]]` that an observer cannot have.
pub(super) const OF_LINE: &[&str] = &[
    "write_to",
    "heartbeat",
    "watchdog",
    "at_close",
    "while_stale",
    "max_tsdr",
];

/// Those of `[[signal]]`.
pub(super) const OF_SIGNAL: &[&str] = &["fail_safe", "hold"];

const ENDS: &str = "remove it here; it belongs in the driver.cfg of the machine or of the PLC";

/// Reports those of `keys` that a table has.
pub(super) fn refuse_keys(table: &Table<'_>, keys: &[&str]) {
    for (key, value) in table.all().filter(|(key, _)| keys.contains(key)) {
        value.wrong(
            format!("\"{key}\" is about values that are written, and an observer writes none"),
            ENDS,
        );
    }
}

/// Reports replies, at the first of them.
pub(super) fn refuse_replies(first: &Table<'_>) {
    first.wrong("an observer makes no replies", ENDS);
}

/// Reports faults, in the file or in the file that it names.
pub(super) fn refuse_faults(faults: &Value<'_>) {
    faults.wrong("an observer injects no faults", ENDS);
}
