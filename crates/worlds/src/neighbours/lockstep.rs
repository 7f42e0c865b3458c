//! A run on virtual time: a server, and a machine and a PLC that tick in lock-step, each a process of its own, against docs/sdsp.md.
//!
//! What a tick shows is known to the last bit, whatever the threads, the network and the misfortunes do. Some of these end the run;
//! then everyone is told, and nobody goes on.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use tickbus_base::time::{Clock as _, Nanos};
use tickbus_driver::{Code, Driver};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::tcp::Address;
use tickbus_image::signal::Slot;
use tickbus_virtual_time::server::Control;
use tickbus_virtual_time::tcp::Listener;
use tickbus_virtual_time::{Controls, Ended, Hosting, Logic, Outcome, Settings, StartCondition};

use crate::broken::{Broken, broken};
use crate::clock::SimulatedClock;
use crate::config::PORT;
use crate::network::Conditions;
use crate::plan::FAIL_SAFE;
use crate::random::{Random, scramble};
use crate::scheduler::{self, Habits};
use crate::seed::Seed;
use crate::stamp::{Stamp, level};

/// The server, where the ends are 0, the machine, and 1, the PLC.
const SERVER: usize = 2;

/// The names of the clients.
const NAMES: [&str; 2] = ["cell", "cell PLC"];

/// The server's step.
const STEP: Nanos = Nanos::from_millis(1);

/// The longest misfortune: three of them are shorter than what a client and the server wait for each other.
const LONGEST: Nanos = Nanos::from_secs(1);

/// A run, or its end, reaches everyone within this: the last time to wait for a client is 10 s, and for the server 5 s.
const PATIENCE: Nanos = Nanos::from_secs(40);

/// So many attempts has an end that does not get into the run.
const ATTEMPTS: u32 = 20;

/// What befalls a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    Suspend(usize, Nanos),
    Pause(usize, Nanos),
    Hold(Nanos),
    /// These end a run: connections break, a client or the server is killed, a client closes, the server is stopped.
    Reset,
    Kill(usize),
    Close(usize),
    Stop,
}

/// One of both ends.
#[derive(Clone, Copy, Debug)]
struct EndCourse {
    /// It has a step in so many of the server's.
    multiple: u64,
    halves: bool,
}

/// A whole run, drawn from its seed.
#[derive(Clone, Debug)]
struct Course {
    steps: u64,
    stations: u64,
    ends: [EndCourse; 2],
    habits: Habits,
    conditions: Conditions,
    events: Vec<(Nanos, What)>,
}

impl Course {
    fn draw(seed: Seed) -> Self {
        let random = &mut Random::new(scramble(seed.number ^ 0x7374_6570));
        let has = random.number() & seed.features;
        let is = |bit: u32| has >> bit & 1 == 1;
        let ends = [0, 2].map(|bit| {
            let multiple = random.below(3) + 1;
            EndCourse {
                multiple: if is(bit) { multiple } else { 1 },
                halves: is(bit + 1),
            }
        });
        let (preempts, late) = (random.of(&[8, 40]), random.of(&[100_000, 2_000_000]));
        let habits = Habits {
            preempts: if is(4) { preempts } else { 0 },
            late: if is(5) { late } else { 0 },
            starves: if is(4) && is(6) { 60_000_000 } else { 0 },
        };
        let (splits, capacity) = (random.of(&[2, 10]), random.of(&[16, 100]));
        let conditions = Conditions {
            latency: (1_000, random.of(&[20_000, 200_000, 3_000_000])),
            splits: if is(7) { splits } else { 0 },
            capacity: if is(8) { capacity } else { 64 * 1024 },
        };
        let steps = random.below(40) + 10;
        let mut events = Vec::new();
        for index in 0..3 {
            let at = Nanos(random.within(0, 100_000_000));
            let span = Nanos(random.within(1_000_000, LONGEST.0));
            let who = usize::try_from(random.below(3)).expect("small");
            let end = who % 2;
            let what = match random.below(7) {
                0 => What::Suspend(who, span),
                1 => What::Pause(end, span),
                2 => What::Hold(span),
                3 if is(10) => What::Reset,
                4 if is(11) => What::Kill(who),
                5 if is(12) => What::Close(end),
                6 if is(13) => What::Stop,
                _ => continue,
            };
            if is(9) && seed.events >> index & 1 == 1 {
                events.push((at, what));
            }
        }
        events.sort_by_key(|event| event.0);
        Self {
            steps,
            stations: if is(14) { 2 } else { 1 },
            ends,
            habits,
            conditions,
            events,
        }
    }

    /// The same run without anything that could change it.
    fn quiet(&self) -> Self {
        Self {
            habits: Habits::default(),
            events: Vec::new(),
            ..self.clone()
        }
    }

    fn has(&self, test: impl Fn(What) -> bool) -> bool {
        self.events.iter().any(|event| test(event.1))
    }

    /// How many steps an end has in a run of so many.
    fn ticks(&self, end: usize, steps: u64) -> u64 {
        steps.div_ceil(self.ends[end].multiple)
    }

    /// Which tick of its peer an end sees in one of its own; 0 for the values from before the first.
    fn expected(&self, end: usize, tick: u64) -> u64 {
        // What is written in a step is read in the next one.
        let step = 1 + (tick - 1) * self.ends[end].multiple;
        let answers = self.ticks(1 - end, step - 1);
        // An exchange hands in its values before it gets a step, and a half afterwards.
        answers + u64::from(!self.ends[1 - end].halves)
    }

    fn driver_cfg(&self, end: usize) -> String {
        let role = ["device", "controller"][end];
        let multiple = self.ends[end].multiple;
        let mut text = format!(
            "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nrole = \"{role}\"\nkind = \"sdsp\"\n\
             address = \"127.0.0.1:{PORT}\"\nmultiple = {multiple}\ntimeout = \"5s\"\n"
        );
        for station in 0..self.stations {
            text += &format!("[[station]]\nname = \"s{station}\"\n");
        }
        for station in 0..self.stations {
            for area in ['Q', 'I'] {
                let mut signal = |name: &str, place: &str, rest: &str| {
                    text += &format!(
                        "[[signal]]\nname = \"{name}{area}{station}\"\naddress = \"%{area}{place}\"\n{rest}\nstation = \"s{station}\"\n"
                    );
                };
                signal(
                    "stamp",
                    "L0",
                    &format!("type = \"LWORD\"\nfail_safe = {FAIL_SAFE}"),
                );
                signal("pulse", "X8.0", "latch = \"rising\"");
                signal("level", "X8.1", "");
            }
        }
        text
    }
}

/// Whether a pulse is written in a tick.
const fn is_pulse(tick: u64) -> bool {
    tick % 3 == 2
}

/// How it went for an end that is still there.
#[derive(Clone, Copy, Debug)]
struct Told {
    ticks: u64,
    code: Code,
}

struct Shared {
    course: Course,
    processes: [Cell<usize>; 3],
    /// What a simulation is to do before its next tick.
    orders: [Cell<Option<What>>; 2],
    /// Was killed or closed.
    is_gone: [Cell<bool>; 3],
    is_done: [Cell<bool>; 3],
    /// An end has tried to get into the run more than once.
    is_retried: Cell<bool>,
    told: [Cell<Option<Told>>; 2],
    outcome: RefCell<Option<Result<Outcome, Ended>>>,
    controls: Controls,
    broken: RefCell<Option<Broken>>,
    trace: RefCell<Vec<String>>,
}

impl Shared {
    fn note(&self, what: String) {
        log::trace!("{what}");
        self.trace.borrow_mut().push(what);
    }

    fn fail(&self, broken: Broken) {
        self.broken.borrow_mut().get_or_insert(broken);
        scheduler::stop();
    }
}

/// Lets a run happen, and, if nothing has ended it, the same once more without what must not change it.
pub(super) fn run(seed: Seed, trace: &mut Vec<String>) -> Result<(), Broken> {
    let course = Course::draw(seed);
    trace.push(format!("{course:?}"));
    let stormy = happen(&course, scramble(seed.number ^ 1), trace)?;
    let Some(Ok(stormy)) = stormy.filter(|_| !course.has(is_end)) else {
        return Ok(());
    };
    let quiet = happen(&course.quiet(), scramble(seed.number ^ 2), trace)?;
    if quiet != Some(Ok(stormy)) {
        return broken(
            "equal runs",
            format!("one came to {stormy:?}, the other to {quiet:?}"),
        );
    }
    Ok(())
}

/// Whether it ends a run.
fn is_end(what: What) -> bool {
    !matches!(what, What::Suspend(..) | What::Pause(..) | What::Hold(_))
}

/// How the run ended; `None` if ends needed several attempts, so that it may have had other initial values.
fn happen(
    course: &Course,
    chance: u64,
    trace: &mut Vec<String>,
) -> Result<Option<Result<Outcome, Ended>>, Broken> {
    let shared = Rc::new(Shared {
        course: course.clone(),
        processes: Default::default(),
        orders: Default::default(),
        is_gone: Default::default(),
        is_done: Default::default(),
        is_retried: Cell::new(false),
        told: Default::default(),
        outcome: RefCell::default(),
        controls: Controls::default(),
        broken: RefCell::default(),
        trace: RefCell::default(),
    });
    let result = scheduler::run(chance, course.habits, {
        let shared = Rc::clone(&shared);
        move || fate(&shared)
    });
    trace.append(&mut shared.trace.borrow_mut());
    if let Some(broken) = shared.broken.borrow_mut().take() {
        return Err(broken);
    }
    if let Err(stuck) = result {
        return broken("end", format!("{stuck:?}"));
    }
    judge_end(&shared)?;
    let outcome = shared.outcome.borrow_mut().take();
    Ok(outcome.filter(|_| !shared.is_retried.get()))
}

/// Starts everyone, lets the misfortunes happen, and waits for the end.
fn fate(shared: &Rc<Shared>) {
    let course = &shared.course;
    scheduler::network(|network, _, _| network.conditions = course.conditions);
    let began = scheduler::now();
    for who in 0..3 {
        let process = scheduler::new_process();
        shared.processes[who].set(process);
        let shared = Rc::clone(shared);
        scheduler::spawn(process, move || {
            match who {
                SERVER => serve(&shared),
                end => live(&shared, end),
            }
            shared.is_done[who].set(true);
        });
    }
    for (at, what) in &course.events {
        scheduler::sleep(began + *at - scheduler::now());
        befall(shared, *what);
    }
    if !await_all(shared) {
        // Who waits for a client that is gone does so for any time; whoever can be told is told.
        if course.has(is_end) {
            shared.controls.send(Control::Stop);
        }
        if !await_all(shared) {
            let done = shared.is_done.each_ref().map(Cell::get);
            shared.fail(Broken {
                promise: "liveness",
                what: format!("the run has not ended: machine, PLC, server are done: {done:?}"),
            });
        }
    }
}

/// Whether all are done within the time that this may take.
fn await_all(shared: &Shared) -> bool {
    let limit = scheduler::now() + PATIENCE;
    let is_over = || shared.is_done.iter().all(Cell::get);
    scheduler::sleep_until(|| is_over() || scheduler::now() > limit);
    is_over()
}

fn befall(shared: &Shared, what: What) {
    shared.note(format!("{} {what:?}", scheduler::now().0));
    match what {
        What::Suspend(who, span) => {
            scheduler::suspend_process(shared.processes[who].get(), span);
        }
        What::Hold(span) => scheduler::network(|network, _, now| network.hold_all(now, span.0)),
        What::Reset => scheduler::network(|network, _, now| network.reset_all(now)),
        What::Kill(who) => {
            shared.is_gone[who].set(true);
            let process = shared.processes[who].get();
            scheduler::network(|network, _, now| network.kill(process, now));
            if who == SERVER {
                // Its thread ends; nobody hears that.
                shared.controls.send(Control::Stop);
            }
        }
        What::Stop => shared.controls.send(Control::Stop),
        What::Pause(end, _) | What::Close(end) => shared.orders[end].set(Some(what)),
    }
}

fn serve(shared: &Shared) {
    let clock = SimulatedClock;
    let listener = Listener::bind_in(&Address::local(PORT), clock.simulation());
    let listener = listener.expect("nobody else listens there");
    let settings = Settings {
        steps: Some(shared.course.steps),
        ..Settings::new(STEP, StartCondition::Count(2))
    };
    let hosting = Hosting {
        clock: &clock,
        controls: &shared.controls,
        news: &mut |news| shared.note(format!("server: {news}")),
    };
    let outcome = listener.run(settings, Logic::new(), hosting);
    if !shared.is_gone[SERVER].get() {
        shared.note(format!("server: {outcome:?}"));
        *shared.outcome.borrow_mut() = Some(outcome);
    }
}

/// The slots of a station in one direction.
struct Places {
    stamp: usize,
    pulse: usize,
    edges: Option<usize>,
    level: usize,
}

/// One end, tick by tick.
fn live(shared: &Shared, end: usize) {
    let course = &shared.course;
    let config = Config::parse("driver.cfg", &course.driver_cfg(end))
        .unwrap_or_else(|why| panic!("a run that tickbus refuses:\n{why}"));
    let mut driver = Driver::open(config, SimulatedClock::shared())
        .unwrap_or_else(|why| panic!("a driver that does not open: {why}"));
    let mut slots = driver.initial_slots();
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
    let (writes, reads) = (places(['I', 'Q'][end]), places(['Q', 'I'][end]));
    let write = |slots: &mut [Slot], tick: u64| {
        for (station, places) in (0..).zip(&writes) {
            let stamp = stamp(end, station, tick);
            slots[places.stamp] = Slot::from_unsigned(stamp);
            slots[places.pulse] = Slot::from_real(f64::from(is_pulse(tick)));
            slots[places.level] = Slot::from_real(f64::from(level(stamp)));
        }
    };
    let mut random = Random::new(scramble(end as u64 ^ course.steps));
    let (mut ticks, mut attempts) = (0, 0);
    loop {
        match shared.orders[end].take() {
            Some(What::Pause(_, span)) => scheduler::sleep(span),
            Some(_) => {
                shared.is_gone[end].set(true);
                break driver.close();
            }
            None => {}
        }
        let found = if course.ends[end].halves {
            let found = driver.receive(None, &mut slots);
            write(&mut slots, ticks + 1);
            driver.send(&mut slots);
            found
        } else {
            write(&mut slots, ticks + 1);
            driver.exchange(None, &mut slots)
        };
        if shared.is_gone[end].get() {
            // What a process that was killed finds, nobody sees.
            break driver.close();
        }
        let (now, code) = (scheduler::now().0, found.code);
        shared.note(format!(
            "{now} {} tick {} {} sequence {}",
            NAMES[end],
            ticks + 1,
            code.name(),
            found.sequence
        ));
        let shown = |places: &Places| (slots[places.stamp].unsigned(), slots[places.level].real());
        if code == Code::Fresh {
            ticks += 1;
            let expected = course.expected(end, ticks);
            let before = if ticks > 1 {
                course.expected(end, ticks - 1)
            } else {
                0
            };
            // A reader with longer steps may miss what was written between two of them.
            let edges = u8::from(is_pulse(expected) && expected != before);
            let counts = course.ends[end].multiple <= course.ends[1 - end].multiple;
            for (station, places) in (0..).zip(&reads) {
                let stamp = stamp(1 - end, station, expected);
                let right = (stamp, f64::from(level(stamp)));
                let seen = places.edges.map_or(0.0, |place| slots[place].real());
                if shown(places) != right && !(expected == 0 && shared.is_retried.get()) {
                    let what = format!(
                        "tick {ticks} of \"{}\" shows {:?} of station {station}, and not tick {expected} of its peer",
                        NAMES[end],
                        shown(places)
                    );
                    return shared.fail(Broken {
                        promise: "lock-step",
                        what,
                    });
                }
                if counts && seen.total_cmp(&f64::from(edges)).is_ne() && !shared.is_retried.get() {
                    let what = format!(
                        "tick {ticks} of \"{}\" has {seen} edges of station {station}, and not {edges}",
                        NAMES[end]
                    );
                    return shared.fail(Broken {
                        promise: "pulses",
                        what,
                    });
                }
            }
            if found.age != Nanos::ZERO || found.sequence != ticks {
                let what = format!(
                    "tick {ticks} has age {} and sequence {}",
                    found.age, found.sequence
                );
                return shared.fail(Broken {
                    promise: "fresh",
                    what,
                });
            }
        } else if ticks == 0
            && code == Code::BusFailed
            && attempts < ATTEMPTS
            && !shared.is_done[SERVER].get()
        {
            // Before the start, each tick tries again.
            attempts += 1;
            shared.is_retried.set(true);
        } else {
            let is_safe = reads.iter().all(|places| shown(places) == (FAIL_SAFE, 0.0));
            let again = driver.exchange(None, &mut slots).code;
            if !is_safe || again != code || !matches!(code, Code::Stale | Code::BusFailed) {
                let what = format!(
                    "behind the end, \"{}\" has {code} and then {again}; fail-safe values are shown: {is_safe}",
                    NAMES[end]
                );
                return shared.fail(Broken {
                    promise: "end",
                    what,
                });
            }
            shared.note(format!("{}: {}", NAMES[end], driver.link().reason));
            shared.told[end].set(Some(Told { ticks, code }));
            break driver.close();
        }
        scheduler::sleep(Nanos(random.within(0, 3_000_000)));
    }
}

/// What an end writes in a tick; before the first one, variables are 0.
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

/// Everyone was told the same end.
fn judge_end(shared: &Shared) -> Result<(), Broken> {
    let course = &shared.course;
    let outcome = shared.outcome.borrow();
    let Some(outcome) = outcome.as_ref() else {
        // A server that was killed has told nobody anything.
        return Ok(());
    };
    if !course.has(is_end)
        && !outcome
            .as_ref()
            .is_ok_and(|outcome| outcome.steps == course.steps)
    {
        return broken(
            "end",
            format!("nothing ends this run, and it came to {outcome:?}"),
        );
    }
    for end in 0..2 {
        let Some(Told { ticks, code }) = shared.told[end].get() else {
            continue;
        };
        let is_right = match outcome {
            // The last message may be lost with its connection.
            Ok(_) if course.has(|what| what == What::Reset) => true,
            Ok(outcome) => code == Code::Stale && ticks == course.ticks(end, outcome.steps),
            // It may be in the step that was not committed.
            Err(ended) => code == Code::BusFailed && ticks <= course.ticks(end, ended.steps + 1),
        };
        if !is_right {
            return broken(
                "end",
                format!(
                    "\"{}\" has {code} after {ticks} ticks, and the server {outcome:?}",
                    NAMES[end]
                ),
            );
        }
    }
    match outcome {
        Err(ended)
            if ended
                .client
                .as_deref()
                .is_some_and(|name| !NAMES.contains(&name)) =>
        {
            broken("end", format!("nobody has this name: {ended:?}"))
        }
        _ => Ok(()),
    }
}
