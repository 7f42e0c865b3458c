//! One driver on the page: its signals as they were seen last, what is forced, its line.

use std::collections::BTreeMap;

use serde::Serialize;
use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::did_you_mean;
use tickbus_driver::Watch;
use tickbus_fieldbus::{Link, LinkState};
use tickbus_image::signal::{Area, Latch, Plan, RawValues, Signal, Slot};
use tickbus_web::Refused;

use crate::line::{self, age_now, millis};
use crate::options::Options;
use crate::picture::Picture;
use crate::trend::{Point, Trend};
use crate::value::{Number, parse, raw};

/// The other end gets the fail-safe value, or this end sees it.
const FAIL_SAFE: u8 = 1;
/// The signal is forced.
const FORCED: u8 = 2;

/// How often the line is looked at in full.
const LINE: Nanos = Nanos::from_millis(500);

/// A driver on the page.
#[derive(Debug)]
pub(crate) struct Shown {
    /// The driver's id, unless another one on the page has it.
    pub(crate) id: i32,
    pub(crate) watch: Watch,
    pub(crate) options: Options,
    rows: Vec<Row>,
    codec: Codec,
    trend: Trend,
    /// By the index of the signal.
    forced: BTreeMap<usize, Force>,
    link: Link,
    statistics: Statistics,
    /// The line as JSON; when that was made, and the number of the state in which it was new.
    line: String,
    line_at: Nanos,
    line_number: u64,
    /// The last copy that was asked for has not come.
    pub(crate) is_waiting: bool,
    /// The present one has come.
    pub(crate) has_come: bool,
}

/// A signal, as it was seen last.
#[derive(Clone, Copy, Debug)]
struct Row {
    slot: Slot,
    bits: u64,
    edges: u32,
    flags: u8,
    /// The number of the state in which this was new.
    number: u64,
}

#[derive(Clone, Copy, Debug)]
struct Force {
    /// The fault's number.
    fault: u32,
    value: Slot,
}

/// The bits of all values, of both areas.
#[derive(Debug)]
struct Codec {
    areas: [(Vec<Plan>, RawValues); 2],
    frame: Vec<u8>,
}

impl Codec {
    fn new(watch: &Watch) -> Self {
        let table = &watch.config().table;
        let areas = [Area::Input, Area::Output].map(|area| {
            let stations = 0..table.stations.len();
            let plans = stations.map(|station| Plan::new(table, station, area));
            (plans.collect(), RawValues::new(table, area))
        });
        let sizes = table.stations.iter();
        let sizes = sizes.map(|station| station.input_bytes.max(station.output_bytes));
        Self {
            areas,
            frame: vec![0; sizes.max().unwrap_or(0)],
        }
    }

    fn take(&mut self, watch: &Watch, slots: &[Slot]) {
        let stations = watch.config().table.stations.iter().enumerate();
        for (index, station) in stations {
            for ((plans, values), area) in self.areas.iter_mut().zip([Area::Input, Area::Output]) {
                let frame = &mut self.frame[..station.bytes(area)];
                frame.fill(0);
                plans[index].encode(slots, frame);
                values.take(index, frame);
            }
        }
    }

    fn bits(&self, signal: &Signal, index: usize) -> u64 {
        let (_, values) = &self.areas[usize::from(signal.area == Area::Output)];
        values.bits(index)
    }
}

/// A signal in full.
#[derive(Serialize)]
struct SignalJson<'a> {
    name: &'a str,
    address: String,
    #[serde(rename = "type")]
    data_type: &'static str,
    unit: &'a str,
    station: usize,
    direction: &'static str,
    latch: Option<&'static str>,
    writable: bool,
    value: Number,
    raw: String,
    edges: Option<u32>,
    age_ms: Option<f64>,
    failsafe: bool,
    forced: Option<Number>,
}

#[derive(Serialize)]
struct DriverJson<'a> {
    id: i32,
    name: &'a str,
    kind: &'static str,
    role: &'static str,
    picture: bool,
    stations: Vec<&'a str>,
    signals: Vec<SignalJson<'a>>,
}

/// A signal whose value has changed: index, value, raw, edges, flags.
type ChangeJson = (usize, Number, String, Option<u32>, u8);

impl Shown {
    pub(crate) fn new(id: i32, watch: Watch, options: Options, now: Nanos) -> Self {
        let table = &watch.config().table;
        let values: Vec<Slot> = watch.view(|view| view.slots.to_vec());
        let signals = table.signals.iter().zip(&values);
        let numbers = signals.map(|(signal, slot)| Number::of(signal, *slot).real());
        let trend = Trend::new(now, numbers.collect());
        let rows = values.into_iter().map(|slot| Row {
            slot,
            bits: 0,
            edges: 0,
            flags: 0,
            number: 0,
        });
        let mut driver = Self {
            id,
            rows: rows.collect(),
            codec: Codec::new(&watch),
            trend,
            forced: BTreeMap::new(),
            link: watch.link(),
            statistics: Statistics::default(),
            line: String::new(),
            line_at: Nanos(i64::MIN / 2),
            line_number: 0,
            is_waiting: false,
            has_come: false,
            watch,
            options,
        };
        driver.update_line(now, 0, true);
        driver
    }

    /// Asks for a copy of the next tick.
    pub(crate) fn ask(&mut self, now: Nanos) {
        self.watch.ask(now - self.line_at >= LINE);
    }

    /// Takes over what is there at `now`, as the state with this number; tells whether anything is new.
    pub(crate) fn update(&mut self, now: Nanos, number: u64, with_line: bool) -> bool {
        let is_new = self.take_values(number);
        let table = &self.watch.config().table;
        for (index, (signal, row)) in table.signals.iter().zip(&self.rows).enumerate() {
            if row.number == number {
                self.trend
                    .add(index, Number::of(signal, row.slot).real(), None);
            }
        }
        self.trend.go_on(now);
        self.update_line(now, number, with_line) || is_new
    }

    /// Compares the values with those that were seen last.
    fn take_values(&mut self, number: u64) -> bool {
        let Self {
            watch,
            rows,
            codec,
            forced,
            trend,
            ..
        } = self;
        let config = watch.config();
        let (table, writes) = (&config.table, watch.writes());
        let silence = watch.silence();
        // A program behind its bus is not watched by it: it has a limit of its own, of its scans.
        let watchdog = config.timing.watchdog.filter(|_| watch.is_driver());
        // The other end gets fail-safe values of a simulation that has stopped.
        let has_stopped = watchdog.is_some_and(|limit| silence > limit);
        let mut is_new = false;
        let mut values = watch.view(|view| view.slots.to_vec());
        for (index, signal) in table.signals.iter().enumerate() {
            if signal.area == writes {
                if let Some(force) = forced.get(&index) {
                    values[index] = force.value;
                }
                if has_stopped {
                    values[index] = signal.fail_safe;
                }
            }
        }
        codec.take(watch, &values);
        watch.view(|view| {
            for (index, (signal, row)) in table.signals.iter().zip(rows).enumerate() {
                let is_fail_safe = if signal.area == writes {
                    has_stopped
                } else {
                    view.stations[signal.station].is_fail_safe
                };
                let mut flags = if is_fail_safe { FAIL_SAFE } else { 0 };
                if forced.contains_key(&index) {
                    flags |= FORCED;
                }
                let seen = Row {
                    slot: values[index],
                    bits: codec.bits(signal, index),
                    edges: view.edges[index],
                    flags,
                    number,
                };
                // A pulse that was over before it was seen.
                let edges = seen.edges.wrapping_sub(row.edges);
                if edges > 0 && (edges > 1 || seen.slot == row.slot) {
                    let value = Number::of(signal, seen.slot).real();
                    trend.add(index, value, Some([0.0, 1.0]));
                }
                let is_same = (row.slot, row.bits, row.edges, row.flags)
                    == (seen.slot, seen.bits, seen.edges, seen.flags);
                if !is_same {
                    *row = seen;
                    is_new = true;
                }
            }
        });
        is_new
    }

    fn update_line(&mut self, now: Nanos, number: u64, with_line: bool) -> bool {
        let link = self.watch.link();
        let is_other = (link.state, link.cause) != (self.link.state, self.link.cause)
            || (link.state == LinkState::Opening && link.reason != self.link.reason);
        let is_due = with_line && now - self.line_at >= LINE;
        if !is_other && !is_due {
            return false;
        }
        self.statistics = self.watch.statistics();
        self.link = link;
        self.line_at = now;
        self.line_number = number;
        self.line = line::json(self.id, &self.watch, &self.link, &self.statistics);
        true
    }

    /// Sends what has changed in full at the next occasion.
    pub(crate) fn forget(&mut self) {
        self.line_at = Nanos(i64::MIN / 2);
    }

    /// The line as JSON.
    pub(crate) fn line(&self) -> &str {
        &self.line
    }

    pub(crate) fn link(&self) -> &Link {
        &self.link
    }

    pub(crate) fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Whether its line is new since the state with this number.
    pub(crate) fn has_new_line(&self, since: u64) -> bool {
        self.line_number > since
    }

    /// All about the driver and its signals, as JSON.
    pub(crate) fn signals(&self) -> String {
        let config = self.watch.config();
        let stations = config.table.stations.iter();
        let driver = DriverJson {
            id: self.id,
            name: &config.name,
            kind: config.bus.kind(),
            role: self.watch.role().name(),
            picture: self.options.picture.is_some(),
            stations: stations.map(|station| station.name.as_str()).collect(),
            signals: (0..self.rows.len())
                .map(|index| self.signal(index))
                .collect(),
        };
        serde_json::to_string(&driver).expect("texts and numbers")
    }

    fn signal(&self, index: usize) -> SignalJson<'_> {
        let signal = &self.watch.config().table.signals[index];
        let row = self.rows[index];
        let is_written = signal.area == self.watch.writes();
        let silence = self.watch.silence();
        let age = self
            .watch
            .view(|view| age_now(&view.stations[signal.station], silence));
        SignalJson {
            name: &signal.name,
            address: signal.address().to_string(),
            data_type: signal.data_type.name(),
            unit: signal.unit.as_deref().unwrap_or_default(),
            station: signal.station,
            direction: match signal.area {
                Area::Input => "I",
                Area::Output => "Q",
            },
            latch: signal.latch.map(|latch| match latch {
                Latch::Rising => "rising",
                Latch::Falling => "falling",
                Latch::Both => "both",
            }),
            writable: true,
            value: Number::of(signal, row.slot),
            raw: raw(signal.data_type, row.bits),
            edges: signal.latch.map(|_| row.edges),
            age_ms: if is_written { None } else { millis(age) },
            failsafe: row.flags & FAIL_SAFE != 0,
            forced: self
                .forced
                .get(&index)
                .map(|force| Number::of(signal, force.value)),
        }
    }

    /// The signals that are new since the state with this number, as JSON; `None` without any.
    pub(crate) fn changes(&self, since: u64) -> Option<String> {
        let signals = &self.watch.config().table.signals;
        let rows = self.rows.iter().enumerate();
        let rows = rows.filter(|(_, row)| row.number > since);
        let changes: Vec<ChangeJson> = rows
            .map(|(index, row)| {
                let signal = &signals[index];
                (
                    index,
                    Number::of(signal, row.slot),
                    raw(signal.data_type, row.bits),
                    signal.latch.map(|_| row.edges),
                    row.flags,
                )
            })
            .collect();
        (!changes.is_empty()).then(|| serde_json::to_string(&changes).expect("texts and numbers"))
    }

    /// The last minutes of a signal; `None` if there is no such signal.
    pub(crate) fn trend(&self, signal: usize, now: Nanos) -> Option<Vec<Point>> {
        (signal < self.rows.len()).then(|| self.trend.of(signal, now))
    }

    pub(crate) fn picture(&self) -> Option<&Picture> {
        self.options.picture.as_ref()
    }

    /// The values of the signals, for programs.
    pub(crate) fn values(&self) -> impl Iterator<Item = (&Signal, Number, Option<u32>, bool)> {
        let signals = self.watch.config().table.signals.iter();
        signals.zip(&self.rows).map(|(signal, row)| {
            let edges = signal.latch.map(|_| row.edges);
            let is_forced = row.flags & FORCED != 0;
            (signal, Number::of(signal, row.slot), edges, is_forced)
        })
    }

    /// Whether a signal is forced.
    pub(crate) fn is_forcing(&self) -> bool {
        !self.forced.is_empty()
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

    /// Holds a signal to a value.
    pub(crate) fn force(&mut self, name: &str, value: &str) -> Result<(), Refused> {
        let index = self.position(name)?;
        let signal = &self.watch.config().table.signals[index];
        let value = parse(value, signal).map_err(|text| Refused { status: 400, text })?;
        let before = self.forced.get(&index).copied();
        if before.is_some_and(|force| force.value == value) {
            return Ok(());
        }
        let refused = |mistake: tickbus_base::Mistake| Refused {
            status: 409,
            text: mistake.to_string(),
        };
        let fault = self.watch.force(index, value).map_err(refused)?;
        self.forced.insert(index, Force { fault, value });
        // In one go with the new one, so that the signal is held throughout.
        if let Some(before) = before {
            self.watch.end_fault(before.fault).map_err(refused)?;
        }
        Ok(())
    }

    /// Holds a signal no longer.
    pub(crate) fn release(&mut self, name: &str) -> Result<(), Refused> {
        let index = self.position(name)?;
        let Some(force) = self.forced.get(&index) else {
            // As it is asked for.
            return Ok(());
        };
        self.watch
            .end_fault(force.fault)
            .map_err(|mistake| Refused {
                status: 409,
                text: mistake.to_string(),
            })?;
        self.forced.remove(&index);
        Ok(())
    }

    /// Holds no signal any longer; those whose end the simulation does not take over remain.
    pub(crate) fn release_all(&mut self) -> Result<(), Refused> {
        let mut refused = None;
        let watch = &mut self.watch;
        self.forced.retain(|_, force| {
            let ended = watch.end_fault(force.fault);
            let remains = ended.is_err();
            refused = refused.take().or(ended.err());
            remains
        });
        refused.map_or(Ok(()), |mistake| {
            Err(Refused {
                status: 409,
                text: mistake.to_string(),
            })
        })
    }

    /// Forgets what is forced no more, since others can end faults as well.
    pub(crate) fn look_at_forced(&mut self) {
        let watch = &self.watch;
        self.forced
            .retain(|_, force| watch.is_fault_on(force.fault));
    }
}
