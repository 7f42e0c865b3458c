//! A recording on the page: the signals of a file, after the fact. Nothing runs, and nothing can be forced.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_driver::FailSafeValues;
use tickbus_fieldbus::{Cause, Link, LinkState, Role};
use tickbus_image::signal::{Area, DataType, Latch, Signal, SignalTable, Slot};
use tickbus_record::{Column, Columns, History, Recording, Tick, ValueKind};
use tickbus_web::Refused;

use crate::archive::{Archive, Facts};
use crate::exhibit::Exhibit;
use crate::line::{Line, Station};
use crate::lists::Beside;
use crate::picture::Picture;
use crate::sheet::{DriverJson, STALE, Sheet, SignalJson};

/// A recording in memory, for a page.
#[derive(Debug)]
pub struct Recorded {
    pub(crate) archive: Arc<Archive>,
    title: String,
    role: String,
    stations: Vec<String>,
    /// The file, its time span and its end, in words.
    told: String,
    /// Why the rest of the file is left out, if it is damaged.
    broken: Option<String>,
    ticks: u64,
    picture: Option<Picture>,
    /// Signals of which the recording has edges, but no driver.cfg says of which kind.
    guessed_latches: BTreeSet<String>,
    lists: Option<Arc<Beside>>,
}

impl Recorded {
    /// Reads a recording that is called `file`, of which no tick was read, into at most `limit` bytes. The signals of
    /// `table` with the same names say what the file does not have. A signal of `faults` is on during a fault.
    ///
    /// # Errors
    ///
    /// The recording has no whole tick, lacks a signal of `faults`, or needs more memory.
    pub fn read(
        recording: &mut Recording,
        file: &str,
        table: Option<&SignalTable>,
        faults: &[String],
        limit: usize,
    ) -> Result<Self, Mistake> {
        // The page wants the signals before the edges.
        let given = recording.columns().clone();
        let mut order: Vec<usize> = (0..given.columns.len()).collect();
        order.sort_by_key(|place| given.columns[*place].is_edges);
        let columns = Columns {
            columns: order
                .iter()
                .map(|place| given.columns[*place].clone())
                .collect(),
            ..given.clone()
        };
        let mut guessed_latches = BTreeSet::new();
        let signals = signals(&columns, table, &mut guessed_latches);
        let faults = positions(&signals, faults)?;
        let role = columns.role.clone();
        let stations = if columns.stations.is_empty() {
            vec![String::new()]
        } else {
            columns.stations.clone()
        };
        let title = if columns.driver.is_empty() {
            file.to_owned()
        } else {
            columns.driver.clone()
        };
        let facts = Facts {
            table: SignalTable {
                signals,
                ..SignalTable::default()
            },
            reads: reads(&role),
            fail_safe: FailSafeValues::None,
            is_sampled: false,
            has_bits: false,
        };
        let archive = Archive::new(Arc::new(History::new(columns, limit)), facts);
        let (ticks, first, broken) = fill(&archive, recording, &order, &faults)?;
        let span = archive.history.span();
        let span = span.ok_or_else(|| {
            Mistake::new(
                "the recording has no whole tick",
                "record again, and let the simulation tick",
            )
        })?;
        if span.first.0 > first.0 {
            return Err(too_large(ticks, (span.first.0, span.last.0), limit));
        }
        let (from, to) = (first.1, span.last.1);
        let told = format!(
            "a recording, {file}: {ticks} ticks in {}, from {} to {}; {}",
            (to - from).rounded(),
            from.rounded(),
            to.rounded(),
            broken.clone().unwrap_or_else(|| recording.ending()),
        );
        let link = Link {
            state: LinkState::Running,
            cause: Cause::Running,
            reason: told.clone(),
            since: Nanos::ZERO,
        };
        archive.note_line(&link, to - from);
        Ok(Self {
            archive: Arc::new(archive),
            title,
            role,
            stations,
            told,
            broken,
            ticks,
            picture: None,
            guessed_latches,
            lists: None,
        })
    }

    /// The names of the signals.
    pub fn names(&self) -> Vec<&str> {
        let signals = self.archive.facts.table.signals.iter();
        signals.map(|signal| &*signal.name).collect()
    }

    /// The number of ticks.
    pub const fn ticks(&self) -> u64 {
        self.ticks
    }

    /// The first and the last time, and the memory in use, in bytes.
    pub fn span(&self) -> (Nanos, Nanos, usize) {
        let span = self.archive.history.span();
        span.map_or((Nanos::ZERO, Nanos::ZERO, 0), |span| {
            (span.first.1, span.last.1, span.bytes)
        })
    }

    /// Why the rest of the file is left out, if it is damaged.
    pub fn broken(&self) -> Option<&str> {
        self.broken.as_deref()
    }

    /// Shows this picture of the machine.
    pub fn set_picture(&mut self, picture: Picture) {
        self.picture = Some(picture);
    }

    /// Shows the lists of signals in this file, which need not exist.
    pub fn set_lists(&mut self, path: PathBuf) {
        let signals = self.archive.facts.table.signals.clone();
        self.lists = Some(Arc::new(Beside { path, signals }));
    }
}

/// The number of ticks, number and time of the first one, and why reading ended if the file is damaged.
type Filled = (u64, (u64, Nanos), Option<String>);

/// Reads all ticks.
fn fill(
    archive: &Archive,
    recording: &mut Recording,
    order: &[usize],
    faults: &[usize],
) -> Result<Filled, Mistake> {
    let mut read = Tick::new(recording.columns());
    let mut moved = read.clone();
    let is_in_order = order.is_sorted();
    let mut on = vec![false; faults.len()];
    let (mut ticks, mut first) = (0, (0, Nanos::ZERO));
    loop {
        match recording.next(&mut read) {
            Ok(true) => {}
            Ok(false) => return Ok((ticks, first, None)),
            Err(error) if ticks > 0 => {
                return Ok((ticks, first, Some(format!("the rest is left out: {error}"))));
            }
            Err(error) => {
                let line = error.line.map(|line| format!("line {line}: "));
                let what = format!("{}{}", line.unwrap_or_default(), error.mistake.what);
                return Err(Mistake::new(what, error.mistake.right));
            }
        }
        let tick = if is_in_order {
            &read
        } else {
            moved.clone_from(&read);
            for (value, place) in moved.values.iter_mut().zip(order) {
                *value = read.values[*place];
            }
            &moved
        };
        if ticks == 0 {
            first = (tick.number, tick.time);
        }
        ticks += 1;
        archive.history.push(tick);
        for (was, index) in on.iter_mut().zip(faults) {
            let signal = &archive.facts.table.signals[*index];
            let is = crate::value::Number::of(signal, tick.values[*index]).real();
            let is = is != 0.0 && !is.is_nan();
            if is != *was {
                archive.note_turn((tick.number, tick.time), &signal.name, is);
                *was = is;
            }
        }
    }
}

/// The recording does not fit into the memory; of its `ticks`, those between these numbers do.
fn too_large(ticks: u64, (from, to): (u64, u64), limit: usize) -> Mistake {
    let limit = u64::try_from(limit).unwrap_or(u64::MAX).max(1);
    let kept = (to.saturating_sub(from) + 1).min(ticks).max(1);
    // A tenth more, since the ticks before may have more changes.
    let needed = limit.saturating_mul(ticks).saturating_mul(11) / (kept * 10);
    let (limit, needed) = (limit >> 20, (needed >> 20) + 1);
    Mistake::new(
        format!(
            "the recording needs about {needed} MB of memory, and {limit} MB are allowed: the last {kept} of {ticks} \
             ticks fit"
        ),
        format!("allow more with --memory {needed}, or record a shorter time"),
    )
}

/// The role with this name.
fn role(name: &str) -> Option<Role> {
    let roles = [Role::Device, Role::Controller, Role::Observer];
    roles.into_iter().find(|role| role.name() == name)
}

/// The area that the recorded end reads; unknown in a CSV file.
fn reads(name: &str) -> Option<Area> {
    let role = role(name)?;
    // An observer reads both.
    (role != Role::Observer).then(|| role.areas().1)
}

/// The signals of a recording. The table adds what the file does not have, if its signal has the type of the file.
fn signals(
    columns: &Columns,
    table: Option<&SignalTable>,
    guessed_latches: &mut BTreeSet<String>,
) -> Vec<Signal> {
    let mut of = |column: &Column| {
        let station = |name: &String| columns.stations.iter().position(|known| known == name);
        let station = station(&column.station).unwrap_or(0);
        let known = table.and_then(|table| Some(&table.signals[table.position(&column.name)?]));
        let known = known.filter(|signal| {
            ValueKind::of(signal.data_type, signal.scale.is_some()) == column.kind
        });
        let mut signal = known.map_or_else(|| made(column), Signal::as_in_plc);
        signal.station = station;
        signal.unit = column.unit.clone().or(signal.unit);
        // The recording has edges, but not of which kind.
        if signal.latch.is_none() && columns.position(&column.name, true).is_some() {
            signal.latch = Some(Latch::Both);
            guessed_latches.insert(signal.name.clone());
        }
        signal
    };
    let all = columns.columns.iter().filter(|column| !column.is_edges);
    all.map(&mut of).collect()
}

/// A signal as the file describes it.
fn made(column: &Column) -> Signal {
    // Without its scale, the type of a scaled integer would have other values.
    let is_same = |data_type: &DataType| ValueKind::of(*data_type, false) == column.kind;
    let data_type = column
        .data_type
        .filter(is_same)
        .unwrap_or(column.kind.data_type());
    match column.address {
        Some(address) => Signal {
            bit: address.bit,
            ..Signal::new(&*column.name, address.area, address.byte, data_type)
        },
        // Without an address; this dummy is never shown.
        None => Signal::new(&*column.name, Area::Output, 0, data_type),
    }
}

/// The places of signals with these names.
fn positions(signals: &[Signal], names: &[String]) -> Result<Vec<usize>, Mistake> {
    let place = |name: &String| {
        let found = signals.iter().position(|signal| signal.name == *name);
        found.ok_or_else(|| {
            let all: Vec<&str> = signals.iter().map(|signal| &*signal.name).collect();
            Mistake::new(
                format!("--fault: the recording has no signal \"{}\"", shown(name)),
                tickbus_base::toml_text::did_you_mean(name, "signals", &all),
            )
        })
    };
    names.iter().map(place).collect()
}

/// A recording on the page. What is live of other exhibits is the last tick here.
#[derive(Debug)]
pub(crate) struct ShownRecording {
    id: i32,
    recorded: Recorded,
    sheet: Sheet,
    /// True until the page has looked.
    is_new: bool,
    statistics: Statistics,
}

impl ShownRecording {
    pub(crate) fn new(id: i32, recorded: Recorded, now: Nanos) -> Self {
        let rows = recorded.archive.last_rows();
        let values: Vec<Slot> = rows.iter().map(|row| row.slot).collect();
        let mut sheet = Sheet::new(&values);
        for (index, row) in rows.into_iter().enumerate() {
            sheet.put(index, row);
        }
        let mut statistics = Statistics::default();
        statistics.count("record.ticks", recorded.ticks);
        let mut exhibit = Self {
            id,
            recorded,
            sheet,
            is_new: true,
            statistics,
        };
        exhibit.sheet.set_line(now, 0, exhibit.line());
        exhibit
    }

    fn line(&self) -> String {
        let recorded = &self.recorded;
        let name = &recorded.title;
        let stations = recorded.stations.iter();
        Line {
            reason: &recorded.told,
            tick: recorded.ticks,
            stations: stations.map(|name| Station::new(name)).collect(),
            ..Line::new(self.id, name, LinkState::Running, Cause::Running, "fresh")
        }
        .text()
    }
}

impl Exhibit for ShownRecording {
    fn id(&self) -> i32 {
        self.id
    }

    fn name(&self) -> &str {
        &self.recorded.title
    }

    fn signals(&self) -> &[Signal] {
        &self.recorded.archive.facts.table.signals
    }

    fn sheet(&self) -> &Sheet {
        &self.sheet
    }

    fn sheet_mut(&mut self) -> &mut Sheet {
        &mut self.sheet
    }

    fn ask(&mut self, _now: Nanos) {}

    fn take(&mut self) -> bool {
        true
    }

    fn update(&mut self, now: Nanos, number: u64, _with_line: bool) -> bool {
        let is_new = std::mem::take(&mut self.is_new);
        if is_new {
            self.sheet.set_line(now, number, self.line());
        }
        is_new
    }

    fn json(&self) -> String {
        let columns = &self.recorded.archive.history.columns().columns;
        let rows = self.signals().iter().zip(&self.sheet.rows).zip(columns);
        let signals = rows.enumerate().map(|(index, ((signal, row), column))| {
            let has_place = column.address.is_some();
            SignalJson {
                name: &signal.name,
                address: if has_place {
                    signal.address().to_string()
                } else {
                    String::new()
                },
                data_type: signal.data_type.name(),
                unit: signal.unit.as_deref().unwrap_or_default(),
                comment: signal.comment(),
                folder: signal.folder(),
                station: signal.station,
                direction: has_place.then_some(match signal.area {
                    Area::Input => "I",
                    Area::Output => "Q",
                }),
                latch: signal.latch.map(|latch| match latch {
                    _ if self.recorded.guessed_latches.contains(&signal.name) => "recorded",
                    Latch::Rising => "rising",
                    Latch::Falling => "falling",
                    Latch::Both => "both",
                }),
                reply: None,
                writable: false,
                value: row.value(signal),
                raw: String::new(),
                edges: self.recorded.archive.has_edges(index).then_some(row.edges),
                age_ms: None,
                failsafe: false,
                stale: row.flags & STALE != 0,
                forced: None,
            }
        });
        let recording = DriverJson {
            id: self.id,
            name: &self.recorded.title,
            kind: "recording",
            role: role(&self.recorded.role).map_or("of an unknown end", Role::name),
            picture: self.recorded.picture.is_some(),
            lists: self.recorded.lists.is_some(),
            stations: self.recorded.stations.iter().map(|name| &**name).collect(),
            signals: signals.collect(),
        };
        serde_json::to_string(&recording).expect("texts and numbers")
    }

    fn archive(&self) -> Option<Arc<Archive>> {
        Some(Arc::clone(&self.recorded.archive))
    }

    fn state(&self) -> LinkState {
        LinkState::Running
    }

    fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    fn lists(&self) -> Option<Arc<Beside>> {
        self.recorded.lists.clone()
    }

    fn picture(&self) -> Option<&Picture> {
        self.recorded.picture.as_ref()
    }

    fn force(&mut self, values: &[(String, String)]) -> Result<(), Refused> {
        let name = values.first().map_or("", |(name, _)| name);
        Err(Refused {
            status: 409,
            text: format!(
                "\"{}\" is not forced: this page shows a recording; force it on the page of a running simulation",
                shown(name)
            ),
        })
    }

    fn release(&mut self, _signals: &[String]) -> Result<(), Refused> {
        // No signal is forced.
        Ok(())
    }
}
