//! The recent history of a signal, for failure messages.

use std::fmt::Write as _;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::short_number;
use tickbus_image::signal::{DataType, Signal, Slot};

pub(super) use tickbus_reply::real;

/// How many changes are kept.
const KEPT: usize = 8;

/// A signal's recent history. Updating it allocates nothing.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    slot: Slot,
    value: f64,
    /// Ring buffer of the last changes: previous value, and tick.
    past: [(f64, u64); KEPT],
    changes: u64,
    rises: u64,
    falls: u64,
}

/// A value of `signal` as readable text: `on`, `12.5 mm`.
pub(super) fn text_of(value: f64, signal: &Signal) -> String {
    if signal.data_type == DataType::Bool {
        return (if value == 0.0 { "off" } else { "on" }).to_owned();
    }
    match &signal.unit {
        None => short_number(value),
        Some(unit) => format!("{} {unit}", short_number(value)),
    }
}

/// A point in simulation time as readable text.
pub(super) fn moment(tick: u64, step: Nanos) -> String {
    format!("tick {tick} ({})", seconds(tick, step))
}

/// A number of ticks as readable text.
pub(super) fn span(ticks: u64, step: Nanos) -> String {
    let plural = if ticks == 1 { "tick" } else { "ticks" };
    format!("{ticks} {plural} ({})", seconds(ticks, step))
}

/// The time of some ticks as readable text.
pub(super) fn seconds(ticks: u64, step: Nanos) -> String {
    let nanos = i64::try_from(ticks)
        .unwrap_or(i64::MAX)
        .saturating_mul(step.0);
    if nanos < 1_000_000_000 {
        return Nanos(nanos).to_string();
    }
    let (whole, part) = (nanos / 1_000_000_000, nanos % 1_000_000_000);
    let text = format!("{whole}.{part:09}");
    format!("{}s", text.trim_end_matches('0').trim_end_matches('.'))
}

impl Watch {
    pub(super) fn new(slot: Slot, signal: &Signal) -> Self {
        Self {
            slot,
            value: real(slot, signal),
            past: [(0.0, 0); KEPT],
            changes: 0,
            rises: 0,
            falls: 0,
        }
    }

    /// Updates the history at the end of `tick`.
    pub(super) fn look(&mut self, slot: Slot, signal: &Signal, tick: u64) {
        if slot == self.slot {
            return;
        }
        let now = real(slot, signal);
        let place = usize::try_from(self.changes % KEPT as u64).unwrap_or_default();
        self.past[place] = (self.value, tick);
        self.changes += 1;
        match (self.value != 0.0, now != 0.0) {
            (false, true) => self.rises += 1,
            (true, false) => self.falls += 1,
            _ => {}
        }
        (self.slot, self.value) = (slot, now);
    }

    pub(super) const fn value(&self) -> f64 {
        self.value
    }

    pub(super) const fn rises(&self) -> u64 {
        self.rises
    }

    pub(super) const fn falls(&self) -> u64 {
        self.falls
    }

    pub(super) const fn changes(&self) -> u64 {
        self.changes
    }

    /// The last changes as one line.
    pub(super) fn history(&self, signal: &Signal, step: Nanos) -> String {
        let head = format!(
            "last changes of \"{}\" ({}): ",
            signal.name,
            signal.address()
        );
        let first = self.changes.saturating_sub(KEPT as u64);
        if self.changes == 0 {
            let now = text_of(self.value, signal);
            return format!("{head}none, it is {now} since the test began");
        }
        let past =
            |change: u64| self.past[usize::try_from(change % KEPT as u64).unwrap_or_default()];
        let mut text = head;
        text.push_str(if first == 0 { "" } else { "… " });
        text.push_str(&text_of(past(first).0, signal));
        for change in first..self.changes {
            let next = if change + 1 < self.changes {
                past(change + 1).0
            } else {
                self.value
            };
            // Writing to a string cannot fail.
            let _ = write!(
                text,
                " → {} at {}",
                text_of(next, signal),
                moment(past(change).1, step)
            );
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_written_as_people_read_them() {
        let step = Nanos::from_millis(2);
        assert_eq!(moment(0, step), "tick 0 (0s)");
        assert_eq!(moment(20, step), "tick 20 (40ms)");
        assert_eq!(moment(4156, step), "tick 4156 (8.312s)");
        assert_eq!(moment(5000, step), "tick 5000 (10s)");
        assert_eq!(span(1, step), "1 tick (2ms)");
    }
}
