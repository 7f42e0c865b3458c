//! The table `[fieldbus.at]`: the address of each signal in the device, in the device's own notation.

use tickbus_base::toml_text::{Value, did_you_mean, shown};
use tickbus_image::signal::SignalTable;

/// The longest address, in characters.
const ADDRESS_LIMIT: usize = 500;

/// One line of `[fieldbus.at]`: a signal, and its address in the notation of the device's own tools.
#[derive(Clone, Debug)]
pub struct At<'a> {
    /// The signal's index in the signal table.
    pub signal: usize,
    /// The address; the bus interprets it.
    pub text: &'a str,
    value: Value<'a>,
}

impl<'a> At<'a> {
    /// Reads the table `[fieldbus.at]` in `value`, and reports names that no signal has.
    pub fn read(value: &Value<'a>, table: &SignalTable) -> Vec<Self> {
        const SHAPE: &str =
            "write a [fieldbus.at] table with a line \"<name of a signal>\" = \"<address>\" each";
        let Some(lines) = value.table("[fieldbus.at]", SHAPE) else {
            return Vec::new();
        };
        let read = |(name, value): (&str, Value<'a>)| {
            let Some(signal) = table.position(name) else {
                let names: Vec<&str> = table.signals.iter().map(|s| s.name.as_str()).collect();
                value.wrong(
                    format!("there is no signal \"{}\"", shown(name)),
                    did_you_mean(name, "signals", &names),
                );
                return None;
            };
            let text = value.label(ADDRESS_LIMIT, "write the address in quotes")?;
            Some(Self {
                signal,
                text,
                value,
            })
        };
        let entries = lines.all().filter_map(read).collect();
        lines.finish_open();
        entries
    }

    /// The offset of the address in the text, for [`Collector::report`](crate::config::Collector::report).
    pub fn at(&self) -> usize {
        self.value.at()
    }

    /// Reports a mistake in this address.
    pub fn wrong(&self, what: impl Into<String>, right: impl Into<String>) {
        self.value.wrong(what, right);
    }
}
