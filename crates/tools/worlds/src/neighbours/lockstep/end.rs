//! One end of a run on virtual time: its ticks, and the values that they show.

use tickbus_base::time::Nanos;
use tickbus_driver::{Code, Driver, Exchange};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Slot;

use super::course::What;
use super::{ATTEMPTS, NAMES, SERVER, Shared, Told};
use crate::broken::{Broken, broken};
use crate::clock::SimulatedClock;
use crate::plan::FAIL_SAFE;
use crate::random::{Random, scramble};
use crate::scheduler;
use crate::stamp::{Stamp, level};

/// Returns true if a tick writes a pulse.
const fn is_pulse(tick: u64) -> bool {
    tick % 3 == 2
}

/// The slots of a station in one direction.
struct Places {
    stamp: usize,
    pulse: usize,
    edges: Option<usize>,
    level: usize,
}

/// An end with its driver.
struct End<'a> {
    shared: &'a Shared,
    which: usize,
    driver: Driver,
    slots: Vec<Slot>,
    writes: Vec<Places>,
    reads: Vec<Places>,
    /// The number of ticks that the end has had in the run.
    ticks: u64,
}

/// Runs one end, tick by tick.
pub(super) fn live(shared: &Shared, end: usize) {
    let course = &shared.course;
    let mut at = End::open(shared, end);
    let mut random = Random::new(scramble(end as u64 ^ course.steps));
    let mut attempts = 0;
    loop {
        match shared.orders[end].take() {
            Some(What::Pause(_, span)) => scheduler::sleep(span),
            Some(_) => {
                shared.is_gone[end].set(true);
                break;
            }
            None => {}
        }
        let found = at.tick();
        if shared.is_gone[end].get() {
            // Nobody sees the results of a killed process.
            break;
        }
        let (now, code) = (scheduler::now().0, found.code);
        shared.note(format!(
            "{now} {} tick {} {} sequence {}",
            NAMES[end],
            at.ticks + 1,
            code.name(),
            found.sequence
        ));
        if code == Code::Fresh {
            at.ticks += 1;
            shared.check(at.judge(found));
        } else if at.ticks == 0
            && code == Code::BusFailed
            && attempts < ATTEMPTS
            && !shared.is_done[SERVER].get()
        {
            // Before the start, each tick tries again to join.
            attempts += 1;
            shared.is_retried.set(true);
        } else {
            shared.check(at.judge_end(code));
            shared.note(format!("{}: {}", NAMES[end], at.driver.link().reason));
            let ticks = at.ticks;
            shared.told[end].set(Some(Told { ticks, code }));
            break;
        }
        scheduler::sleep(Nanos(random.within(0, 3_000_000)));
    }
    at.driver.close();
}

impl<'a> End<'a> {
    fn open(shared: &'a Shared, end: usize) -> Self {
        let course = &shared.course;
        let config = Config::parse("driver.cfg", &course.driver_cfg(end), &crate::kinds::KINDS)
            .unwrap_or_else(|why| panic!("a run that tickbus refuses:\n{why}"));
        let driver = Driver::open(config, SimulatedClock::shared())
            .unwrap_or_else(|why| panic!("a driver that does not open: {why}"));
        let places = |area: char| -> Vec<Places> {
            let signals = &driver.config().table.signals;
            let place = |name: String| {
                let place = signals.iter().position(|signal| signal.name == name);
                place.expect("it is in the file")
            };
            let of_station = |station: u64| {
                let pulse = place(format!("pulse{area}{station}"));
                Places {
                    stamp: place(format!("stamp{area}{station}")),
                    pulse,
                    edges: driver.slots().edges[pulse],
                    level: place(format!("level{area}{station}")),
                }
            };
            (0..course.stations).map(of_station).collect()
        };
        Self {
            shared,
            which: end,
            slots: driver.initial_slots(),
            writes: places(['I', 'Q'][end]),
            reads: places(['Q', 'I'][end]),
            driver,
            ticks: 0,
        }
    }

    fn tick(&mut self) -> Exchange {
        if self.shared.course.ends[self.which].halves {
            let found = self.driver.receive(None, &mut self.slots);
            self.write();
            self.driver.send(&mut self.slots);
            found
        } else {
            self.write();
            self.driver.exchange(None, &mut self.slots)
        }
    }

    fn write(&mut self) {
        let tick = self.ticks + 1;
        for (station, places) in (0..).zip(&self.writes) {
            let stamp = stamp(self.which, station, tick);
            self.slots[places.stamp] = Slot::from_unsigned(stamp);
            self.slots[places.pulse] = Slot::from_real(f64::from(is_pulse(tick)));
            self.slots[places.level] = Slot::from_real(f64::from(level(stamp)));
        }
    }

    fn shown(&self, places: &Places) -> (u64, f64) {
        (
            self.slots[places.stamp].unsigned(),
            self.slots[places.level].real(),
        )
    }

    /// Judges a tick of the run: it shows the tick of its peer that docs/sdsp.md promises, and the edges since the
    /// previous tick.
    fn judge(&self, found: Exchange) -> Result<(), Broken> {
        let Self {
            shared,
            which: end,
            ticks,
            ..
        } = *self;
        let (course, name) = (&shared.course, NAMES[end]);
        let expected = course.expected(end, ticks);
        let before = if ticks > 1 {
            course.expected(end, ticks - 1)
        } else {
            0
        };
        let edges = u8::from(is_pulse(expected) && expected != before);
        // An end with longer steps misses values that its peer writes between two of them.
        let counts = course.ends[end].multiple <= course.ends[1 - end].multiple;
        for (station, places) in (0..).zip(&self.reads) {
            let stamp = stamp(1 - end, station, expected);
            let right = (stamp, f64::from(level(stamp)));
            let shown = self.shown(places);
            if shown != right && !(expected == 0 && shared.is_retried.get()) {
                broken(
                    "lock-step",
                    format!(
                        "tick {ticks} of \"{name}\" shows {shown:?} of station {station}, and not tick {expected} of its peer"
                    ),
                )?;
            }
            let seen = places.edges.map_or(0.0, |place| self.slots[place].real());
            if counts && seen.total_cmp(&f64::from(edges)).is_ne() && !shared.is_retried.get() {
                broken(
                    "pulses",
                    format!(
                        "tick {ticks} of \"{name}\" has {seen} edges of station {station}, and not {edges}"
                    ),
                )?;
            }
        }
        if found.age != Nanos::ZERO || found.sequence != ticks {
            broken(
                "fresh",
                format!(
                    "tick {ticks} has age {} and sequence {}",
                    found.age, found.sequence
                ),
            )?;
        }
        Ok(())
    }

    /// Judges that ticks after the end of the run show fail-safe values and keep returning the same code.
    fn judge_end(&mut self, code: Code) -> Result<(), Broken> {
        let mut reads = self.reads.iter();
        let is_safe = reads.all(|places| self.shown(places) == (FAIL_SAFE, 0.0));
        let again = self.driver.exchange(None, &mut self.slots).code;
        if !is_safe || again != code || !matches!(code, Code::Stale | Code::BusFailed) {
            broken(
                "end",
                format!(
                    "behind the end, \"{}\" has {code} and then {again}; fail-safe values are shown: {is_safe}",
                    NAMES[self.which]
                ),
            )?;
        }
        Ok(())
    }
}

/// The stamp that an end writes in a tick; before the first one, variables are 0.
fn stamp(end: usize, station: u64, tick: u64) -> u64 {
    match tick {
        0 => 0,
        _ => Stamp {
            life: 1,
            area: end as u64,
            station,
            tick,
        }
        .number(),
    }
}
