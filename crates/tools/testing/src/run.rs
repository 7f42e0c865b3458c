//! Running one test.

use std::path::Path;
use std::sync::Arc;

use tickbus_base::time::{Manual, Nanos};
use tickbus_driver::{Code, Driver, DriverError};
use tickbus_driver_cfg::Config;
use tickbus_fmi::foreign::{Machine, Stepped};
use tickbus_image::signal::{Signal, Slot};
use tickbus_record as record;
use tickbus_reply::Condition;

use super::edges::Bookmark;
use super::failure::{Failure, Halt};
use super::machine::Stub;
use super::observer::Observer;
use super::playback::{Difference, MachineRecording, Playback};
use super::suite::Suite;
use super::test::{Passage, Step, Test, TextPosition, Unswallowed};
use super::unswallowed::First;
use super::watch::{Watch, moment, real, span, text_of};

/// The result of one test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ran {
    /// Ticks that have passed.
    pub ticks: u64,
    /// Simulation time that has passed.
    pub time: Nanos,
    /// The failure, if the test failed.
    pub failure: Option<Failure>,
    /// The driver's statistics at the end; empty of a run in a sweep.
    pub statistics: String,
}

impl Ran {
    /// The simulation time that has passed, in seconds.
    #[expect(clippy::cast_precision_loss, reason = "for people")]
    pub fn seconds(&self) -> f64 {
        self.time.0 as f64 / 1e9
    }
}

impl Suite {
    /// Runs one of the file's tests from the start; with a path, records the run to that file.
    ///
    /// # Errors
    ///
    /// The PLC program and the driver.cfg do not fit, or a recording cannot be read or written.
    pub fn run(&self, test: &Test, record: Option<&Path>) -> Result<Ran, DriverError> {
        let begin = (&test.initial[..], test.place);
        self.play(begin, record, None, |stand| {
            if test.steps.iter().any(Step::counts_swallowed) {
                stand.swallowed = First::of(stand.signals.len());
            }
            test.steps.iter().try_for_each(|step| stand.run(step))
        })
    }

    /// Runs `play` on a new stand, with these values from the beginning, under the eyes of an observer.
    pub(super) fn play<'a>(
        &'a self,
        (initial, place): (&[(usize, Slot)], TextPosition),
        record: Option<&Path>,
        observer: Option<&'a mut dyn Observer>,
        play: impl FnOnce(&mut Stand<'a>) -> Result<(), Halt>,
    ) -> Result<Ran, DriverError> {
        let bench = &self.bench;
        let mut config = Config::clone(&bench.config);
        // A recording configured in the driver.cfg is for the plant, not for tests.
        config.record = record
            .map(record::Options::to)
            .transpose()
            .map_err(|mistake| DriverError::Record(mistake.to_string()))?;
        let table = &bench.config.table;
        let playback = bench.tape.as_ref().map(|tape| Playback::start(tape, table));
        let playback = playback.transpose()?;
        // A stepped bus uses only simulation time.
        let mut driver = Driver::open(config, Manual::new())?;
        let mut slots = driver.initial_slots();
        for (signal, value) in bench.initial.iter().chain(initial) {
            slots[*signal] = *value;
            driver.borrow_reply(*signal, true);
        }
        let signals = &bench.config.table.signals;
        let fmu = bench.fmu.as_ref();
        let started = fmu.map(|fmu| fmu.start(table, &mut driver, &mut slots));
        let started = started.transpose();
        let watch = |(signal, slot): (&Signal, &Slot)| Watch::new(*slot, signal);
        let watches: Vec<Watch> = signals.iter().zip(&slots).map(watch).collect();
        let mut stand = Stand {
            stub: Stub::new(&bench.rules, &watches),
            playback,
            tape: bench.tape.as_ref(),
            fmu: None,
            driver,
            signals,
            slots,
            watches,
            step: bench.step,
            ticks: 0,
            forced: Vec::new(),
            faults: Vec::new(),
            standing: Vec::new(),
            swallowed: First::default(),
            standing_unswallowed: Vec::new(),
            observer,
        };
        let failure = match started {
            Ok(started) => {
                stand.fmu = started;
                match stand.look().and_then(|()| play(&mut stand)) {
                    Err(Halt::Failed(failure)) => Some(failure),
                    Ok(()) | Err(Halt::Over) => None,
                }
            }
            Err(why) => {
                let place = fmu.map_or(place, |fmu| fmu.place);
                Some(stand.broken(place, &why))
            }
        };
        let failure = failure.or_else(|| {
            let ended = stand.fmu.take()?.end();
            ended.err().map(|why| stand.broken(place, &why.to_string()))
        });
        if let Some(counted) = &bench.counted {
            counted.add(&stand.slots);
        }
        let ran = Ran {
            ticks: stand.ticks,
            time: stand.time(),
            failure,
            statistics: match stand.observer {
                None => stand.driver.statistics(),
                Some(_) => String::new(),
            },
        };
        stand.driver.close();
        Ok(ran)
    }
}

/// A condition, and the edge counts at which it started.
#[derive(Clone, Debug)]
struct Watched {
    condition: Condition,
    place: TextPosition,
    since: Bookmark,
}

/// A condition that must hold, or must not hold, at every tick.
#[derive(Clone, Debug)]
struct Standing {
    watched: Watched,
    never: bool,
    from: u64,
    /// That of its step.
    hint: Option<Arc<str>>,
}

/// The state of a running test.
pub(super) struct Stand<'a> {
    driver: Driver,
    signals: &'a [Signal],
    slots: Vec<Slot>,
    watches: Vec<Watch>,
    stub: Stub<'a>,
    playback: Option<Playback<'a>>,
    tape: Option<&'a MachineRecording>,
    fmu: Option<Machine>,
    step: Nanos,
    ticks: u64,
    forced: Vec<(usize, Slot)>,
    /// Injected faults and their numbers.
    faults: Vec<(String, u32)>,
    standing: Vec<Standing>,
    /// When changes were swallowed first, if the test asks for that.
    swallowed: First,
    standing_unswallowed: Vec<Unswallowed>,
    observer: Option<&'a mut dyn Observer>,
}

impl Stand<'_> {
    fn time(&self) -> Nanos {
        self.step
            .times(i64::try_from(self.ticks).unwrap_or(i64::MAX))
    }

    /// True if the conditions of the steps count. Under a fault only the actions of the steps take place.
    fn is_strict(&self) -> bool {
        self.observer
            .as_ref()
            .is_none_or(|observer| observer.is_strict())
    }

    /// Shows the present values to the observer.
    fn look(&mut self) -> Result<(), Halt> {
        match &mut self.observer {
            None => Ok(()),
            Some(observer) => observer.look(self.ticks, &self.watches, &self.slots),
        }
    }

    /// Lets ticks pass after the last step, until the observer ends the run; what the steps wanted to hold from then
    /// on does not count any more.
    pub(super) fn idle(&mut self, place: TextPosition) -> Result<(), Halt> {
        self.standing.clear();
        self.standing_unswallowed.clear();
        if let Some(observer) = &mut self.observer {
            observer.idle(self.ticks);
        }
        loop {
            self.look()?;
            self.tick(place)?;
        }
    }

    pub(super) fn run(&mut self, step: &Step) -> Result<(), Halt> {
        let ran = self.run_step(step);
        ran.map_err(|halt| halt.hinted(step.hint.as_deref()))
    }

    fn run_step(&mut self, step: &Step) -> Result<(), Halt> {
        let strict = self.is_strict();
        for (signal, value) in &step.set {
            self.slots[*signal] = *value;
            self.driver.borrow_reply(*signal, true);
        }
        for (signal, value) in &step.force {
            self.force(*signal, *value);
        }
        for signal in &step.release {
            self.release(*signal);
        }
        for (fault, place) in &step.inject {
            let id = self
                .driver
                .inject(fault)
                .map_err(|mistake| self.broken(*place, &mistake.to_string()))?;
            self.faults.retain(|(name, _)| *name != fault.name);
            self.faults.push((fault.name.clone(), id));
        }
        for (name, place) in &step.end {
            let ended = self.faults.iter().find(|(known, _)| known == name);
            let Some((_, id)) = ended else {
                let what = format!("no fault \"{name}\" was injected");
                return Err(self.broken(*place, &what).into());
            };
            self.driver.end_fault(*id);
        }
        for (conditions, never) in [(&step.always, false), (&step.never, true)] {
            for watched in self.watched(conditions).into_iter().filter(|_| strict) {
                let standing = Standing {
                    watched,
                    never,
                    from: self.ticks,
                    hint: step.hint.clone(),
                };
                self.check_standing(&standing)?;
                self.standing.push(standing);
            }
        }
        if strict {
            self.check_unswallowed(&step.always_unswallowed)?;
            let always = step.always_unswallowed.iter().cloned();
            self.standing_unswallowed.extend(always);
        }
        match &step.passage {
            None => {}
            Some(Passage::Ticks(count)) => self.pass(*count, step.place)?,
            Some(Passage::Press(button, count)) => {
                self.force(*button, Slot::from_real(1.0));
                self.pass(*count, step.place)?;
                self.release(*button);
                self.slots[*button] = Slot::from_real(0.0);
            }
            Some(Passage::Await(conditions, limit)) => self.wait(conditions, *limit, step.place)?,
        }
        let mut expected = self.watched(&step.expect);
        expected.retain(|_| strict);
        let row = step.row.map(|row| format!(" in row {row} of the table"));
        let row = row.unwrap_or_default();
        self.expect(&expected, &row)?;
        let unswallowed = if strict { &step.unswallowed[..] } else { &[] };
        self.check_unswallowed(unswallowed)?;
        if step.during > 0 {
            let from = self.ticks;
            let lasts = span(step.during, self.step);
            let when = format!(" for {lasts} from tick {from}{row}");
            for _ in 0..step.during {
                self.tick(step.place)?;
                self.expect(&expected, &when)?;
                self.check_unswallowed(unswallowed)?;
            }
        }
        Ok(())
    }

    fn force(&mut self, signal: usize, value: Slot) {
        self.forced.retain(|(other, _)| *other != signal);
        self.forced.push((signal, value));
        self.slots[signal] = value;
        self.driver.borrow_reply(signal, true);
    }

    fn release(&mut self, signal: usize) {
        self.forced.retain(|(other, _)| *other != signal);
        self.driver.borrow_reply(signal, false);
    }

    fn pass(&mut self, count: u64, place: TextPosition) -> Result<(), Halt> {
        (0..count).try_for_each(|_| self.tick(place))
    }

    /// One tick: the machine moves, then the PLC is scanned if due.
    fn tick(&mut self, place: TextPosition) -> Result<(), Halt> {
        let now = self.time() + self.step;
        if let Some(fmu) = &mut self.fmu {
            match fmu.step(now - self.step, self.step, &mut self.slots) {
                Ok(Stepped::Done) => {}
                Ok(Stepped::Ended) => {
                    let what = "the FMU has ended its simulation; let the test end before";
                    return Err(self.broken(place, what).into());
                }
                Err(why) => return Err(self.broken(place, &why.to_string()).into()),
            }
        }
        if let Some(playback) = &mut self.playback
            && let Err(error) = playback.step(now, &mut self.slots)
        {
            return Err(self
                .broken(place, &format!("the recording: {error}"))
                .into());
        }
        self.stub
            .step(now, self.step, &self.watches, &mut self.slots);
        for (signal, value) in &self.forced {
            self.slots[*signal] = *value;
        }
        if let Some(observer) = &mut self.observer
            && let Err(mistake) = observer.before(self.ticks, &mut self.driver, &mut self.slots)
        {
            return Err(self.broken(place, &mistake.to_string()).into());
        }
        let done = self.driver.exchange(now, &mut self.slots);
        if let Some(observer) = &mut self.observer {
            observer.after(&mut self.slots);
        }
        if let Some(fmu) = &mut self.fmu
            && let Err(why) = fmu.take_faults(&mut self.driver)
        {
            return Err(self.broken(place, &why.to_string()).into());
        }
        self.ticks += 1;
        if done.code == Code::BusFailed {
            let reason = self.driver.link().reason;
            return Err(self
                .broken(place, &format!("the line failed: {reason}"))
                .into());
        }
        let seen = self.slots.iter().zip(self.signals);
        for (watch, (slot, signal)) in self.watches.iter_mut().zip(seen) {
            watch.look(*slot, signal, self.ticks);
        }
        self.swallowed.look(&self.driver, self.ticks);
        if self.is_strict() {
            self.check_recorded()?;
        }
        for standing in &self.standing {
            self.check_standing(standing)?;
        }
        self.check_unswallowed(&self.standing_unswallowed)?;
        self.look()
    }

    /// Fails if the PLC sends something other than recorded.
    fn check_recorded(&self) -> Result<(), Failure> {
        let (Some(playback), Some(tape)) = (&self.playback, self.tape) else {
            return Ok(());
        };
        let Some(difference) = playback.difference(&self.slots, self.signals) else {
            return Ok(());
        };
        let Difference {
            signal: index,
            expected,
            tick,
        } = difference;
        let signal = &self.signals[index];
        let expected = text_of(real(expected, signal), signal);
        Err(Failure {
            place: tape.place,
            what: format!(
                "{}: \"{}\" is {}, expected {expected} as in tick {tick} of {}",
                moment(self.ticks, self.step),
                signal.name,
                text_of(self.value(index), signal),
                tape.name(),
            ),
            more: vec![self.watches[index].history(signal, self.step)],
            hint: None,
        })
    }

    fn broken(&self, place: TextPosition, what: &str) -> Failure {
        Failure {
            place,
            what: format!("{}: {what}", moment(self.ticks, self.step)),
            more: Vec::new(),
            hint: None,
        }
    }

    fn wait(
        &mut self,
        conditions: &[(Condition, TextPosition)],
        limit: u64,
        place: TextPosition,
    ) -> Result<(), Halt> {
        let awaited = self.watched(conditions);
        let (from, strict) = (self.ticks, self.is_strict());
        while !awaited.iter().all(|one| self.holds(one)) {
            if strict && self.ticks - from == limit {
                let when = format!(" within {} of tick {from}", span(limit, self.step));
                return Ok(self.expect(&awaited, &when)?);
            }
            self.tick(place)?;
        }
        Ok(())
    }

    fn watched(&self, conditions: &[(Condition, TextPosition)]) -> Vec<Watched> {
        let watched = |(condition, place): &(Condition, TextPosition)| Watched {
            condition: condition.clone(),
            place: *place,
            since: Bookmark::of(&self.watches[condition.signal]),
        };
        conditions.iter().map(watched).collect()
    }

    fn value(&self, signal: usize) -> f64 {
        self.watches[signal].value()
    }

    fn holds(&self, one: &Watched) -> bool {
        let watch = &self.watches[one.condition.signal];
        one.since.finds(&one.condition, watch, &self.slots)
    }

    /// Fails with the first condition that does not hold.
    fn expect(&self, expected: &[Watched], when: &str) -> Result<(), Failure> {
        match expected.iter().find(|one| !self.holds(one)) {
            None => Ok(()),
            Some(one) => Err(self.failure(one, &format!("{}{when}", one.condition.demand))),
        }
    }

    fn check_standing(&self, standing: &Standing) -> Result<(), Failure> {
        let Standing {
            watched,
            never,
            from,
            hint,
        } = standing;
        // A required edge is awaited, since an edge cannot occur at every tick.
        if self.holds(watched) != *never {
            return Ok(());
        }
        let demand = &watched.condition.demand;
        let expected = if *never {
            format!("never {demand} since tick {from}")
        } else {
            format!("{demand} at every tick since tick {from}")
        };
        Err(self.failure(watched, &expected).hinted(hint.as_deref()))
    }

    /// Fails with the first of these expectations that was disappointed, and with all its signals.
    fn check_unswallowed(&self, expected: &[Unswallowed]) -> Result<(), Failure> {
        for Unswallowed { signals, place } in expected {
            let found = self.swallowed.lines(signals, &self.driver, self.step);
            let mut lines = found.into_iter();
            let Some((signal, line)) = lines.next() else {
                continue;
            };
            let now = moment(self.ticks, self.step);
            let mut more: Vec<String> = lines.map(|(_, line)| line).collect();
            more.push(self.watches[signal].history(&self.signals[signal], self.step));
            return Err(Failure {
                place: *place,
                what: format!("{now}: expected nothing swallowed: {line}"),
                more,
                hint: None,
            });
        }
        Ok(())
    }

    fn failure(&self, one: &Watched, expected: &str) -> Failure {
        let index = one.condition.signal;
        let signal = &self.signals[index];
        Failure {
            place: one.place,
            what: format!(
                "{}: \"{}\" is {}, expected {expected}",
                moment(self.ticks, self.step),
                signal.name,
                text_of(self.value(index), signal),
            ),
            more: vec![self.watches[index].history(signal, self.step)],
            hint: None,
        }
    }
}
