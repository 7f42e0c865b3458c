//! What the page knows of the signals of one driver or run, and what viewers lack of it.

use serde::Serialize;
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Signal, Slot};

use crate::trend::Trend;
use crate::value::{Number, raw};

/// The other end gets the fail-safe value, or this end sees it.
pub(crate) const FAIL_SAFE: u8 = 1;
/// The signal is forced.
pub(crate) const FORCED: u8 = 2;
/// The data of its station do not count: they are too old, or their PLC has stopped.
pub(crate) const STALE: u8 = 4;
/// No data have ever come, and nothing stands in for them.
pub(crate) const UNKNOWN: u8 = 8;

/// How often the line is looked at in full.
const LINE: Nanos = Nanos::from_millis(500);

/// A time that every line is overdue at.
const NEVER: Nanos = Nanos(i64::MIN / 2);

/// A signal, as it was seen last.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) slot: Slot,
    pub(crate) bits: u64,
    pub(crate) edges: u32,
    pub(crate) flags: u8,
    /// The number of the state in which this was new.
    pub(crate) number: u64,
}

impl Row {
    /// The value, which is none where nothing has ever come.
    pub(crate) fn value(&self, signal: &Signal) -> Number {
        if self.flags & UNKNOWN == 0 {
            Number::of(signal, self.slot)
        } else {
            Number::Real(f64::NAN)
        }
    }

    /// The raw value, likewise.
    pub(crate) fn raw(&self, signal: &Signal) -> String {
        if self.flags & UNKNOWN == 0 {
            raw(signal.data_type, self.bits)
        } else {
            String::new()
        }
    }

    /// The value as something that was measured: NaN where it does not count.
    pub(crate) fn live(&self, signal: &Signal) -> f64 {
        if self.flags & (STALE | UNKNOWN) == 0 {
            Number::of(signal, self.slot).real()
        } else {
            f64::NAN
        }
    }
}

/// All signals, as they were seen last, and the line as JSON.
#[derive(Debug)]
pub(crate) struct Sheet {
    pub(crate) rows: Vec<Row>,
    pub(crate) trend: Trend,
    /// Since when a copy has been asked for that has not come.
    asked: Option<Nanos>,
    /// The one before that had not come when this one was asked for.
    is_slow: bool,
    /// What is known is not older than this.
    known: Nanos,
    /// The line; when that was made, and the number of the state in which it was new.
    line: String,
    line_at: Nanos,
    line_number: u64,
}

/// A signal whose value has changed: index, value, raw, edges, flags.
type ChangeJson = (usize, Number, String, Option<u32>, u8);

impl Sheet {
    /// Of signals with these values, which nobody has looked at yet.
    pub(crate) fn new(now: Nanos, values: &[Slot]) -> Self {
        let row = |slot: &Slot| Row {
            slot: *slot,
            bits: 0,
            edges: 0,
            flags: STALE | UNKNOWN,
            number: 0,
        };
        Self {
            rows: values.iter().map(row).collect(),
            trend: Trend::new(now, values.len()),
            asked: None,
            is_slow: false,
            known: NEVER,
            line: String::new(),
            line_at: NEVER,
            line_number: 0,
        }
    }

    /// Whether a copy has been asked for that has not come.
    pub(crate) fn is_missing(&self) -> bool {
        self.asked.is_some()
    }

    /// A copy is asked for; `is_slow` if the last one had not come until then.
    pub(crate) fn ask(&mut self, now: Nanos, is_slow: bool) {
        self.asked.get_or_insert(now);
        self.is_slow = is_slow;
    }

    /// The copy that was asked for has come. It was made after that, nobody knows how long after.
    pub(crate) fn has_come(&mut self) {
        self.known = self.asked.take().unwrap_or(self.known);
    }

    /// Whether what is known is at least as new as this time.
    pub(crate) fn is_known_at(&self, time: Nanos) -> bool {
        self.known >= time
    }

    /// Whether a look that began then need not wait for it: its copy has come, or will not come soon.
    pub(crate) fn is_complete(&self, begin: Nanos) -> bool {
        self.is_slow || self.is_known_at(begin)
    }

    /// Whether a copy has been asked for since before this time, and has not come.
    pub(crate) fn is_missing_since(&self, time: Nanos) -> bool {
        self.asked.is_some_and(|asked| asked < time)
    }

    /// How long a copy has been asked for that has not come.
    pub(crate) fn missing_for(&self, now: Nanos) -> Nanos {
        self.asked.map_or(Nanos::ZERO, |asked| now - asked)
    }

    /// Takes a signal over as it was seen; tells whether that is new.
    pub(crate) fn put(&mut self, index: usize, seen: Row) -> bool {
        let row = &mut self.rows[index];
        let is_same = (row.slot, row.bits, row.edges, row.flags)
            == (seen.slot, seen.bits, seen.edges, seen.flags);
        if !is_same {
            *row = seen;
        }
        !is_same
    }

    /// Adds what is new in the state with this number to the trends.
    pub(crate) fn go_on(&mut self, now: Nanos, number: u64, signals: &[Signal]) {
        for (index, (signal, row)) in signals.iter().zip(&self.rows).enumerate() {
            if row.number == number {
                self.trend.add(index, row.live(signal), None);
            }
        }
        self.trend.go_on(now);
    }

    /// The signals that are new since the state with this number, as JSON; `None` without any.
    pub(crate) fn changes(&self, signals: &[Signal], since: u64) -> Option<String> {
        let rows = signals.iter().zip(&self.rows).enumerate();
        let rows = rows.filter(|(_, (_, row))| row.number > since);
        let changes: Vec<ChangeJson> = rows
            .map(|(index, (signal, row))| {
                (
                    index,
                    row.value(signal),
                    row.raw(signal),
                    signal.latch.map(|_| row.edges),
                    row.flags,
                )
            })
            .collect();
        (!changes.is_empty()).then(|| serde_json::to_string(&changes).expect("texts and numbers"))
    }

    /// The line as JSON.
    pub(crate) fn line(&self) -> &str {
        &self.line
    }

    /// Whether the line has to be made anew.
    pub(crate) fn is_line_due(&self, now: Nanos) -> bool {
        now - self.line_at >= LINE
    }

    /// Takes over the line that was made at `now`, in the state with this number.
    pub(crate) fn set_line(&mut self, now: Nanos, number: u64, line: String) {
        (self.line, self.line_at, self.line_number) = (line, now, number);
    }

    /// Whether the line is new since the state with this number.
    pub(crate) fn has_new_line(&self, since: u64) -> bool {
        self.line_number > since
    }

    /// Has the line made anew at the next occasion.
    pub(crate) fn forget_line(&mut self) {
        self.line_at = NEVER;
    }
}

/// A signal in full.
#[derive(Serialize)]
pub(crate) struct SignalJson<'a> {
    pub(crate) name: &'a str,
    /// Empty without one.
    pub(crate) address: String,
    #[serde(rename = "type")]
    pub(crate) data_type: &'static str,
    pub(crate) unit: &'a str,
    pub(crate) station: usize,
    /// Seen from a PLC, if there is one.
    pub(crate) direction: Option<&'static str>,
    pub(crate) latch: Option<&'static str>,
    pub(crate) writable: bool,
    pub(crate) value: Number,
    pub(crate) raw: String,
    pub(crate) edges: Option<u32>,
    pub(crate) age_ms: Option<f64>,
    pub(crate) failsafe: bool,
    pub(crate) stale: bool,
    pub(crate) forced: Option<Number>,
}

/// A driver, or a run, in full.
#[derive(Serialize)]
pub(crate) struct DriverJson<'a> {
    pub(crate) id: i32,
    pub(crate) name: &'a str,
    pub(crate) kind: &'static str,
    pub(crate) role: &'static str,
    pub(crate) picture: bool,
    pub(crate) stations: Vec<&'a str>,
    pub(crate) signals: Vec<SignalJson<'a>>,
}
