//! The table `[fieldbus.at]`: the address of each signal in the device, in the device's own notation.

use std::ops::Range;

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Value, did_you_mean, shown};
use tickbus_image::signal::{Area, Signal, SignalTable};

/// The longest address, in characters.
pub const ADDRESS_LIMIT: usize = 500;

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

    /// The offset of the address in the text, for [`Collector::report`](tickbus_base::toml_text::Collector::report).
    pub fn at(&self) -> usize {
        self.value.at()
    }

    /// Reports a mistake in this address.
    pub fn wrong(&self, what: impl Into<String>, right: impl Into<String>) {
        self.value.wrong(what, right);
    }

    /// As [`wrong`](Self::wrong), for a mistake that other code has found.
    pub fn refuse(&self, mistake: Mistake) {
        self.value.refuse(mistake);
    }
}

/// The pairs of signals at the same place: a signal of area `writes` is written where a signal of the other area is
/// read, and `[fieldbus.at]` has placed at least one of the two. `places` returns the objects that hold a signal, and
/// the signal's bits in each.
///
/// Such a pair can be intended: a handshake that the PLC resets is both written and read. But a simulation that reads
/// its own value takes it for the PLC's.
pub fn both_ways<Object: PartialEq>(
    table: &SignalTable,
    writes: Area,
    is_placed: impl Fn(&Signal) -> bool,
    places: impl Fn(&Signal) -> Vec<(Object, Range<usize>)>,
) -> Vec<(usize, usize)> {
    let signals = table.signals.iter().enumerate();
    let (written, read): (Vec<_>, Vec<_>) = signals
        .map(|(index, signal)| (index, signal, is_placed(signal), places(signal)))
        .partition(|(_, signal, ..)| signal.area == writes);
    let mut found = Vec::new();
    for (one, _, is_one_placed, its) in &written {
        let others = read.iter().filter(|(.., is_placed, theirs)| {
            (*is_placed || *is_one_placed)
                && its.iter().any(|(object, bits)| {
                    theirs.iter().any(|(other, others)| {
                        object == other && bits.start < others.end && others.start < bits.end
                    })
                })
        });
        found.extend(others.map(|(other, ..)| (*one, *other)));
    }
    found
}
