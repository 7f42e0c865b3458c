//! One driver on the page: its signals as last seen, the forces, the line.

use std::collections::BTreeMap;
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{did_you_mean, shown};
use tickbus_driver::{FailSafeValues, Watch};
use tickbus_fieldbus::faults::SignalEffect;
use tickbus_fieldbus::{Link, LinkState, Role};
use tickbus_image::signal::{Area, Latch, Signal, Slot};
use tickbus_web::Refused;

use crate::archive::{Archive, Facts};
use crate::codec::Codec;
use crate::exhibit::{Exhibit, Freshness};
use crate::forcing::{self, Way};
use crate::line::{self, age_now, millis};
use crate::lists::Beside;
use crate::options::Options;
use crate::picture::Picture;
use crate::sheet::{DriverJson, FAIL_SAFE, FORCED, Row, STALE, Sheet, SignalJson, UNKNOWN};
use crate::value::Number;

/// A simulation that has not ticked for this long stands still.
const SILENT: Nanos = Nanos::from_millis(500);

/// A driver on the page.
#[derive(Debug)]
pub(crate) struct Shown {
    /// The driver's id, or a different one if another driver on the page has it.
    id: i32,
    watch: Watch,
    options: Options,
    sheet: Sheet,
    archive: Option<Arc<Archive>>,
    lists: Option<Arc<Beside>>,
    codec: Codec,
    /// By the index of the signal.
    forced: BTreeMap<usize, Force>,
    /// The faults that the page has given the simulation's model: their numbers, by name.
    faults: BTreeMap<String, u32>,
    /// Replaced faults whose end the simulation has not taken over yet.
    ending: Vec<u32>,
    link: Link,
    statistics: Statistics,
    /// Per station, true if the data are stale, and if that is new.
    stale: Vec<bool>,
    is_turn: bool,
}

#[derive(Clone, Copy, Debug)]
struct Force {
    /// The fault's number.
    fault: u32,
    /// The value that the signal has, or that a ramp reaches.
    value: Slot,
    way: Way,
    /// The value at which a ramp begins, if the signal was forced before.
    from: Option<Slot>,
}

impl Force {
    /// The value at this moment; `None` while a ramp from the signal's own value has not begun.
    fn now(&self, watch: &Watch) -> Option<Slot> {
        match self.way {
            Way::Ramp(_) => watch.ramp_value(self.fault).or(self.from),
            _ => Some(self.value),
        }
    }
}

impl Shown {
    pub(crate) fn new(id: i32, watch: Watch, options: Options, now: Nanos) -> Self {
        let config = watch.config();
        let archive = watch.history().map(|history| {
            let fail_safe = if watch.is_driver() {
                FailSafeValues::All
            } else if watch.role() == Role::Device {
                FailSafeValues::Stated
            } else {
                FailSafeValues::None
            };
            let facts = Facts {
                table: config.table.clone(),
                reads: Some(watch.role().areas().1),
                fail_safe,
                is_sampled: false,
                has_bits: true,
            };
            Arc::new(Archive::new(Arc::clone(history), facts))
        });
        let lists = options.lists.clone().map(|path| {
            let signals = config.table.signals.clone();
            Arc::new(Beside { path, signals })
        });
        let values: Vec<Slot> = watch.view(|view| view.slots.to_vec());
        let mut driver = Self {
            id,
            sheet: Sheet::new(&values),
            archive,
            lists,
            codec: Codec::new(&config.table),
            forced: BTreeMap::new(),
            faults: BTreeMap::new(),
            ending: Vec::new(),
            link: watch.link(),
            statistics: Statistics::default(),
            stale: Vec::new(),
            is_turn: false,
            watch,
            options,
        };
        driver.update_line(now, 0, true);
        driver
    }

    /// Compares the values with those last seen.
    fn take_values(&mut self, number: u64) -> bool {
        let Self {
            watch,
            sheet,
            codec,
            forced,
            stale,
            is_turn,
            ..
        } = self;
        let config = watch.config();
        let (table, writes) = (&config.table, watch.writes());
        let silence = watch.silence();
        // The driver's watchdog does not watch a program behind its bus: the program's scans have their own limit.
        let watchdog = watch.watchdog().filter(|_| watch.is_driver());
        // After a simulation has stopped, the other end gets fail-safe values.
        let has_stopped = watchdog.is_some_and(|limit| silence > limit);
        let mut is_new = false;
        let mut values = watch.view(|view| view.slots.to_vec());
        for (index, signal) in table.signals.iter().enumerate() {
            if signal.area == writes {
                if let Some(value) = forced.get(&index).and_then(|force| force.now(watch)) {
                    values[index] = value;
                }
                if has_stopped {
                    values[index] = signal.fail_safe;
                }
            }
        }
        codec.take(table, &values);
        watch.view(|view| {
            let count = |station| line::is_stale_now(station, silence, watch.max_age());
            let now: Vec<bool> = view.stations.iter().map(count).collect();
            *is_turn |= now != *stale;
            *stale = now;
            for (index, signal) in table.signals.iter().enumerate() {
                let is_fail_safe = if signal.area == writes {
                    has_stopped
                } else {
                    view.stations[signal.station].fail_safe.has(signal)
                };
                let mut flags = if is_fail_safe { FAIL_SAFE } else { 0 };
                if signal.area != writes && stale[signal.station] {
                    flags |= STALE;
                    if !is_fail_safe && view.stations[signal.station].age == Nanos::MAX {
                        flags |= UNKNOWN;
                    }
                }
                if forced.contains_key(&index) {
                    // A forced value is known.
                    flags = flags & !(STALE | UNKNOWN) | FORCED;
                }
                let seen = Row {
                    slot: values[index],
                    bits: codec.bits(signal, index),
                    edges: view.edges[index],
                    flags,
                    number,
                };
                is_new |= sheet.put(index, seen);
            }
        });
        is_new
    }

    fn update_line(&mut self, now: Nanos, number: u64, with_line: bool) -> bool {
        let link = self.watch.link();
        if let Some(archive) = &self.archive {
            archive.note_line(&link, self.watch.clock().now());
            let before = self.watch.view(|view| view.recorded_before);
            // Taken first: the faults are those of this tick, or of a later one.
            let known = archive.last();
            archive.note_faults(&self.watch.faults(), before, known);
        }
        let is_other = (link.state, link.cause) != (self.link.state, self.link.cause)
            || (link.state == LinkState::Opening && link.reason != self.link.reason)
            || std::mem::take(&mut self.is_turn);
        let is_due = with_line && self.sheet.is_line_due(now);
        if !is_other && !is_due {
            return false;
        }
        self.statistics = self.watch.statistics();
        self.link = link;
        let archive = self.archive.as_ref();
        // The time of the history stands still while the simulation does not tick. A copy that is asked for comes with the
        // next tick, so that a short silence means nothing.
        let silence = match self.watch.silence() {
            silence if silence >= SILENT && silence < Nanos::MAX => silence,
            _ => Nanos::ZERO,
        };
        let events = archive.map_or_else(Vec::new, |archive| archive.fault_events(silence));
        let line = line::json(self.id, &self.watch, &self.link, &self.statistics, events);
        self.sheet.set_line(now, number, line);
        true
    }

    fn signal(&self, index: usize) -> SignalJson<'_> {
        let signal = &self.watch.config().table.signals[index];
        let row = self.sheet.rows[index];
        let is_written = signal.area == self.watch.writes();
        let silence = self.watch.silence();
        let age = self
            .watch
            .view(|view| age_now(&view.stations[signal.station], silence));
        SignalJson {
            name: &signal.name,
            address: signal.plc_address().to_string(),
            data_type: signal.data_type.name(),
            unit: signal.unit.as_deref().unwrap_or_default(),
            comment: signal.comment(),
            folder: signal.folder(),
            station: signal.station,
            direction: Some(match signal.plc_address().area {
                Area::Input => "I",
                Area::Output => "Q",
            }),
            latch: signal.latch.map(|latch| match latch {
                Latch::Rising => "rising",
                Latch::Falling => "falling",
                Latch::Both => "both",
            }),
            reply: self.watch.config().reply_of(index).map(|reply| reply.kind),
            writable: self.watch.role() != Role::Observer,
            value: row.value(signal),
            raw: row.raw(signal),
            edges: signal.latch.map(|_| row.edges),
            age_ms: if is_written { None } else { millis(age) },
            failsafe: row.flags & FAIL_SAFE != 0,
            stale: row.flags & STALE != 0,
            forced: self.forced.get(&index).map(|force| {
                let now = force.now(&self.watch);
                Number::of(signal, now.unwrap_or(row.slot))
            }),
        }
    }

    fn position(&self, name: &str) -> Result<usize, Refused> {
        let table = &self.watch.config().table;
        table.position(name).ok_or_else(|| {
            let names: Vec<&str> = table.signals.iter().map(|s| s.name.as_str()).collect();
            let right = did_you_mean(name, "signals", &names);
            Refused {
                status: 404,
                text: format!(
                    "the driver \"{}\" has no signal \"{}\"; {right}",
                    self.watch.config().name,
                    tickbus_base::toml_text::shown(name)
                ),
            }
        })
    }
}

impl Exhibit for Shown {
    fn id(&self) -> i32 {
        self.id
    }

    fn name(&self) -> &str {
        &self.watch.config().name
    }

    fn signals(&self) -> &[Signal] {
        &self.watch.config().table.signals
    }

    fn sheet(&self) -> &Sheet {
        &self.sheet
    }

    fn sheet_mut(&mut self) -> &mut Sheet {
        &mut self.sheet
    }

    /// Requests a copy of the next tick.
    fn ask(&mut self, now: Nanos) {
        self.watch.ask(self.sheet.is_line_due(now));
    }

    fn take(&mut self) -> bool {
        self.watch.update()
    }

    fn update(&mut self, now: Nanos, number: u64, with_line: bool) -> bool {
        let is_new = self.take_values(number);
        self.update_line(now, number, with_line) || is_new
    }

    fn json(&self) -> String {
        let config = self.watch.config();
        let stations = config.table.stations.iter();
        let signals = 0..config.table.signals.len();
        let driver = DriverJson {
            id: self.id,
            name: &config.name,
            kind: self.watch.bus_kind(),
            role: self.watch.role().name(),
            picture: self.options.picture.is_some(),
            lists: self.lists.is_some(),
            stations: stations.map(|station| station.name.as_str()).collect(),
            signals: signals.map(|index| self.signal(index)).collect(),
        };
        serde_json::to_string(&driver).expect("texts and numbers")
    }

    fn stations(&self) -> Vec<Freshness<'_>> {
        let silence = self.watch.silence();
        let sections = self.watch.config().table.stations.iter();
        self.watch.view(|view| {
            let max_age = self.watch.max_age();
            let stations = sections.zip(&view.stations);
            let stations = stations.map(|(section, station)| Freshness {
                name: &section.name,
                age_ms: millis(age_now(station, silence)),
                stale: line::is_stale_now(station, silence, max_age),
            });
            stations.collect()
        })
    }

    fn state(&self) -> LinkState {
        self.link.state
    }

    fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    fn archive(&self) -> Option<Arc<Archive>> {
        self.archive.clone()
    }

    fn picture(&self) -> Option<&Picture> {
        self.options.picture.as_ref()
    }

    fn lists(&self) -> Option<Arc<Beside>> {
        self.lists.clone()
    }

    fn force(&mut self, values: &[(String, String)]) -> Result<(), Refused> {
        self.look_at_forced();
        let mut wanted: BTreeMap<usize, (Slot, Way)> = BTreeMap::new();
        for (name, text) in values {
            let index = self.position(name)?;
            let signal = &self.watch.config().table.signals[index];
            let read = forcing::read(text, signal);
            let (value, way) = read.map_err(|text| Refused { status: 400, text })?;
            let is_held = |force: &Force| force.value == value && force.way == Way::Hold;
            if way != Way::Hold || !self.forced.get(&index).is_some_and(is_held) {
                wanted.insert(index, (value, way));
            }
        }
        if wanted.is_empty() {
            return Ok(());
        }
        // The old faults end together with the new ones, so that each signal is held throughout.
        let before = wanted.keys().filter_map(|index| self.forced.get(index));
        let ends = before.map(|force| force.fault).collect();
        let forces = wanted.iter().map(|(index, (value, way))| {
            let before = self.forced.get(index);
            let from = before.and_then(|force| force.now(&self.watch));
            way.force(*index, *value, from)
        });
        let forces: Vec<_> = forces.collect();
        let faults = self
            .watch
            .force_all(&forces, ends)
            .map_err(|mistake| conflict(&mistake))?;
        for (fault, (force, (index, (value, way)))) in
            faults.into_iter().zip(forces.iter().zip(wanted))
        {
            if let Some(archive) = &self.archive {
                archive.note_force(fault, *force);
            }
            let from = match force.effect {
                SignalEffect::Ramp { from, .. } => from,
                _ => None,
            };
            let force = Force {
                fault,
                value,
                way,
                from,
            };
            self.forced.insert(index, force);
        }
        Ok(())
    }

    fn release(&mut self, signals: &[String]) -> Result<(), Refused> {
        let places: Result<Vec<usize>, Refused> =
            signals.iter().map(|name| self.position(name)).collect();
        let mut places = places?;
        // A signal that is not forced is as requested.
        places.retain(|index| self.forced.contains_key(index));
        let ends: Vec<u32> = places.iter().map(|at| self.forced[at].fault).collect();
        if ends.is_empty() {
            return Ok(());
        }
        self.watch
            .force_all(&[], ends)
            .map_err(|mistake| conflict(&mistake))?;
        for index in places {
            self.forced.remove(&index);
        }
        Ok(())
    }

    fn fault(&mut self, name: &str, value: Option<&str>) -> Result<(), Refused> {
        let unknown = |mistake: Mistake| Refused {
            status: 404,
            text: mistake.to_string(),
        };
        let value = value.map(|text| fault_value(name, text)).transpose()?;
        self.look_at_forced();
        let before = self.faults.get(name).copied();
        if let Some(value) = value {
            let fault = self
                .watch
                .inject_model_fault(name, value)
                .map_err(unknown)?;
            self.faults.insert(name.to_owned(), fault);
        }
        // End the old fault together with the new one, so that the model has one of them throughout.
        if let Some(before) = before
            && self.watch.end_fault(before).is_err()
        {
            self.ending.push(before);
        }
        if value.is_none() {
            self.faults.remove(name);
        }
        Ok(())
    }

    fn release_all(&mut self) -> Result<(), Refused> {
        let mut refused = None;
        let watch = &mut self.watch;
        let mut remains = |fault: u32| {
            let ended = watch.end_fault(fault);
            let remains = ended.is_err();
            refused = refused.take().or(ended.err());
            remains
        };
        self.forced.retain(|_, force| remains(force.fault));
        self.faults.retain(|_, fault| remains(*fault));
        refused.map_or(Ok(()), |mistake| Err(conflict(&mistake)))
    }

    fn look_at_forced(&mut self) {
        let watch = &mut self.watch;
        self.ending.retain(|fault| watch.end_fault(*fault).is_err());
        self.forced
            .retain(|_, force| watch.is_fault_on(force.fault));
        self.faults.retain(|_, fault| watch.is_fault_on(*fault));
    }

    fn grace(&self) -> Option<Nanos> {
        let is_free = self.forced.is_empty() && self.faults.is_empty();
        self.options.grace.filter(|_| !is_free)
    }
}

/// The simulation does not take it over.
fn conflict(mistake: &Mistake) -> Refused {
    Refused {
        status: 409,
        text: mistake.to_string(),
    }
}

/// The value of a fault of the model, as a request has it.
fn fault_value(name: &str, text: &str) -> Result<f64, Refused> {
    let number = match text.trim() {
        "TRUE" => Some(1.0),
        "FALSE" => Some(0.0),
        text => text.parse::<f64>().ok(),
    };
    let finite = number.filter(|number| number.is_finite());
    finite.ok_or_else(|| Refused {
        status: 400,
        text: format!(
            "\"{}\" is no value for \"{name}\"; write a number, TRUE or FALSE",
            shown(text)
        ),
    })
}
