//! The page's knowledge of the signals of one driver or run, and the updates for viewers.

use serde::ser::SerializeSeq as _;
use serde::{Serialize, Serializer};
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Signal, Slot};

use crate::value::{Number, raw, raw_follows};

/// The other end gets the fail-safe value, or this end does.
pub(crate) const FAIL_SAFE: u8 = 1;
/// The signal is forced.
pub(crate) const FORCED: u8 = 2;
/// The data of the station are stale: they are too old, or the PLC has stopped.
pub(crate) const STALE: u8 = 4;
/// No data have ever come, and there is no substitute.
pub(crate) const UNKNOWN: u8 = 8;

/// How often the line is made in full.
const LINE: Nanos = Nanos::from_millis(500);

/// A time at which every line is overdue.
const NEVER: Nanos = Nanos(i64::MIN / 2);

/// A signal, as last seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) slot: Slot,
    pub(crate) bits: u64,
    pub(crate) edges: u32,
    pub(crate) flags: u8,
    /// The number of the state in which this row was new.
    pub(crate) number: u64,
}

impl Row {
    /// The value; no number if no data have ever come.
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

    /// The value as a measurement: NaN if it is stale or unknown.
    pub(crate) fn live(&self, signal: &Signal) -> f64 {
        if self.flags & (STALE | UNKNOWN) == 0 {
            Number::of(signal, self.slot).real()
        } else {
            f64::NAN
        }
    }

    /// The row of the signal with this index, for viewers.
    pub(crate) fn json(&self, index: usize, signal: &Signal) -> ChangeJson {
        let follows = self.flags & UNKNOWN == 0 && raw_follows(signal, self.slot, self.bits);
        ChangeJson {
            index,
            value: self.value(signal),
            raw: (!follows).then(|| self.raw(signal)),
            edges: signal.latch.map(|_| self.edges),
            flags: self.flags,
        }
    }
}

/// All signals as last seen, and the line as JSON.
#[derive(Debug)]
pub(crate) struct Sheet {
    pub(crate) rows: Vec<Row>,
    /// The time of the request for the copy that has not come.
    asked: Option<Nanos>,
    /// The previous copy had not come when this one was requested.
    is_slow: bool,
    /// The known values are no older than this.
    known: Nanos,
    /// The line; when it was made, and the number of the state in which it was new.
    line: String,
    line_at: Nanos,
    line_number: u64,
}

/// A signal whose value has changed, as a list: index, value, raw, edges, flags. The raw value is `null` if it
/// follows from the value, and the end of the list is left out where it is `null` and 0.
#[derive(Debug)]
pub(crate) struct ChangeJson {
    index: usize,
    value: Number,
    pub(crate) raw: Option<String>,
    pub(crate) edges: Option<u32>,
    flags: u8,
}

impl Serialize for ChangeJson {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut list = serializer.serialize_seq(None)?;
        list.serialize_element(&self.index)?;
        list.serialize_element(&self.value)?;
        let has_flags = self.flags != 0;
        let has_edges = has_flags || self.edges.is_some();
        if has_edges || self.raw.is_some() {
            list.serialize_element(&self.raw)?;
        }
        if has_edges {
            list.serialize_element(&self.edges)?;
        }
        if has_flags {
            list.serialize_element(&self.flags)?;
        }
        list.end()
    }
}

impl Sheet {
    /// A sheet of signals with these values, which have not been looked at yet.
    pub(crate) fn new(values: &[Slot]) -> Self {
        let row = |slot: &Slot| Row {
            slot: *slot,
            bits: 0,
            edges: 0,
            flags: STALE | UNKNOWN,
            number: 0,
        };
        Self {
            rows: values.iter().map(row).collect(),
            asked: None,
            is_slow: false,
            known: NEVER,
            line: String::new(),
            line_at: NEVER,
            line_number: 0,
        }
    }

    /// True if a requested copy has not come.
    pub(crate) fn is_missing(&self) -> bool {
        self.asked.is_some()
    }

    /// A copy is requested; `is_slow` if the last one had not come by then.
    pub(crate) fn ask(&mut self, now: Nanos, is_slow: bool) {
        self.asked.get_or_insert(now);
        self.is_slow = is_slow;
    }

    /// The requested copy has come. It was made some unknown time after the request.
    pub(crate) fn has_come(&mut self) {
        self.known = self.asked.take().unwrap_or(self.known);
    }

    /// True if the known values are at least as new as this time.
    pub(crate) fn is_known_at(&self, time: Nanos) -> bool {
        self.known >= time
    }

    /// True if a look that began at this time need not wait: the copy has come, or will not come soon.
    pub(crate) fn is_complete(&self, begin: Nanos) -> bool {
        self.is_slow || self.is_known_at(begin)
    }

    /// True if a copy was requested before this time, and has not come.
    pub(crate) fn is_missing_since(&self, time: Nanos) -> bool {
        self.asked.is_some_and(|asked| asked < time)
    }

    /// How long a requested copy has been missing.
    pub(crate) fn missing_for(&self, now: Nanos) -> Nanos {
        self.asked.map_or(Nanos::ZERO, |asked| now - asked)
    }

    /// Stores the state of a signal; returns true if that is new.
    pub(crate) fn put(&mut self, index: usize, seen: Row) -> bool {
        let row = &mut self.rows[index];
        let is_same = (row.slot, row.bits, row.edges, row.flags)
            == (seen.slot, seen.bits, seen.edges, seen.flags);
        if !is_same {
            *row = seen;
        }
        !is_same
    }

    /// The signals that are new since the state with this number, as JSON; `None` without any.
    pub(crate) fn changes(&self, signals: &[Signal], since: u64) -> Option<String> {
        let rows = signals.iter().zip(&self.rows).enumerate();
        let rows = rows.filter(|(_, (_, row))| row.number > since);
        let changes: Vec<ChangeJson> = rows
            .map(|(index, (signal, row))| row.json(index, signal))
            .collect();
        (!changes.is_empty()).then(|| serde_json::to_string(&changes).expect("texts and numbers"))
    }

    /// The line as JSON.
    pub(crate) fn line(&self) -> &str {
        &self.line
    }

    /// True if the line has to be made again.
    pub(crate) fn is_line_due(&self, now: Nanos) -> bool {
        now - self.line_at >= LINE
    }

    /// Stores the line that was made at `now`, in the state with this number.
    pub(crate) fn set_line(&mut self, now: Nanos, number: u64, line: String) {
        (self.line, self.line_at, self.line_number) = (line, now, number);
    }

    /// True if the line is newer than the state with this number.
    pub(crate) fn has_new_line(&self, since: u64) -> bool {
        self.line_number > since
    }

    /// Has the line made again at the next opportunity.
    pub(crate) fn forget_line(&mut self) {
        self.line_at = NEVER;
    }
}

/// A signal in full.
#[derive(Serialize)]
pub(crate) struct SignalJson<'a> {
    pub(crate) name: &'a str,
    /// Empty without an address.
    pub(crate) address: String,
    #[serde(rename = "type")]
    pub(crate) data_type: &'static str,
    pub(crate) unit: &'a str,
    #[serde(skip_serializing_if = "str::is_empty")]
    pub(crate) comment: &'a str,
    #[serde(skip_serializing_if = "str::is_empty")]
    pub(crate) folder: &'a str,
    pub(crate) station: usize,
    /// From the PLC's view, if there is one.
    pub(crate) direction: Option<&'static str>,
    pub(crate) latch: Option<&'static str>,
    /// The kind of the reply that makes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) reply: Option<&'static str>,
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
    /// True if it has a file for lists of signals.
    pub(crate) lists: bool,
    pub(crate) stations: Vec<&'a str>,
    pub(crate) signals: Vec<SignalJson<'a>>,
}
