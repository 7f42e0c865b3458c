//! One end of a world's line: its driver, and what ticks it.

use std::cell::RefCell;
use std::collections::VecDeque;

use tickbus_base::time::Nanos;
use tickbus_driver::{Code, Driver};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Slot;

use crate::clock::SimulatedClock;
use crate::judge::{Broken, Shown, Stamp, level, real, whole};
use crate::plan::Plan;
use crate::scheduler::now;
use crate::tape::{Row, Tape};

/// The slots of a station in one direction.
#[derive(Clone, Copy, Debug)]
struct Places {
    stamp: usize,
    pulse: usize,
    /// Where rising edges of `pulse` are counted, at the end that reads it.
    edges: Option<usize>,
    level: usize,
    numbers: Option<(usize, usize)>,
}

/// An open driver.
pub(crate) struct End {
    driver: Driver,
    slots: Vec<Slot>,
    area: u64,
    writes: Vec<Places>,
    reads: Vec<Places>,
    halves: bool,
    next_pulse: i64,
    plan: Plan,
    end: usize,
    tape: Option<Tape>,
}

/// What a tick found.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub(crate) code: Code,
    pub(crate) age: i64,
    pub(crate) sequence: u64,
    pub(crate) stations: Vec<Shown>,
}

/// How many files are known at a time: those of two ends, and of two worlds.
const KNOWN: usize = 4;

/// What a driver.cfg says. Several worlds have the same one, and reading it takes longer than a life of its driver.
fn read(path: &str, text: String) -> Config {
    /// A file's path and text, and what it says.
    type Known = (String, String, Config);
    thread_local! {
        static READ: RefCell<VecDeque<Known>> = const { RefCell::new(VecDeque::new()) };
    }
    let known = READ.with_borrow(|files| {
        let known = files
            .iter()
            .find(|known| known.0 == path && known.1 == text);
        known.map(|known| known.2.clone())
    });
    known.unwrap_or_else(|| {
        let config = Config::parse(path, &text)
            .unwrap_or_else(|why| panic!("a world that tickbus refuses:\n{why}\n{text}"));
        READ.with_borrow_mut(|files| {
            files.truncate(KNOWN - 1);
            files.push_front((path.to_owned(), text, config.clone()));
        });
        config
    })
}

impl End {
    pub(crate) fn open(plan: &Plan, end: usize, link: &str) -> Result<Self, Broken> {
        let text = plan.driver_cfg(end, link);
        let mut tape = Tape::begin(plan, end);
        let folder = tape.as_ref().and_then(|tape| tape.path.parent());
        let path = folder.map_or("driver.cfg".into(), |folder| folder.join("driver.cfg"));
        let path = path.to_str().expect("a plain path");
        let config = read(path, text);
        if let Some(tape) = &tape {
            let open = || {
                let refused = Driver::open(config.clone(), SimulatedClock::shared()).err();
                refused.map(|why| why.to_string())
            };
            tape.judge_refusal(open)?;
        }
        let driver = Driver::open(config, SimulatedClock::shared())
            .unwrap_or_else(|why| panic!("a driver that does not open: {why}"));
        let slots = driver.initial_slots();
        let signals = &driver.config().table.signals;
        let place = |name: String| signals.iter().position(|signal| signal.name == name);
        let places = |area: char| {
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
        if let Some(tape) = &tape {
            tape.judge_lock(plan, end)?;
        }
        Ok(Self {
            plan: plan.clone(),
            end,
            tape,
            writes,
            reads,
            driver,
            slots,
            area: 1 - end as u64,
            halves: plan.ends[end].halves,
            next_pulse: now().0 + plan.pulses.0,
        })
    }

    /// One tick, the `tick`th of this `life`; returns what it found, and whether it wrote a pulse.
    pub(crate) fn tick(&mut self, life: u64, tick: u64, pulses: Nanos) -> (Found, bool) {
        let time = now().0;
        let is_pulse = time >= self.next_pulse;
        if is_pulse {
            self.next_pulse = time + pulses.0;
        }
        let given = self.plan.features.times[self.end].at(tick);
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
        };
        if let Some(tape) = &mut self.tape {
            tape.rows.push(Row {
                began: time,
                ended: now().0,
                time: given,
                code: found.code.code(),
                values: self.slots.iter().map(|slot| slot.0).collect(),
            });
        }
        (found, is_pulse)
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
            if let Some((whole_at, real_at)) = places.numbers {
                self.slots[whole_at] = Slot::from_real(whole(stamp).into());
                self.slots[real_at] = Slot::from_real(real(stamp));
            }
        }
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
            }
        });
        shown.collect()
    }

    /// Closes the driver, and judges what it leaves behind.
    pub(crate) fn close(self) -> Result<(), Broken> {
        self.driver.close();
        match &self.tape {
            Some(tape) => tape.judge(&self.plan, self.end),
            None => Ok(()),
        }
    }
}
