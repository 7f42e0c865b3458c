//! One end of a world's line: its driver, and the code that ticks it.

use tickbus_base::time::Nanos;
use tickbus_driver::{Code, Driver};
use tickbus_image::signal::Slot;

use crate::broken::Broken;
use crate::clock::SimulatedClock;
use crate::injector::Injector;
use crate::judge::Shown;
use crate::known;
use crate::plan::Plan;
use crate::pulses::Pulses;
use crate::scheduler::now;
use crate::stamp::{Stamp, level, real, whole};
use crate::tape::{Row, Tape};
use crate::typed::Typed;

/// The slots of a station in one direction.
#[derive(Clone, Debug)]
struct Places {
    stamp: usize,
    pulse: usize,
    /// The slot that counts rising edges of `pulse`, at the end that reads it.
    edges: Option<usize>,
    level: usize,
    numbers: Option<(usize, usize)>,
    /// The signals beside the stamp.
    typed: Vec<usize>,
    beat: Option<usize>,
}

/// An open driver.
pub(crate) struct End {
    driver: Driver,
    slots: Vec<Slot>,
    area: u64,
    writes: Vec<Places>,
    reads: Vec<Places>,
    halves: bool,
    pulses: Pulses,
    plan: Plan,
    which: usize,
    tape: Option<Tape>,
    injector: Injector,
}

/// The result of a tick.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub(crate) code: Code,
    pub(crate) age: i64,
    pub(crate) sequence: u64,
    pub(crate) stations: Vec<Shown>,
    /// The promise that the end itself found broken.
    pub(crate) broken: Option<Broken>,
}

impl End {
    pub(crate) fn open(plan: &Plan, end: usize, link: &str) -> Result<Self, Broken> {
        let text = plan.driver_cfg(end, link);
        let mut tape = Tape::begin(plan, end);
        let folder = tape.as_ref().and_then(|tape| tape.path.parent());
        let path = folder.map_or("driver.cfg".into(), |folder| folder.join("driver.cfg"));
        let path = path.to_str().expect("a plain path");
        let config = known::parse(path, text);
        if let Some(tape) = &tape {
            let open = || {
                let refused = Driver::open(config.clone(), SimulatedClock::shared()).err();
                refused.map(|why| why.to_string())
            };
            tape.judge_refusal(open)?;
        }
        let mut driver = Driver::open(config, SimulatedClock::shared())
            .unwrap_or_else(|why| panic!("a driver that does not open: {why}"));
        let slots = driver.initial_slots();
        let signals = &driver.config().table.signals;
        let place = |name: String| signals.iter().position(|signal| signal.name == name);
        let places = |area: char| {
            let typed = plan.features.beside(area);
            let reads = (area == 'Q') == (end == 0);
            let stations = 0..plan.stations;
            let places = stations.map(|station| {
                let at = |name: &str| place(format!("{name}{area}{station}"));
                let pulse = at("pulse").expect("it is in the file");
                Places {
                    stamp: at("stamp").expect("it is in the file"),
                    pulse,
                    edges: driver.slots().edges[pulse],
                    level: at("level").expect("it is in the file"),
                    numbers: at("whole").zip(at("real")),
                    beat: at("beat"),
                    typed: typed
                        .iter()
                        .flat_map(|typed| typed.names(area, station, reads))
                        .map(|name| place(name).expect("it is in the file"))
                        .collect(),
                }
            });
            places.collect()
        };
        let (writes, reads) = if end == 0 {
            (places('I'), places('Q'))
        } else {
            (places('Q'), places('I'))
        };
        if let Some(tape) = &mut tape {
            tape.names = signals.iter().map(|signal| signal.name.clone()).collect();
            let edges = driver.slots().edges.iter().zip(signals);
            let mut edges: Vec<_> = edges
                .filter_map(|(slot, signal)| Some(((*slot)?, format!("{}.edges", signal.name))))
                .collect();
            edges.sort();
            tape.names.extend(edges.into_iter().map(|(_, name)| name));
        }
        let injector = Injector::new(plan, end, &mut driver);
        if let Some(tape) = &tape {
            tape.judge_lock(plan, end)?;
        }
        Ok(Self {
            plan: plan.clone(),
            which: end,
            tape,
            injector,
            writes,
            reads,
            driver,
            slots,
            area: 1 - end as u64,
            halves: plan.ends[end].halves,
            pulses: Pulses::new(plan, now().0),
        })
    }

    /// Runs tick `tick` of this `life`; returns its result, and true if it wrote a pulse.
    pub(crate) fn tick(&mut self, life: u64, tick: u64) -> (Found, bool) {
        let time = now().0;
        let is_pulse = self.pulses.are_due(time);
        let injected = self.injector.before(tick, &mut self.driver);
        let given = self.plan.features.times[self.which].at(tick);
        let found = if self.halves {
            let found = self.driver.receive(given.map(Nanos), &mut self.slots);
            let shown = self.shown();
            self.write(life, tick, is_pulse);
            let sent = self.driver.send(&mut self.slots);
            debug_assert_eq!(sent.code, found.code);
            (found, shown)
        } else {
            self.write(life, tick, is_pulse);
            let found = self.driver.exchange(given.map(Nanos), &mut self.slots);
            (found, self.shown())
        };
        let (exchange, stations) = found;
        let found = Found {
            code: exchange.code,
            age: exchange.age.0,
            sequence: exchange.sequence,
            stations,
            broken: injected
                .and_then(|()| self.judge_own(tick, exchange.code))
                .err(),
        };
        let on_line = self.tape.as_ref().map(|_| self.on_line());
        if let (Some(tape), Some(on_line)) = (&mut self.tape, on_line) {
            tape.rows.push(Row {
                began: time,
                ended: now().0,
                time: given,
                code: found.code.code(),
                values: self.slots.iter().map(|slot| slot.0).collect(),
                on_line,
            });
        }
        (found, is_pulse)
    }

    /// Judges that the end finds the values that it wrote, and that a viewer sees the same slots.
    fn judge_own(&mut self, tick: u64, code: Code) -> Result<(), Broken> {
        let slots = &self.slots;
        for places in &self.writes {
            let stamp = slots[places.stamp].unsigned();
            let numbers = places.numbers.is_none_or(|(at, other)| {
                slots[at].real() == f64::from(whole(stamp)) && slots[other].real() == real(stamp)
            });
            let is_own = slots[places.level].real() == f64::from(u8::from(level(stamp)));
            if Stamp::of(stamp).tick != tick || !is_own || !numbers {
                return Err(Broken {
                    promise: "own values",
                    what: format!(
                        "tick {tick} of end {} finds others than it wrote",
                        self.which
                    ),
                });
            }
        }
        self.injector.behind(tick, code, slots)
    }

    fn write(&mut self, life: u64, tick: u64, is_pulse: bool) {
        for (station, places) in self.writes.iter().enumerate() {
            let stamp = Stamp {
                life,
                area: self.area,
                station: station as u64,
                tick,
            }
            .number();
            self.slots[places.stamp] = Slot::from_unsigned(stamp);
            self.slots[places.pulse] = Slot::from_real(f64::from(is_pulse));
            self.slots[places.level] = Slot::from_real(f64::from(level(stamp)));
            let typed = self.plan.features.beside(['Q', 'I'][1 - self.which]);
            for (place, typed) in places.typed.iter().zip(typed) {
                self.slots[*place] = Slot(typed.written(stamp));
            }
            if let Some((whole_at, real_at)) = places.numbers {
                self.slots[whole_at] = Slot::from_real(whole(stamp).into());
                self.slots[real_at] = Slot::from_real(real(stamp));
            }
        }
    }

    /// The slots, with the values that this end sends as they are on the line.
    fn on_line(&self) -> Vec<u64> {
        let mut values: Vec<u64> = self.slots.iter().map(|slot| slot.0).collect();
        for places in &self.writes {
            let stamp = values[places.stamp];
            for (place, typed) in places.typed.iter().zip(self.beside()) {
                values[*place] = typed.shown(Some(stamp), false)[0];
            }
        }
        values
    }

    /// The signals beside the stamps that this end writes.
    fn beside(&self) -> &[Typed] {
        self.plan.features.beside(['Q', 'I'][1 - self.which])
    }

    fn shown(&self) -> Vec<Shown> {
        let shown = self.reads.iter().map(|places| {
            let real = |place: usize| self.slots[place].real();
            Shown {
                stamp: self.slots[places.stamp].unsigned(),
                level: real(places.level) != 0.0,
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a small count"
                )]
                edges: places.edges.map_or(0, |place| real(place) as u64),
                numbers: places
                    .numbers
                    .map(|(whole, half)| (real(whole), real(half))),
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a USINT"
                )]
                beat: places.beat.map(|place| real(place) as u8),
                typed: places
                    .typed
                    .iter()
                    .map(|place| self.slots[*place].0)
                    .collect(),
            }
        });
        shown.collect()
    }

    /// Closes the driver, and judges its recording.
    pub(crate) fn close(self) -> Result<(), Broken> {
        self.driver.close();
        match &self.tape {
            Some(tape) => tape.judge(&self.plan, self.which),
            None => Ok(()),
        }
    }
}
