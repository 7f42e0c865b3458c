//! One of the two recordings.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{nearest, shown};
use tickbus_image::signal::{Area, SignalTable};
use tickbus_record::{Recording, RecordingError};
use tickbus_report::{Change, LIVE, MarkKind, Run, read};

use super::curve::Curve;

/// From and until.
pub(super) type Span = (Nanos, Nanos);

/// A recording in memory, and what is known of its signals.
#[derive(Debug)]
pub struct Side {
    /// The name for messages: the file's.
    pub name: String,
    /// The values.
    pub run: Run,
    /// The area of each signal, in the order of the run; `None` if unknown, as in a CSV file.
    areas: Vec<Option<Area>>,
    /// When the value of each signal was not known: dropped ticks, and stale data.
    pub(super) unknown: Vec<Vec<Span>>,
    /// Remarks about the recording.
    pub(super) notes: Vec<String>,
}

/// One signal of a recording, on the clock of the real one. Values are NaN while they are unknown.
pub(super) struct View<'a> {
    changes: Cow<'a, [Change]>,
    unknown: Vec<Span>,
    begin: Nanos,
    end: Nanos,
}

impl View<'_> {
    pub(super) fn curve(&self) -> Curve<'_> {
        Curve {
            changes: &self.changes,
            begin: self.begin,
            end: self.end,
        }
    }

    /// True if the signal's value at this time was recorded.
    pub(super) fn is_known(&self, at: Nanos) -> bool {
        at >= self.begin && at <= self.end && !is_in(&self.unknown, at)
    }
}

/// True if one of these spans, which are in order and apart, has begun by `at` and not ended.
fn is_in(spans: &[Span], at: Nanos) -> bool {
    let past = spans.partition_point(|span| span.0 <= at);
    past > 0 && spans[past - 1].1 > at
}

impl Side {
    /// A run whose values are all known; `areas` are those of its signals.
    pub fn new(name: &str, run: Run, areas: Vec<Option<Area>>) -> Self {
        Self {
            name: name.to_owned(),
            unknown: vec![Vec::new(); areas.len()],
            run,
            areas,
            notes: Vec::new(),
        }
    }

    /// Reads the recording at `path`, with at most `budget` changes in memory. `table` has the types of a CSV file's
    /// columns. A recording that was cut off is read to its last whole tick.
    ///
    /// # Errors
    ///
    /// The file is no recording, is damaged, or has no tick.
    pub fn load(
        path: &Path,
        table: Option<&SignalTable>,
        budget: usize,
    ) -> Result<Self, RecordingError> {
        let mut recording = Recording::open(path, table)?;
        let (run, error) = read(&mut recording, budget);
        if let Some(error) = error {
            return Err(error);
        }
        if run.ticks() == 0 {
            let right = "record a run with at least one tick";
            return Err(RecordingError::of_file(path, "no tick is recorded", right));
        }
        let columns = recording.columns();
        let own = columns.columns.iter().filter(|column| !column.is_edges);
        let area = |name: &str| {
            let table = table?;
            Some(table.signals[table.position(name)?].area)
        };
        let areas: Vec<Option<Area>> = own
            .clone()
            .map(|column| {
                let address = column.address.map(|address| address.area);
                address.or_else(|| area(&column.name))
            })
            .collect();
        // A device writes the inputs of the PLC: they are known, whatever the state of the line.
        let is_received =
            |area: Option<Area>| columns.role != "device" || area == Some(Area::Output);
        let unknown = own.zip(&areas).map(|(column, area)| {
            let station = is_received(*area).then_some(&*column.station);
            unknown_spans(&run, station)
        });
        let unknown: Vec<Vec<Span>> = unknown.collect();
        let name = path.display().to_string();
        let mut notes = Vec::new();
        if recording.is_cut() {
            let (_, end) = run.extent();
            let ending = recording.ending();
            notes.push(format!(
                "{name}: the recording breaks off at {end}: {ending}"
            ));
        }
        if let Some((from, _)) = unknown.iter().flatten().min() {
            notes.push(format!(
                "{name}: data were stale or dropped, at {from} first; such times are not compared"
            ));
        }
        let thinned = run.signals().iter();
        let thinned = thinned.filter(|signal| signal.resolution() > Nanos::ZERO);
        let names: Vec<&str> = thinned.map(|signal| &*signal.name).collect();
        if !names.is_empty() {
            notes.push(format!(
                "{name}: thinned for want of memory: {}; --changes has the limit",
                names.join(", ")
            ));
        }
        Ok(Self {
            name,
            run,
            areas,
            unknown,
            notes,
        })
    }

    /// A signal, with all its times moved by `moved`.
    pub(super) fn view(&self, signal: usize, moved: Nanos) -> View<'_> {
        let changes = self.run.signals()[signal].changes();
        let (begin, end) = self.run.extent();
        let unknown = &self.unknown[signal];
        let changes = if unknown.is_empty() && moved == Nanos::ZERO {
            Cow::Borrowed(changes)
        } else {
            let known = changes.iter().filter(|change| !is_in(unknown, change.at));
            let mut all: Vec<Change> = known.copied().collect();
            for (from, until) in unknown {
                let past = changes.partition_point(|change| change.at <= *until);
                let last = past.checked_sub(1).map(|last| changes[last].value);
                for (at, value) in [(*from, f64::NAN), (*until, last.unwrap_or(f64::NAN))] {
                    all.push(Change { at, value });
                }
            }
            all.sort_by_key(|change| change.at);
            for change in &mut all {
                change.at += moved;
            }
            Cow::Owned(all)
        };
        let moved_span = |(from, until): &Span| (*from + moved, *until + moved);
        View {
            changes,
            unknown: unknown.iter().map(moved_span).collect(),
            begin: begin + moved,
            end: end + moved,
        }
    }

    /// True if the signal with this number is an input of the PLC, or nobody knows.
    fn is_input(&self, signal: usize) -> bool {
        self.areas[signal].is_none_or(|area| area == Area::Input)
    }

    /// The numbers, here and in `other`, of the signals to be compared: those that the machine writes, but for `ignored`
    /// ones.
    ///
    /// # Errors
    ///
    /// A signal has another type or unit in the other recording, or no signal is in both.
    pub(super) fn pairs(
        &self,
        other: &Self,
        ignored: &[String],
    ) -> Result<Vec<(usize, usize)>, Vec<Mistake>> {
        let mut places: BTreeMap<&str, usize> = BTreeMap::new();
        for (place, signal) in other.run.signals().iter().enumerate() {
            places.entry(&signal.name).or_insert(place);
        }
        let (mut pairs, mut mistakes) = (Vec::new(), Vec::new());
        for (place, signal) in self.run.signals().iter().enumerate() {
            let Some(twin) = places.get(&*signal.name) else {
                continue;
            };
            if !self.is_input(place) || ignored.contains(&signal.name) {
                continue;
            }
            let known = &other.run.signals()[*twin];
            let (name, here, there) =
                (shown(&signal.name), shown(&signal.unit), shown(&known.unit));
            let what = if known.kind != signal.kind {
                format!("\"{name}\" is a BOOL in one of the recordings only")
            } else if known.unit != signal.unit && !known.unit.is_empty() && !signal.unit.is_empty()
            {
                format!("\"{name}\" is in {there}, and in {here} in {}", self.name)
            } else {
                pairs.push((place, *twin));
                continue;
            };
            let right = "record both with one signal table, or --ignore the signal";
            mistakes.push(Mistake::new(format!("{}: {what}", other.name), right));
        }
        if pairs.is_empty() && mistakes.is_empty() {
            let near = self.run.signals().iter().find_map(|signal| {
                let near = nearest(&signal.name, places.keys().copied())?;
                let (name, near) = (shown(&signal.name), shown(near));
                Some(format!("the nearest names are \"{name}\" and \"{near}\""))
            });
            let right = near.unwrap_or_else(|| "record both with one signal table".to_owned());
            let what = format!(
                "{}: no input of the PLC in {} is in this recording",
                other.name, self.name
            );
            mistakes.push(Mistake::new(what, right));
        }
        if mistakes.is_empty() {
            Ok(pairs)
        } else {
            Err(mistakes)
        }
    }

    /// The names of the inputs of the PLC, but for `ignored` ones, that `other` does not have.
    pub(super) fn without(&self, other: &Self, ignored: &[String]) -> Vec<String> {
        let signals = self.run.signals().iter().enumerate();
        let alone = signals.filter(|(place, signal)| {
            self.is_input(*place)
                && other.run.signal(&signal.name).is_none()
                && !ignored.contains(&signal.name)
        });
        alone.map(|(_, signal)| signal.name.clone()).collect()
    }
}

/// When nothing is known: ticks were dropped, or `station`, if one is given, had stale data or none.
fn unknown_spans(run: &Run, station: Option<&str>) -> Vec<Span> {
    let (_, end) = run.extent();
    let (mut spans, mut since) = (Vec::new(), None);
    for mark in run.marks() {
        if mark.kind == MarkKind::Gap {
            // The tick before the gap is known.
            spans.push((Nanos(mark.at.0 + 1), mark.until.unwrap_or(end)));
        } else if mark.kind == MarkKind::Link && station == Some(&*mark.of) {
            spans.extend(since.take().map(|from| (from, mark.at)));
            since = (mark.text != LIVE).then_some(mark.at);
        }
    }
    spans.extend(since.map(|from| (from, end)));
    spans.sort_unstable();
    let mut apart: Vec<Span> = Vec::new();
    for span in spans {
        match apart.last_mut().filter(|last| last.1 >= span.0) {
            Some(last) => last.1 = last.1.max(span.1),
            None => apart.push(span),
        }
    }
    apart
}
