//! A run on virtual time on the page: its variables, clients and speed.

use std::sync::Arc;

use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_driver::FailSafeValues;
use tickbus_fieldbus::{Cause, LinkState};
use tickbus_image::signal::{Area, Signal, SignalTable, Slot};
use tickbus_record::{Column, Columns, History, Tick, ValueKind};
use tickbus_virtual_time::{Controls, Members, Pacing, RunView, State, Step, slot_of};
use tickbus_web::Refused;

use crate::archive::{Archive, Facts};
use crate::exhibit::{Exhibit, Freshness};
use crate::line::{self, Line, Station};
use crate::sheet::{DriverJson, Row, STALE, Sheet, SignalJson, UNKNOWN};

/// A step is shown as late if it takes longer than this, and longer than a tenth of its limit.
const LATE: Nanos = Nanos::from_secs(1);

/// The memory for the steps that were seen, in bytes.
const HISTORY: usize = 64 << 20;

/// The shortest interval for measuring the speed of a run.
const SHORTEST: Nanos = Nanos::from_millis(250);

/// The station of the variables of the server's logic, in place of a client's name.
const LOGIC: &str = "logic of the server";

/// A run on the page.
#[derive(Debug)]
pub(crate) struct ShownRun {
    id: i32,
    name: String,
    controls: Controls,
    /// The newest copy; `None` before the first.
    view: Option<RunView>,
    /// The participants as shown.
    members: Arc<Members>,
    is_other: bool,
    /// The variables as signals; the stations are the clients.
    signals: Vec<Signal>,
    sheet: Sheet,
    /// The steps that the page has seen.
    archive: Option<Arc<Archive>>,
    /// The number of the last one.
    seen: u64,
    state: Told,
    since: Nanos,
    pace: Pace,
    statistics: Statistics,
}

/// The state of the run, in the terms of a line.
#[derive(Clone, Debug, PartialEq)]
struct Told {
    state: LinkState,
    cause: Cause,
    reason: String,
    /// True if the server does not respond.
    is_hung: bool,
}

/// The speed of the run between the last two lines.
#[derive(Clone, Copy, Debug)]
struct Pace {
    at: Nanos,
    /// The last step at that time.
    step: Option<Step>,
    steps_per_second: f64,
    /// Virtual time per wall-clock time.
    speed: f64,
}

impl Pace {
    /// Measures up to this step, unless the last measurement was a moment ago.
    fn go_on(&mut self, now: Nanos, step: Option<Step>) {
        if self.step.is_some() && now - self.at < SHORTEST {
            return;
        }
        let seconds = |span: Nanos| span.as_micros() / 1e6;
        let passed = seconds(now - self.at);
        (self.steps_per_second, self.speed) = match (self.step, step) {
            (Some(before), Some(step)) if passed > 0.0 => {
                #[expect(clippy::cast_precision_loss, reason = "steps of half a second")]
                let steps = step.sequence.saturating_sub(before.sequence) as f64;
                (steps / passed, seconds(step.time - before.time) / passed)
            }
            _ => (0.0, 0.0),
        };
        (self.at, self.step) = (now, step);
    }
}

impl ShownRun {
    pub(crate) fn new(id: i32, name: &str, controls: Controls, now: Nanos) -> Self {
        let mut run = Self {
            id,
            name: name.to_owned(),
            controls,
            view: None,
            members: Arc::new(Members {
                clients: Vec::new(),
                variables: Vec::new(),
            }),
            is_other: false,
            signals: Vec::new(),
            sheet: Sheet::new(&[]),
            archive: None,
            seen: 0,
            state: told(None),
            since: now,
            pace: Pace {
                at: now,
                step: None,
                steps_per_second: 0.0,
                speed: 0.0,
            },
            statistics: Statistics::default(),
        };
        run.update_line(now, 0, true);
        run
    }

    /// Restarts if the participants have changed.
    fn take_members(&mut self) {
        self.is_other = false;
        let Some(view) = &self.view else {
            return;
        };
        if Arc::ptr_eq(&view.members, &self.members) {
            return;
        }
        self.is_other = view.members != self.members;
        self.members = Arc::clone(&view.members);
        if !self.is_other {
            return;
        }
        let variables = self.members.variables.iter().enumerate();
        let signals = variables.map(|(at, variable)| {
            // The variable has no address; this dummy is never shown.
            let signal = Signal::new(&*variable.name, Area::Output, 0, variable.data_type);
            Signal {
                station: self.members.writer(at),
                ..signal
            }
        });
        self.signals = signals.collect();
        let values = self.signals.iter().zip(&view.values);
        let values: Vec<Slot> = values
            .map(|(signal, value)| slot_of(signal.data_type, *value))
            .collect();
        self.sheet = Sheet::new(&values);
        (self.archive, self.seen) = (Some(Arc::new(self.new_archive())), 0);
    }

    /// An empty archive of the present variables.
    fn new_archive(&self) -> Archive {
        let columns = self.signals.iter().map(|signal| {
            let writer = self.members.clients.get(signal.station);
            let station = writer.map_or_else(String::new, |client| client.name.clone());
            Column::plain(signal.name.clone(), signal.data_type, station)
        });
        let columns = Columns {
            driver: self.name.clone(),
            role: "sync".to_owned(),
            stations: Vec::new(),
            columns: columns.collect(),
        };
        let facts = Facts {
            table: SignalTable {
                signals: self.signals.clone(),
                ..SignalTable::default()
            },
            reads: None,
            fail_safe: FailSafeValues::None,
            is_sampled: true,
            has_bits: false,
        };
        Archive::new(Arc::new(History::new(columns, HISTORY)), facts)
    }

    /// Adds the step that the page has seen to the archive.
    fn remember(&mut self) {
        let (Some(view), Some(archive)) = (&self.view, &self.archive) else {
            return;
        };
        let Some(step) = view.step.filter(|_| has_begun(view)) else {
            return;
        };
        if step.sequence < self.seen {
            return;
        }
        self.seen = step.sequence + 1;
        let values = self.signals.iter().zip(&view.values);
        let values = values.map(|(signal, value)| {
            let kind = ValueKind::of(signal.data_type, false);
            kind.kept(slot_of(signal.data_type, *value))
        });
        archive.history.push(&Tick {
            number: step.sequence + 1,
            time: step.time,
            values: values.collect(),
            ..Tick::default()
        });
    }

    fn take_values(&mut self, now: Nanos, number: u64) -> bool {
        let Some(view) = &self.view else {
            return false;
        };
        let is_hung = self.sheet.missing_for(now) > LATE;
        let mut is_new = false;
        let values = self.signals.iter().zip(&view.values).enumerate();
        for (index, (signal, value)) in values {
            let flags = if !has_begun(view) {
                STALE | UNKNOWN
            } else if is_hung || is_late(view) && owes(view, signal.station) {
                STALE
            } else {
                0
            };
            let seen = Row {
                slot: slot_of(signal.data_type, *value),
                bits: value & (u64::MAX >> (64 - signal.data_type.width().bits())),
                edges: 0,
                flags,
                number,
            };
            is_new |= self.sheet.put(index, seen);
        }
        is_new
    }

    fn update_line(&mut self, now: Nanos, number: u64, with_line: bool) -> bool {
        let silent = self.sheet.missing_for(now);
        let state = if silent > LATE {
            hung(silent)
        } else {
            told(self.view.as_ref())
        };
        let is_other =
            (state.state, &state.cause) != (self.state.state, &self.state.cause) || self.is_other;
        let is_due = with_line && self.sheet.is_line_due(now);
        if !is_other && !is_due {
            return false;
        }
        if state.state != self.state.state {
            self.since = now;
        }
        self.state = state;
        self.count();
        let line = self.line_json(now);
        self.sheet.set_line(now, number, line);
        true
    }

    fn count(&mut self) {
        let mut statistics = Statistics::default();
        let view = self.view.as_ref();
        let step = view.and_then(|view| view.step);
        statistics.count("run.steps", step.map_or(0, |step| step.sequence));
        let count = |all: usize| u64::try_from(all).unwrap_or(u64::MAX);
        statistics.count("run.clients", count(self.members.clients.len()));
        statistics.count("run.variables", count(self.members.variables.len()));
        statistics.number("run.steps_per_s", self.pace.steps_per_second, 1);
        statistics.number("run.speed", self.pace.speed, 4);
        if let Some(step) = step {
            statistics.number("run.virtual_s", step.time.as_micros() / 1e6, 6);
        }
        self.statistics = statistics;
    }

    fn line_json(&self, now: Nanos) -> String {
        let step = self.view.as_ref().and_then(|view| view.step);
        let status = match self.state.cause {
            Cause::Silent => "stale",
            Cause::Running if self.pace.steps_per_second > 0.0 => "fresh",
            _ => "unchanged",
        };
        let mut line = Line {
            reason: &self.state.reason,
            since_ms: (now - self.since).0.max(0) / 1_000_000,
            facts: vec![("Clients", self.members.clients.len().to_string())],
            stations: self.clients(),
            ..Line::new(
                self.id,
                &self.name,
                self.state.state,
                self.state.cause,
                status,
            )
        };
        if let (Some(view), Some(step)) = (&self.view, step) {
            let Pace {
                steps_per_second,
                speed,
                ..
            } = self.pace;
            line.facts.extend([
                (
                    "Virtual time",
                    format!("{:.3} s", step.time.max(Nanos::ZERO).as_micros() / 1e6),
                ),
                ("Steps", step.sequence.to_string()),
                ("Steps in 1 s", format!("{steps_per_second:.0}")),
                ("Speed", format!("{speed:.3} × real time")),
                ("One step", view.length.to_string()),
            ]);
        }
        line::sort(&self.statistics, &mut line);
        line.text()
    }

    fn clients(&self) -> Vec<Station<'_>> {
        let clients = self.members.clients.iter().enumerate();
        let stations = clients.map(|(at, client)| {
            let view = self.view.as_ref();
            let late = view.filter(|view| owes(view, at) && is_late(view));
            let every = (client.interval, client.multiple.get());
            let state = match (view.map(|view| view.state), every) {
                (None | Some(State::Start), _) => "joined".to_owned(),
                _ if late.is_some() => "late".to_owned(),
                (_, (Some(interval), _)) => format!("every {interval}"),
                (_, (None, 1)) => "in every step".to_owned(),
                (_, (None, multiple)) => format!("in every step of {multiple}"),
            };
            Station {
                stale: late.is_some(),
                reason: late.map_or_else(String::new, owing),
                state,
                ..Station::new(&client.name)
            }
        });
        stations
            .chain(self.has_logic().then(|| Station::new(LOGIC)))
            .collect()
    }

    /// True if there are variables of the server's logic.
    fn has_logic(&self) -> bool {
        let last = self.signals.last();
        last.is_some_and(|signal| signal.station == self.members.clients.len())
    }
}

/// True if all initial values are present.
fn has_begun(view: &RunView) -> bool {
    view.step.is_some() && !matches!(view.state, State::Start | State::InitialWrite)
}

/// True if a client has not answered yet; the logic of the server always has.
fn owes(view: &RunView, client: usize) -> bool {
    view.owes.get(client) == Some(&true)
}

/// True if answers are late.
fn is_late(view: &RunView) -> bool {
    view.waited > LATE.max(Nanos(view.hang.0 / 10))
}

/// The late answers, in words.
fn owing(view: &RunView) -> String {
    let (waited, hang) = (view.waited.rounded(), view.hang);
    let what = match view.step {
        Some(step) if step.sequence > 0 => format!("has not finished step {}", step.sequence),
        _ => "has not sent its initial values".to_owned(),
    };
    format!("{what} for {waited}; the run ends after {hang}")
}

/// The state of a run whose server has stopped responding.
fn hung(silent: Nanos) -> Told {
    Told {
        state: LinkState::Stale,
        cause: Cause::Silent,
        reason: format!(
            "the server has shown nothing for {}; it waits for the reader of its output, or hangs",
            silent.rounded()
        ),
        is_hung: true,
    }
}

/// The state of a run; there may be no copy yet.
fn told(view: Option<&RunView>) -> Told {
    let told = |state, cause, reason| Told {
        state,
        cause,
        reason,
        is_hung: false,
    };
    let Some(view) = view else {
        let reason = "the server begins".to_owned();
        return told(LinkState::Opening, Cause::Waiting, reason);
    };
    if let Some(missing) = &view.missing {
        let reason = format!("waiting for {missing}");
        return told(LinkState::Opening, Cause::Waiting, reason);
    }
    if is_late(view) {
        let clients = view.members.clients.iter().zip(&view.owes);
        let late = clients.filter(|(_, owes)| **owes);
        let late: Vec<String> = late
            .map(|(client, _)| format!("\"{}\"", client.name))
            .collect();
        let reason = format!("{} {}", late.join(", "), owing(view));
        return told(LinkState::Stale, Cause::Silent, reason);
    }
    let step = view.step.map_or(0, |step| step.sequence);
    if view.is_paused {
        let reason = format!("paused after step {step}; the commands step and run go on");
        return told(LinkState::Running, Cause::Stopped, reason);
    }
    let reason = match view.pacing {
        Pacing::Fast => "the clients run as fast as they can".to_owned(),
        Pacing::Times(1.0) => "the clients run in real time".to_owned(),
        Pacing::Times(factor) => format!("the clients run at most {factor} times as fast as time"),
    };
    told(LinkState::Running, Cause::Running, reason)
}

impl Exhibit for ShownRun {
    fn id(&self) -> i32 {
        self.id
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn signals(&self) -> &[Signal] {
        &self.signals
    }

    fn sheet(&self) -> &Sheet {
        &self.sheet
    }

    fn sheet_mut(&mut self) -> &mut Sheet {
        &mut self.sheet
    }

    fn ask(&mut self, _now: Nanos) {
        self.controls.ask_view();
    }

    fn take(&mut self) -> bool {
        let view = self.controls.take_view();
        let has_come = view.is_some();
        self.view = view.or(self.view.take());
        has_come
    }

    fn update(&mut self, now: Nanos, number: u64, with_line: bool) -> bool {
        self.take_members();
        let step = self.view.as_ref().and_then(|view| view.step);
        self.pace.go_on(now, step);
        let is_new = self.take_values(now, number);
        self.remember();
        self.update_line(now, number, with_line) || is_new
    }

    fn is_other(&self) -> bool {
        self.is_other
    }

    fn json(&self) -> String {
        let clients = self.members.clients.iter();
        let stations = clients.map(|client| &*client.name);
        let rows = self.signals.iter().zip(&self.sheet.rows);
        let signals = rows.map(|(signal, row)| SignalJson {
            name: &signal.name,
            address: String::new(),
            data_type: signal.data_type.name(),
            unit: "",
            comment: "",
            folder: "",
            station: signal.station,
            direction: None,
            latch: None,
            reply: None,
            writable: false,
            value: row.value(signal),
            raw: row.raw(signal),
            edges: None,
            age_ms: None,
            failsafe: false,
            stale: row.flags & STALE != 0,
            forced: None,
        });
        let run = DriverJson {
            id: self.id,
            name: &self.name,
            kind: "sync",
            role: "server",
            picture: false,
            lists: false,
            stations: stations.chain(self.has_logic().then_some(LOGIC)).collect(),
            signals: signals.collect(),
        };
        serde_json::to_string(&run).expect("texts and numbers")
    }

    fn stations(&self) -> Vec<Freshness<'_>> {
        let is_hung = self.state.is_hung;
        let clients = self.members.clients.iter().enumerate();
        let freshness = clients.map(|(at, client)| {
            let view = self.view.as_ref();
            let is_late = view.is_some_and(|view| is_late(view) && owes(view, at));
            Freshness {
                name: &client.name,
                // The age of data in virtual time is that of the step.
                age_ms: None,
                stale: is_late || is_hung || view.is_none_or(|view| !has_begun(view)),
            }
        });
        freshness.collect()
    }

    fn archive(&self) -> Option<Arc<Archive>> {
        self.archive.clone()
    }

    fn state(&self) -> LinkState {
        self.state.state
    }

    fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    fn force(&mut self, values: &[(String, String)]) -> Result<(), Refused> {
        let name = values.first().map_or("", |(name, _)| name);
        Err(Refused {
            status: 409,
            text: format!(
                "\"{}\" is not forced: the run \"{}\" would be another one; have a client write it",
                tickbus_base::toml_text::shown(name),
                self.name
            ),
        })
    }

    fn release(&mut self, _signals: &[String]) -> Result<(), Refused> {
        // No signal is forced.
        Ok(())
    }
}

#[cfg(test)]
mod tests;
