//! A recording as the other end of the line: the values that the recorded peer sent drive this end, and the values that
//! this end sends are compared with those in the recording.
//!
//! The tick shows the recorded values, counts and statuses as they are. No sequence of frames could lead to all of
//! them: a recording does not contain frames that arrived while data were not valid. The replay also delivers frames,
//! which keep the line alive, cause events, and provide the values while faults of the line are injected.

mod differences;
mod station;
#[cfg(all(test, not(loom)))]
mod tests;

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use self::differences::Differences;
use self::station::Station;
use super::statistics::Counters;
use super::{Code, DriverError};
use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::did_you_mean;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::{BusError, Port, Stepped};
use tickbus_image::TickEnd;
use tickbus_image::signal::{Signal, Slot};
use tickbus_record::{Columns, FileClaim, Recording, RecordingError, Tape, ValueKind};

/// The most missing signals that an error message names.
const NAMED: usize = 5;

/// The results of a replay so far; readable from any thread.
#[derive(Debug, Default)]
pub(super) struct ReplayCounters {
    file: String,
    /// Recorded ticks that were replayed.
    ticks: AtomicU64,
    /// Recorded ticks that were compared: all of them, unless several fell into one tick of this run.
    compared: AtomicU64,
    differences: AtomicU64,
    /// Signals of this end that the recording does not contain.
    unknown: u64,
    ended: AtomicBool,
}

impl Counters for ReplayCounters {
    fn write(&self, statistics: &mut Statistics) {
        let count = |count: &AtomicU64| count.load(Ordering::Relaxed);
        statistics.text("replay.file", &self.file);
        statistics.count("replay.ticks", count(&self.ticks));
        statistics.count("replay.compared", count(&self.compared));
        statistics.count("replay.differences", count(&self.differences));
        statistics.count("replay.not_compared_signals", self.unknown);
        let ended = self.ended.load(Ordering::Relaxed);
        statistics.count("replay.ended", ended.into());
    }
}

/// Maps columns of the recording to signals.
struct Map {
    /// The column of each signal of this driver.
    signals: Vec<Option<usize>>,
    edges: Vec<Option<usize>>,
    /// The column of each station of this driver, if the recording has several.
    stations: Vec<Option<usize>>,
}

/// A recording as the other end of a stepped bus.
pub(super) struct Replay {
    tape: Tape,
    map: Map,
    stations: Vec<Station>,
    /// This driver's slots with the recorded values.
    slots: Vec<Slot>,
    /// True if a recorded tick fell on the current tick.
    is_new: bool,
    /// The time when this end last sent.
    sent: Option<Nanos>,
    /// True if the current tick has not been compared yet.
    uncompared: bool,
    max_age: Nanos,
    differences: Differences,
    scan_counters: Arc<ReplayCounters>,
    /// Keeps recorders of this process from writing to the file.
    _place: FileClaim,
}

impl Replay {
    /// Opens the recording at `path`, which must contain the signals of the driver's table.
    ///
    /// # Errors
    ///
    /// The recording cannot be read, or has another signal table.
    pub(super) fn open(
        config: &Config,
        path: &Path,
    ) -> Result<(Self, Arc<ReplayCounters>), DriverError> {
        let place = FileClaim::to_replay(path)?;
        let recording = Recording::open(path, Some(&config.table))?;
        let map = Map::new(config, recording.columns()).map_err(|what| {
            RecordingError::of_file(
                path,
                format!("this recording is of another signal table: {what}"),
                "record again, or use the signals that it was recorded with",
            )
        })?;
        let (tx, _) = config.role.areas();
        let signals = config.table.signals.iter().zip(&map.signals);
        let unknown: Vec<&str> = signals
            .filter(|(signal, column)| signal.area == tx && column.is_none())
            .map(|(signal, _)| signal.name.as_str())
            .collect();
        if !unknown.is_empty() {
            log::warn!(
                "{}: {} signals are not in this recording and are not compared: {}",
                path.display(),
                unknown.len(),
                unknown.join(", ")
            );
        }
        let tape = Tape::start(recording)?;
        let scan_counters = Arc::new(ReplayCounters {
            file: path.display().to_string(),
            unknown: unknown.len() as u64,
            ..ReplayCounters::default()
        });
        let mut slots = vec![Slot::default(); config.table.signals.len()];
        for (slot, signal) in slots.iter_mut().zip(&config.table.signals) {
            *slot = signal.fail_safe;
        }
        let stations = Station::all(config, &map.edges);
        let replay = Self {
            stations,
            tape,
            slots,
            is_new: false,
            sent: None,
            uncompared: false,
            max_age: config.timing.max_age,
            differences: Differences::new(path),
            scan_counters: Arc::clone(&scan_counters),
            map,
            _place: place,
        };
        Ok((replay, scan_counters))
    }

    /// Applies the recorded tick that was just taken.
    fn advance(&mut self) {
        let present = self.tape.present();
        for (index, station) in self.stations.iter_mut().enumerate() {
            let status = match self.map.stations[index] {
                Some(column) => present.stations[column],
                None => present.status,
            };
            station.advance(status, present, &self.slots, &self.map.signals);
        }
        self.take_values();
        self.scan_counters.ticks.fetch_add(1, Ordering::Relaxed);
    }

    /// Takes the recorded values of the last tick.
    fn take_values(&mut self) {
        for (slot, column) in self.slots.iter_mut().zip(&self.map.signals) {
            if let Some(column) = column {
                *slot = self.tape.present().values[*column];
            }
        }
    }

    /// Shows what the recorded tick showed, in place of the received values: puts values and edge counts into `slots`,
    /// and sets the statuses of the stations. Returns the combined status and the age of the data.
    pub(super) fn show(
        &self,
        mut age: Nanos,
        image: &mut TickEnd,
        stations: &mut [super::station::Station],
        slots: &mut [Slot],
    ) -> (Code, Nanos) {
        let has_ended = self.scan_counters.ended.load(Ordering::Relaxed);
        let mut all = Code::Fresh;
        for (station, own) in stations.iter_mut().zip(&self.stations) {
            // After the end of a recording, data become stale as on any other line.
            if self.is_new || !(has_ended && station.status == Code::Stale) {
                let code = own.code().unwrap_or(station.status);
                if code == Code::Stale {
                    age = age.max(self.max_age + Nanos(1));
                }
                own.show(&self.slots, slots);
                station.shown_instead(image, code);
            }
            all = all.worse(station.status);
        }
        (all, age)
    }

    /// Calls `tell` with every latched signal that this end reads, and the number of its edges so far.
    pub(super) fn edges(&self, mut tell: impl FnMut(usize, u32)) {
        for station in &self.stations {
            station.edges(&mut tell);
        }
    }

    /// Delivers the last recorded values as frames.
    fn deliver(&mut self, now: Nanos, port: &mut Port) {
        for (index, station) in self.stations.iter_mut().enumerate() {
            match station.status {
                FRESH | UNCHANGED => match self.is_new.then(|| station.frame(&self.slots)) {
                    Some(Some(frame)) => port.received(index, now, frame),
                    _ => port.touch(index, now),
                },
                // Just older than permitted, so that the line is stale like the recorded one.
                STALE => port.touch(index, now - self.max_age - Nanos(1)),
                // A failed exchange received nothing.
                _ => {}
            }
        }
    }

    /// Compares the values that this end sends with those in the recording, once the current tick has both. A
    /// simulation that exchanges has sent before it receives; a simulation that answers within its tick sends
    /// afterwards.
    fn compare(&mut self, now: Nanos) {
        if !self.uncompared || self.sent != Some(now) {
            return;
        }
        self.uncompared = false;
        self.differences.compared();
        self.scan_counters.compared.fetch_add(1, Ordering::Relaxed);
        let (map, tick, list) = (
            &self.map.signals,
            self.tape.present(),
            &mut self.differences,
        );
        let mut found = 0;
        for station in &mut self.stations {
            station.compare(now, &self.slots, |signal, kind, name, expected, seen| {
                if map[signal].is_some() {
                    found += 1;
                    list.add(tick, name, kind, expected, seen);
                }
            });
        }
        if found > 0 {
            self.scan_counters
                .differences
                .fetch_add(found, Ordering::Relaxed);
            list.flush();
        }
    }
}

/// The statuses of a recorded tick; a tick with a status below 0 failed.
const FRESH: i32 = 0;
const UNCHANGED: i32 = 1;
const STALE: i32 = 2;

impl Stepped for Replay {
    fn send(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        if let Some(mut frames) = port.take_all(now) {
            for (index, station) in self.stations.iter_mut().enumerate() {
                station.sees(frames.frame(index));
            }
            let receipt = frames.receipt();
            port.sent(&receipt);
        }
        self.sent = Some(now);
        self.compare(now);
        Ok(())
    }

    fn receive(&mut self, now: Nanos, port: &mut Port) -> Result<Nanos, BusError> {
        self.is_new = false;
        self.stations.iter_mut().for_each(Station::begin);
        if self.tape.has_begun() {
            // The previous tick may have shaped the levels.
            self.take_values();
        }
        while self.tape.take(now) {
            self.advance();
            self.is_new = true;
        }
        // The peer was also alive between two recorded ticks.
        if self.is_new || self.tape.has_more() {
            self.deliver(now, port);
        }
        for station in &mut self.stations {
            station.shape(now, &mut self.slots);
        }
        let taken = self.is_new;
        if taken {
            port.running("the recording is replayed");
            self.uncompared = true;
            self.compare(now);
            let present = self.tape.present();
            if present.status < 0 {
                return Err(BusError::Link(format!(
                    "tick {} failed when it was recorded, too",
                    present.number
                )));
            }
        }
        if let Some(due) = self.tape.due(now) {
            return Ok(due.max(now));
        }
        match self.tape.broken() {
            Some(_) if taken => return Ok(now),
            Some(broken) => return Err(BusError::Protocol(broken.to_string())),
            None => {}
        }
        if !self.scan_counters.ended.swap(true, Ordering::Relaxed) {
            let last = self.tape.present().number;
            let why = format!(
                "tick {last} was its last, {}",
                self.tape.recording().ending()
            );
            port.lost(&BusError::Left(why), "nothing follows");
        }
        Ok(now)
    }
}

impl Drop for Replay {
    fn drop(&mut self) {
        self.differences.end(
            self.scan_counters.compared.load(Ordering::Relaxed),
            self.scan_counters.differences.load(Ordering::Relaxed),
        );
    }
}

impl Map {
    /// Finds the driver's signals in the recording.
    ///
    /// # Errors
    ///
    /// The recording does not contain signals that this end reads, or has them with another type.
    fn new(config: &Config, columns: &Columns) -> Result<Self, String> {
        let (_, rx) = config.role.areas();
        let all = columns.columns.iter().enumerate();
        let known: HashMap<(&str, bool), usize> = all
            .map(|(index, column)| ((column.name.as_str(), column.is_edges), index))
            .collect();
        let find = |signal: &Signal, edges| known.get(&(signal.name.as_str(), edges)).copied();
        let signals = &config.table.signals;
        let mut wrong = Vec::new();
        for signal in signals {
            let shown = format!("\"{}\" ({})", signal.name, signal.address());
            let Some(index) = find(signal, false) else {
                if signal.area == rx {
                    let names = columns.columns.iter().filter(|column| !column.is_edges);
                    let names: Vec<&str> = names.map(|column| column.name.as_str()).collect();
                    let near = did_you_mean(&signal.name, "signals", &names);
                    wrong.push(format!("it has no {shown}{}", meant(&near)));
                }
                continue;
            };
            let column = &columns.columns[index];
            let kind = ValueKind::of(signal.data_type, signal.scale.is_some());
            let was = match (column.address, column.data_type) {
                (Some(address), Some(data_type)) => format!("{address} {data_type}"),
                _ => "of another type".to_owned(),
            };
            let moved = column
                .address
                .is_some_and(|address| address.area != signal.area);
            if column.kind != kind || moved {
                wrong.push(format!("{shown} {} was {was}", signal.data_type));
            }
        }
        if !wrong.is_empty() {
            let more = wrong.len().saturating_sub(NAMED);
            wrong.truncate(NAMED);
            if more > 0 {
                wrong.push(format!("and {more} more"));
            }
            return Err(wrong.join(", "));
        }
        let stations = config.table.stations.iter();
        Ok(Self {
            signals: signals.iter().map(|signal| find(signal, false)).collect(),
            edges: signals.iter().map(|signal| find(signal, true)).collect(),
            stations: stations
                .map(|station| {
                    columns
                        .stations
                        .iter()
                        .position(|name| *name == station.name)
                })
                .collect(),
        })
    }
}

/// Shortens "did you mean" for use within a sentence, where a list of all names would be too long.
fn meant(near: &str) -> String {
    near.strip_prefix("did you mean ")
        .map(|name| format!(" (it has {})", name.trim_end_matches('?')))
        .unwrap_or_default()
}
