//! The past of one exhibit: its history, the faults and the states of its line, as JSON.

use std::collections::{BTreeMap, VecDeque};
use std::fmt::Write as _;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::json;
use tickbus_base::time::Nanos;
use tickbus_driver::{FailSafeValues, Force};
use tickbus_fieldbus::faults::{FaultStatus, Lasts, Phase};
use tickbus_fieldbus::{Link, LinkState};
use tickbus_image::signal::{Area, Signal, SignalTable};
use tickbus_record::{History, Moment, Span, Tick};

use crate::codec::Codec;
use crate::sheet::{ChangeJson, FAIL_SAFE, FORCED, Row, STALE};

mod forces;
mod jump;
mod marks;
mod moments;
mod when;

/// The most faults and states of the line that are remembered.
const MOST: usize = 10_000;

/// The most turns of the faults of a recording that are remembered.
const MOST_TURNS: usize = 100_000;

/// The beginning of the name of the fault that forces a signal.
const FORCE: &str = "forced: ";

/// The facts that the values of a history need to be shown.
#[derive(Debug)]
pub(crate) struct Facts {
    pub(crate) table: SignalTable,
    /// The area that this end reads, whose values can be stale; without one, every value can be.
    pub(crate) reads: Option<Area>,
    /// Which stale values are fail-safe values.
    pub(crate) fail_safe: FailSafeValues,
    /// Some samples, and not every tick.
    pub(crate) is_sampled: bool,
    /// True if values have raw bits.
    pub(crate) has_bits: bool,
}

/// The past of an exhibit; the page's thread writes it, and the thread for the past reads it.
#[derive(Debug)]
pub(crate) struct Archive {
    pub(crate) history: Arc<History>,
    pub(crate) facts: Facts,
    /// Per signal, the column of its edges.
    edges: Vec<Option<usize>>,
    codec: Mutex<Codec>,
    notes: Mutex<Notes>,
}

#[derive(Debug, Default)]
struct Notes {
    marks: VecDeque<Mark>,
    seen: Vec<Seen>,
    /// By the numbers of the faults.
    forces: BTreeMap<u32, Force>,
    lines: VecDeque<LineNote>,
    /// The forces of all ticks up to this one are known; `None` if there are no forces.
    known: Option<u64>,
}

/// A fault as last seen.
#[derive(Clone, Copy, Debug)]
struct Seen {
    id: u32,
    phase: Phase,
    begun: u64,
    /// The number of ticks in the history from before the reset that preceded the fault.
    before: u64,
}

/// A fault has begun or ended.
#[derive(Clone, Debug)]
struct Mark {
    /// The number of the tick in the history.
    tick: u64,
    /// The time of the tick; `None` until the history has the tick, and if that had left the memory by then.
    at: Option<Nanos>,
    force: Option<Force>,
    name: String,
    text: String,
    begins: bool,
}

/// The line has entered a state.
#[derive(Clone, Debug)]
struct LineNote {
    at: Nanos,
    state: LinkState,
    cause: &'static str,
    reason: String,
}

/// Time as the page has it, in milliseconds.
#[expect(clippy::cast_precision_loss, reason = "exact for a hundred days")]
pub(crate) fn millis(time: Nanos) -> f64 {
    time.0 as f64 / 1e6
}

/// The time that a text in milliseconds says.
pub(crate) fn time(text: &str) -> Option<Nanos> {
    let millis: f64 = text
        .parse()
        .ok()
        .filter(|millis: &f64| millis.is_finite())?;
    #[expect(clippy::cast_possible_truncation, reason = "a cast saturates")]
    let nanos = (millis * 1e6).round() as i64;
    Some(Nanos(nanos))
}

impl Archive {
    pub(crate) fn new(history: Arc<History>, facts: Facts) -> Self {
        let signals = facts.table.signals.iter();
        let columns = history.columns();
        let edges = signals.map(|signal| columns.position(&signal.name, true));
        Self {
            edges: edges.collect(),
            codec: Mutex::new(Codec::new(&facts.table)),
            facts,
            history,
            notes: Mutex::default(),
        }
    }

    /// The number of the last tick.
    pub(crate) fn last(&self) -> u64 {
        self.history.span().map_or(0, |span| span.last.0)
    }

    fn notes(&self) -> MutexGuard<'_, Notes> {
        // Each list is consistent after every single change.
        self.notes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes that the fault with this number forces a signal. The history has what the simulation itself
    /// wrote meanwhile, and the PLC got this.
    pub(crate) fn note_force(&self, fault: u32, force: Force) {
        self.notes().forces.insert(fault, force);
    }

    /// Notes the faults that have begun or ended, as known after the history had the tick `known`. Their ticks count
    /// from the last reset, and the history has `before` ticks from before it.
    pub(crate) fn note_faults(&self, faults: &[FaultStatus], before: u64, known: u64) {
        let last = self.last();
        // Looked for without the lock, since that decodes a part of the history.
        let pulses: Vec<Option<u64>> = faults
            .iter()
            .map(|fault| self.pulse_begin(fault, before))
            .collect();
        let mut notes = self.notes();
        let Notes {
            marks,
            seen,
            forces,
            ..
        } = &mut *notes;
        for (fault, pulse) in faults.iter().zip(pulses) {
            let mut now = Seen {
                id: fault.id,
                phase: fault.phase,
                begun: fault.begun,
                before,
            };
            let place = seen.iter().position(|known| known.id == fault.id);
            let known = place.map(|place| seen[place]);
            // Its ticks count from the reset before its first beginning.
            if let Some(known) = known.filter(|known| known.begun > 0) {
                now.before = known.before;
            }
            match place {
                Some(place) => seen[place] = now,
                None => seen.push(now),
            }
            let begun = known.map_or(0, |known| known.begun);
            let is_active = fault.phase == Phase::Active;
            let has_begun = fault.begun != begun;
            let has_turned = known.is_some_and(|known| known.phase != fault.phase);
            if fault.begun == 0 || !(has_begun || has_turned) {
                continue;
            }
            let tick = match fault.tick {
                // A reset has ended it; there may be no tick since then.
                0 if before > now.before => before + 1,
                0 => last + 1,
                tick => now.before + tick,
            };
            let mark = Mark {
                tick,
                at: None,
                force: forces.get(&fault.id).copied(),
                name: fault.name.clone(),
                text: match fault.name.strip_prefix(FORCE) {
                    Some(_) => fault.what.clone(),
                    None if fault.name.is_empty() => format!("{}: {}", fault.kind, fault.what),
                    None => format!("{}: {}", fault.name, fault.what),
                },
                begins: is_active,
            };
            // A fault that is over already began as well; when is known only of one that forces a signal for a given
            // time or number of ticks.
            let lasts = mark.force.map(|force| force.lasts);
            let begin = (has_begun && !is_active).then(|| Mark {
                begins: true,
                tick: match lasts {
                    Some(Lasts::Ticks(ticks)) => tick.saturating_sub(ticks),
                    Some(Lasts::For(_)) => pulse.map_or(tick, |begin| begin.min(tick)),
                    _ => tick,
                },
                ..mark.clone()
            });
            for mark in begin.into_iter().chain([mark]) {
                marks::keep(marks, mark, MOST);
            }
        }
        // A fault that has left the list has ended.
        let is_listed = |id: u32| faults.iter().any(|fault| fault.id == id);
        let newest = faults.iter().map(|fault| fault.id).max().unwrap_or(0);
        seen.retain(|known| is_listed(known.id));
        forces.retain(|id, _| *id > newest || is_listed(*id));
        notes.known = Some(known);
        drop(notes);
        self.time_marks();
    }

    /// The tick of the history in which a force that is over and lasted for a given time began.
    fn pulse_begin(&self, fault: &FaultStatus, before: u64) -> Option<u64> {
        if fault.phase == Phase::Active || fault.tick == 0 {
            return None;
        }
        let (lasts, before) = {
            let notes = self.notes();
            let known = notes.seen.iter().find(|known| known.id == fault.id);
            let known = known.filter(|known| known.begun > 0);
            // Most faults that are over were noted long ago.
            if known.is_some_and(|known| known.begun == fault.begun) {
                return None;
            }
            let force = notes.forces.get(&fault.id)?;
            (force.lasts, known.map_or(before, |known| known.before))
        };
        let Lasts::For(time) = lasts else {
            return None;
        };
        let number = before + fault.tick;
        let end = self.history.at(Moment::Tick(number))?;
        // A tick that the history does not have yet or any more is not the end.
        if end.number != number {
            return None;
        }
        self.history
            .at(Moment::Time(end.time - time))
            .map(|begin| begin.number)
    }

    /// Notes that a recorded signal which tells of a fault has gone on, or off, at a tick.
    pub(crate) fn note_turn(&self, (tick, at): (u64, Nanos), name: &str, begins: bool) {
        let mark = Mark {
            tick,
            at: Some(at),
            force: None,
            name: name.to_owned(),
            text: name.to_owned(),
            begins,
        };
        marks::keep(&mut self.notes().marks, mark, MOST_TURNS);
    }

    /// The rows of the last tick.
    pub(crate) fn last_rows(&self) -> Vec<Row> {
        let tick = self.history.at(Moment::Tick(u64::MAX));
        tick.map_or_else(Vec::new, |tick| self.rows(&tick, &[]))
    }

    /// Notes the state of the line; `now` is the time on the clock of the line.
    pub(crate) fn note_line(&self, link: &Link, now: Nanos) {
        let Some(span) = self.history.span() else {
            return;
        };
        let mut notes = self.notes();
        let lines = &mut notes.lines;
        let cause = link.cause.name();
        let is_same = lines.back().is_some_and(|last| {
            (last.state, last.cause, &*last.reason) == (link.state, cause, &*link.reason)
        });
        if is_same {
            return;
        }
        let least = lines.back().map_or(Nanos(i64::MIN), |last| last.at);
        let line = LineNote {
            at: (span.last.1 - (now - link.since).max(Nanos::ZERO)).max(least),
            state: link.state,
            cause,
            reason: link.reason.clone(),
        };
        if lines.len() == MOST {
            lines.pop_front();
        }
        lines.push_back(line);
    }

    /// How far it reaches, for every event.
    pub(crate) fn reach(&self) -> Option<String> {
        let Span {
            first,
            last,
            is_cut,
            ..
        } = self.history.span()?;
        let (from, to) = (millis(first.1), millis(last.1));
        Some(format!("[{from},{to},{},{is_cut}]", last.0))
    }

    /// All that the bar of time shows.
    pub(crate) fn overview(&self) -> String {
        let span = self.history.span();
        let outages = self.history.outages();
        let outages: Vec<_> = outages
            .iter()
            .map(|(begin, end)| (millis(*begin), end.map(millis)))
            .collect();
        let marks = self.marks_of(span);
        let marks: Vec<_> = marks
            .iter()
            .filter_map(|mark| {
                Some(json!({
                    "ms": millis(mark.at?), "tick": mark.tick, "text": mark.text, "begins": mark.begins,
                }))
            })
            .collect();
        json!({
            "from_ms": span.map(|span| millis(span.first.1)),
            "to_ms": span.map(|span| millis(span.last.1)),
            "from_tick": span.map(|span| span.first.0),
            "to_tick": span.map(|span| span.last.0),
            "is_cut": span.is_some_and(|span| span.is_cut),
            "bytes": span.map_or(0, |span| span.bytes),
            "limit": self.history.limit(),
            "is_sampled": self.facts.is_sampled,
            "outages": outages,
            "marks": marks,
        })
        .to_string()
    }

    /// True for a signal that this end writes.
    fn is_written(&self, signal: usize) -> bool {
        let area = self.facts.table.signals[signal].area;
        self.facts.reads.is_some_and(|reads| reads != area)
    }

    /// True if the history has the edges of a signal: those of latched signals that this end reads.
    pub(crate) fn has_edges(&self, signal: usize) -> bool {
        self.edges[signal].is_some()
    }

    /// The column of a signal in the history, and the station whose stale data have no value.
    pub(crate) fn column(&self, signal: usize) -> (usize, Option<usize>) {
        let Signal { area, station, .. } = self.facts.table.signals[signal];
        let can_be_stale = self.facts.reads.is_none_or(|reads| reads == area);
        (signal, can_be_stale.then_some(station))
    }

    /// The rows of a tick.
    fn rows(&self, tick: &Tick, faults: &[Mark]) -> Vec<Row> {
        let table = &self.facts.table;
        // The tables are consistent after a panic as well: every tick fills them again.
        let mut codec = self.codec.lock().unwrap_or_else(PoisonError::into_inner);
        let mut values = tick.values.clone();
        for mark in faults {
            if let Some(force) = mark.force.filter(|force| self.is_written(force.signal)) {
                let passed = tick.time - mark.since();
                if let Some(value) = self.forced(force, passed) {
                    values[force.signal] = value;
                }
            }
        }
        if self.facts.has_bits {
            codec.take(table, &values);
        }
        let rows = table.signals.iter().enumerate().map(|(index, signal)| {
            let status = tick.stations.get(signal.station).unwrap_or(&tick.status);
            let can_be_stale = self.facts.reads.is_none_or(|reads| reads == signal.area);
            let is_forced = faults
                .iter()
                .any(|mark| mark.name.strip_prefix(FORCE) == Some(&signal.name));
            let flags = if is_forced {
                FORCED
            } else if can_be_stale && !(0..2).contains(status) {
                if self.facts.fail_safe.has(signal) {
                    STALE | FAIL_SAFE
                } else {
                    STALE
                }
            } else {
                0
            };
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a whole number, which wraps as the driver's counter does"
            )]
            let edges =
                self.edges[index].map_or(0, |column| tick.values[column].real() as u64 as u32);
            Row {
                slot: values[index],
                bits: if self.facts.has_bits {
                    codec.bits(signal, index)
                } else {
                    0
                },
                edges,
                flags,
                number: 0,
            }
        });
        rows.collect()
    }

    /// The state at a moment: of all signals, or of those that differ from the state at the tick `since`.
    pub(crate) fn state(&self, moment: Moment, since: Option<u64>) -> Option<String> {
        let tick = self.history.at(moment)?;
        let faults = self.faults_at(tick.number);
        let rows = self.rows(&tick, &faults);
        let before = since.and_then(|since| {
            let before = self.history.at(Moment::Tick(since))?;
            // It may have been dropped meanwhile.
            (before.number == since).then(|| self.rows(&before, &self.faults_at(since)))
        });
        let signals = &self.facts.table.signals;
        let changes = rows.iter().enumerate().filter(|(index, row)| {
            before.as_ref().is_none_or(|before| {
                let before = &before[*index];
                (before.slot, before.edges, before.flags) != (row.slot, row.edges, row.flags)
            })
        });
        let changes: Vec<ChangeJson> = changes
            .map(|(index, row)| {
                let mut change = row.json(index, &signals[index]);
                if !self.facts.has_bits {
                    change.raw = None;
                }
                if !self.has_edges(index) {
                    change.edges = None;
                }
                change
            })
            .collect();
        let line = self.line_at((tick.number, tick.time));
        let texts: Vec<_> = faults.iter().map(|mark| &mark.text).collect();
        let head = json!({
            "tick": tick.number, "ms": millis(tick.time), "status": tick.status, "stations": tick.stations,
            "dropped": tick.dropped, "full": before.is_none(), "line": line, "faults": texts,
        });
        let mut text = head.to_string();
        text.pop();
        let values = serde_json::to_string(&changes).expect("texts and numbers");
        // Writing to a String cannot fail.
        let _ = write!(text, ",\"values\":{values}}}");
        Some(text)
    }
}

#[cfg(test)]
mod tests;
