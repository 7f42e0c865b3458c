//! A run on virtual time, judged against docs/sdsp.md: a server, and a machine and a PLC that tick in lock-step. Each
//! is a separate process.
//!
//! The values that a tick shows are known to the last bit, whatever the threads, the network and the misfortunes do.
//! Some misfortunes end the run; then every process learns of the end, and none continues.

mod course;
mod end;

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use tickbus_base::time::{Clock as _, Nanos};
use tickbus_driver::Code;
use tickbus_net::Address;
use tickbus_virtual_time::server::Control;
use tickbus_virtual_time::tcp::Listener;
use tickbus_virtual_time::{Controls, Ended, Hosting, Logic, Outcome, Settings, StartCondition};

use crate::broken::{Broken, broken};
use crate::clock::SimulatedClock;
use crate::config::PORT;
use crate::network;
use crate::random::scramble;
use crate::scheduler;
use crate::seed::Seed;

use course::{Course, What};
use end::live;

/// The index of the server; 0 is the machine, and 1 is the PLC.
const SERVER: usize = 2;

/// The names of the clients.
const NAMES: [&str; 2] = ["cell", "cell PLC"];

/// The server's step.
const STEP: Nanos = Nanos::from_millis(1);

/// The longest misfortune. Three of them are shorter than the time for which a client and the server wait for each
/// other.
const LONGEST: Nanos = Nanos::from_secs(1);

/// A run, or its end, reaches all processes within this time. The last wait for a client takes 10 s, and that for the
/// server 5 s.
const PATIENCE: Nanos = Nanos::from_secs(40);

/// The number of attempts of an end that cannot join the run.
const ATTEMPTS: u32 = 20;

/// The outcome for an end that is still there.
#[derive(Clone, Copy, Debug)]
struct Told {
    ticks: u64,
    code: Code,
}

struct Shared {
    course: Course,
    processes: [Cell<usize>; 3],
    /// The order to an end for its next tick.
    orders: [Cell<Option<What>>; 2],
    /// True for a process that was killed or closed.
    is_gone: [Cell<bool>; 3],
    is_done: [Cell<bool>; 3],
    /// True if an end has tried to join the run more than once.
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

    fn check(&self, judged: Result<(), Broken>) {
        if let Err(broken) = judged {
            self.broken.borrow_mut().get_or_insert(broken);
            scheduler::stop();
        }
    }
}

/// Runs a course. If nothing has ended it, runs it again without habits and misfortunes, which must not change the
/// outcome.
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

/// Returns true if a misfortune ends a run.
fn is_end(what: What) -> bool {
    !matches!(what, What::Suspend(..) | What::Pause(..) | What::Hold(_))
}

/// The outcome of a run; `None` if ends needed several attempts, so that initial values may have differed.
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

/// Starts all processes, lets the misfortunes happen, and waits for the end.
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
        // A server waits without limit for a client that is gone, so the run has to be stopped.
        if course.has(is_end) {
            shared.controls.send(Control::Stop);
        }
        if !await_all(shared) {
            let done = shared.is_done.each_ref().map(Cell::get);
            shared.check(broken(
                "liveness",
                format!("the run has not ended: machine, PLC, server are done: {done:?}"),
            ));
        }
    }
}

/// Returns true if all processes are done in time.
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
                // The server's thread ends unnoticed.
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
    let Some(listener) = network::unless_killed(listener) else {
        return;
    };
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

/// Judges that the server reported the same outcome to all ends.
fn judge_end(shared: &Shared) -> Result<(), Broken> {
    let course = &shared.course;
    let outcome = shared.outcome.borrow();
    let Some(outcome) = outcome.as_ref() else {
        // A killed server has reported nothing to anybody.
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
    for (end, told) in shared.told.iter().enumerate() {
        let Some(Told { ticks, code }) = told.get() else {
            continue;
        };
        let is_right = match outcome {
            // The last message may be lost with its connection.
            Ok(_) if course.has(|what| what == What::Reset) => true,
            Ok(outcome) => code == Code::Stale && ticks == course.ticks(end, outcome.steps),
            // The end may be in the step that was not committed.
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
