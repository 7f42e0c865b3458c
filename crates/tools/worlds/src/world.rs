//! Runs a world.

mod edges;
mod hosted;

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;

use tickbus_base::time::Nanos;
use tickbus_driver::{Code, Host};

use crate::broken::Broken;
use crate::end::{End, Found};
use crate::judge::{Reader, Seen, Writer};
use crate::laboratory::{self, Laboratory};
use crate::plan::{BETWEEN, Bus, Misfortune, Plan};
use crate::random::{Random, scramble};
use crate::scheduler::{self, Stuck};
use crate::silence;
use crate::stamp::Stamp;

/// A world recovers within this time after its last misfortune. An attempt to connect that began while the cable was
/// pulled may take 5 s to fail.
const PATIENCE: Nanos = Nanos::from_secs(16);

/// The maximum time for closing, which includes that for the last values and for a bus that does not end.
const LONGEST_CLOSE: Nanos = Nanos::from_secs(5);

/// The order to an end for its next tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    Pause(Nanos),
    Close(Nanos),
    Kill(Nanos),
    Finish,
}

#[derive(Default)]
struct EndState {
    orders: RefCell<VecDeque<Order>>,
    process: Cell<usize>,
    is_open: Cell<bool>,
    is_finished: Cell<bool>,
    writer: RefCell<Writer>,
    reader: RefCell<Reader>,
    tick: Cell<u64>,
    /// The time for which the next scan of the end's program stalls.
    stall: Cell<Nanos>,
    /// The time since which the end's line has been down on purpose.
    down_since: Cell<Option<i64>>,
}

struct Shared {
    plan: Plan,
    link: String,
    ends: [EndState; 2],
    laboratory: Rc<Laboratory>,
    broken: RefCell<Option<Broken>>,
    /// When the controller had closed for good and its device could know that.
    controller_left: Cell<Option<i64>>,
    /// The log of all ticks, if requested.
    trace: Option<Rc<RefCell<String>>>,
}

impl Shared {
    fn fail(&self, broken: Broken) {
        self.broken.borrow_mut().get_or_insert(broken);
        scheduler::stop();
    }

    fn check(&self, judged: Result<(), Broken>) {
        if let Err(broken) = judged {
            self.fail(broken);
        }
    }
}

impl Plan {
    /// Runs the world.
    ///
    /// # Errors
    ///
    /// The first promise that was broken.
    pub fn run(&self) -> Result<(), Broken> {
        self.happen(None)
    }

    /// All ticks of both ends, and the broken promise, as text; the same in every run.
    pub fn trace(&self) -> String {
        let trace = Rc::new(RefCell::new(String::new()));
        let result = self.happen(Some(Rc::clone(&trace)));
        let mut trace = trace.take();
        if let Err(broken) = result {
            trace.push_str(&broken.to_string());
        }
        trace
    }

    fn happen(&self, trace: Option<Rc<RefCell<String>>>) -> Result<(), Broken> {
        silence::begin();
        thread_local! {
            static LEAKED: Cell<u64> = const { Cell::new(0) };
        }
        // All worlds of a process share the links, and a broken world never releases its own.
        let leaked = LEAKED.get();
        let thread = std::thread::current().id();
        let shared = Rc::new(Shared {
            plan: self.clone(),
            link: format!("{leaked} of {thread:?}"),
            ends: Default::default(),
            laboratory: Rc::default(),
            broken: RefCell::default(),
            controller_left: Cell::default(),
            trace,
        });
        let main = {
            let shared = Rc::clone(&shared);
            move || fate(&shared)
        };
        hosted::enter(&shared);
        let result = scheduler::run(scramble(self.seed.chance() ^ 1), self.habits, main);
        hosted::leave();
        let is_broken = result.is_err() || shared.broken.borrow().is_some();
        LEAKED.set(leaked + u64::from(is_broken));
        if let Some(broken) = shared.broken.borrow_mut().take() {
            return Err(broken);
        }
        result.map_err(|stuck| Broken {
            promise: "end",
            what: match stuck {
                Stuck::Deadlock => "every thread waits for another one".to_owned(),
                Stuck::Endless => "threads go on and on".to_owned(),
            },
        })
    }
}

/// Starts both ends, lets the misfortunes happen, and judges that the world recovers.
fn fate(shared: &Rc<Shared>) {
    let plan = &shared.plan;
    scheduler::network(|network, _, _| network.conditions = plan.conditions);
    let began = scheduler::now();
    if plan.bus == Bus::Dispatcher {
        shared.laboratory.begin(plan);
    }
    for end in 0..2 {
        begin(shared, end, 1);
    }
    for event in &plan.events {
        let at = began + event.at;
        scheduler::sleep(at - scheduler::now());
        befall(shared, event.what);
    }
    // A pulled cable delivers what it held back, however late.
    let holds = plan.events.iter().map(|event| match event.what {
        Misfortune::Hold(span) => event.at + span,
        _ => Nanos::ZERO,
    });
    let over = holds.fold(plan.span, Nanos::max);
    scheduler::sleep(began + over - scheduler::now());
    recover(shared);
    let ended = scheduler::now();
    for end in [1, 0] {
        shared.ends[end]
            .orders
            .borrow_mut()
            .push_back(Order::Finish);
        let asked = scheduler::now();
        scheduler::sleep_until(|| shared.ends[end].is_finished.get());
        let took = scheduler::now() - asked;
        if took > LONGEST_CLOSE + plan.ends[end].period {
            shared.fail(Broken {
                promise: "close",
                what: format!("end {end} took {took}"),
            });
        }
        if end == 1 {
            // A device that was suspended in the meantime has confirmed nothing. It keeps the last values until nothing
            // has come for `max_age`.
            let until = scheduler::suspended_until(shared.ends[0].process.get());
            let left = if until > asked {
                scheduler::now().max(until) + plan.max_age
            } else {
                scheduler::now()
            };
            shared.controller_left.set(Some(left.0));
            scheduler::sleep(plan.max_age);
        }
    }
    if plan.bus == Bus::Dispatcher {
        shared.check(shared.laboratory.end());
    }
    edges::judge(shared, ended);
}

fn begin(shared: &Rc<Shared>, end: usize, life: u64) {
    let process = scheduler::new_process();
    shared.ends[end].process.set(process);
    shared.laboratory.joins(end, process);
    let shared = Rc::clone(shared);
    scheduler::spawn(process, move || live(&shared, end, life, process));
}

fn befall(shared: &Rc<Shared>, what: Misfortune) {
    let order = |end: usize, order| shared.ends[end].orders.borrow_mut().push_back(order);
    match what {
        Misfortune::Suspend(BETWEEN, _)
        | Misfortune::Kill(BETWEEN, _)
        | Misfortune::Close(BETWEEN, _) => shared.laboratory.befall(&shared.plan, what),
        Misfortune::Suspend(end, span) => {
            // Both ends of a loopback are one process.
            let both = shared.plan.bus == Bus::Loopback;
            for (which, state) in shared.ends.iter().enumerate() {
                if which == end || both {
                    scheduler::suspend_process(state.process.get(), span);
                }
            }
        }
        Misfortune::Pause(end, span) => order(end, Order::Pause(span)),
        Misfortune::Hold(span) => {
            scheduler::network(|network, _, now| network.hold_all(now, span.0));
        }
        Misfortune::Reset => scheduler::network(|network, _, now| network.reset_all(now)),
        Misfortune::Close(end, span) => order(end, Order::Close(span)),
        Misfortune::Kill(end, span) => {
            // Nothing that the process does from now on leaves it.
            let process = shared.ends[end].process.get();
            scheduler::network(|network, _, now| network.kill(process, now));
            scheduler::disk(|disk, now| disk.kill(process, now));
            order(end, Order::Kill(span));
        }
    }
}

/// Waits until both ends have each other's newest values; after the last misfortune that must happen soon.
fn recover(shared: &Shared) {
    let plan = &shared.plan;
    let limit = scheduler::now() + PATIENCE;
    loop {
        scheduler::sleep(shared.plan.max_age);
        let now = scheduler::now();
        let judged = [0, 1].map(|end| {
            let (mine, theirs) = (&shared.ends[end], &shared.ends[1 - end]);
            mine.reader
                .borrow()
                .judge_liveness(&shared.plan, &theirs.writer.borrow(), now.0)
        });
        let [one, other] = judged;
        let judged = one.and(other);
        let is_over = |end: usize| plan.has_no_more_faults(end, shared.ends[end].tick.get());
        let is_whole = judged.is_ok()
            && shared.ends.iter().all(|end| end.is_open.get())
            && [0, 1].into_iter().all(is_over);
        if is_whole {
            return;
        }
        if now >= limit {
            shared.check(judged);
            return;
        }
    }
}

/// Runs one life of an end; a close or a kill begins the next one.
fn live(shared: &Rc<Shared>, end: usize, life: u64, process: usize) {
    let plan = &shared.plan;
    let state = &shared.ends[end];
    let mut random = Random::new(scramble(
        plan.seed.chance() ^ scramble(life << 8 | end as u64),
    ));
    state.reader.borrow_mut().begin(plan.stations);
    state.tick.set(0);
    state.down_since.set(None);
    let mut driver = if plan.features.hosted == Some(end) {
        Ticker::Hosted(Box::new(hosted::open(shared, (end, process), life)))
    } else {
        match End::open(plan, end, &shared.link) {
            Ok(driver) => Ticker::Driven(Box::new(driver)),
            Err(broken) => return shared.fail(broken),
        }
    };
    state.is_open.set(true);
    let mut tick = 0;
    loop {
        let order = state.orders.borrow_mut().pop_front();
        match order {
            None => {}
            Some(Order::Pause(span)) => match driver {
                Ticker::Driven(_) => scheduler::sleep(span),
                Ticker::Hosted(_) => state.stall.set(span),
            },
            Some(Order::Finish) => {
                shared.check(driver.close());
                state.is_finished.set(true);
                return;
            }
            Some(Order::Close(span) | Order::Kill(span)) => {
                state.is_open.set(false);
                let asked = scheduler::now();
                shared.check(driver.close());
                let took = scheduler::now() - asked;
                if took > LONGEST_CLOSE {
                    shared.fail(Broken {
                        promise: "close",
                        what: format!("end {end} took {took}"),
                    });
                }
                scheduler::sleep(span);
                begin(shared, end, life + 1);
                return;
            }
        }
        if let Ticker::Driven(driver) = &mut driver {
            tick += 1;
            one_tick(shared, (end, process), driver, (life, tick));
        }
        let period = plan.ends[end].period.0;
        scheduler::sleep(Nanos(random.within(period / 2, period + period / 2)));
    }
}

/// The driver or the host that ticks an end.
enum Ticker {
    Driven(Box<End>),
    Hosted(Box<Host>),
}

impl Ticker {
    fn close(self) -> Result<(), Broken> {
        match self {
            Self::Driven(driver) => driver.close(),
            Self::Hosted(host) => hosted::close(*host),
        }
    }
}

fn one_tick(
    shared: &Shared,
    (end, process): (usize, usize),
    driver: &mut End,
    (life, tick): (u64, u64),
) {
    let state = &shared.ends[end];
    let began = scheduler::now().0;
    state.writer.borrow_mut().begin(life, tick);
    let (found, is_pulse) = driver.tick(life, tick);
    let ended = scheduler::now().0;
    {
        let mut writer = state.writer.borrow_mut();
        writer.end(ended);
        if is_pulse {
            writer.pulses.push(began);
        }
    }
    judge_tick(
        shared,
        (end, process),
        (life, tick),
        (began, is_pulse),
        found,
    );
}

/// Judges the result of a tick.
fn judge_tick(
    shared: &Shared,
    (end, process): (usize, usize),
    (life, tick): (u64, u64),
    (began, is_pulse): (i64, bool),
    mut found: Found,
) {
    let plan = &shared.plan;
    let (state, peer) = (&shared.ends[end], &shared.ends[1 - end]);
    if let Some(broken) = found.broken.take() {
        return shared.fail(broken);
    }
    state.tick.set(tick);
    let down_since = state.down_since.get().unwrap_or(began);
    let down_since = plan.is_down(end, tick).then_some(down_since);
    // If the next tick is not down, the line comes up as that tick begins, before it is judged.
    let is_down_next = plan.is_down(end, tick + 1);
    state.down_since.set(down_since.filter(|_| is_down_next));
    if plan.is_disturbed(end, tick) {
        state.reader.borrow_mut().stale.push(began);
    }
    if found.code.code() < 0 {
        shared.fail(Broken {
            promise: "code",
            what: format!("a tick returned {}", found.code),
        });
        return;
    }
    let line = || {
        let stations = found.stations.iter();
        let shown: Vec<_> = stations
            .map(|shown| (Stamp::of(shown.stamp).tick, shown.edges))
            .collect();
        format!(
            "{began} end {end} life {life} tick {tick} pulse {is_pulse} {} age {} sequence {} {shown:?}",
            found.code.name(),
            found.age,
            found.sequence
        )
    };
    if let Some(trace) = &shared.trace {
        let mut trace = trace.borrow_mut();
        trace.push_str(&line());
        trace.push('\n');
    }
    log::trace!("{}", line());
    let connected = scheduler::network(|network, _, _| network.last_connected(process));
    // A client whose line is down still connects and asks who answers, and any request is a sign of life.
    let heard = peer.down_since.get().map(|since| {
        if plan.bus.asks() {
            since.max(connected)
        } else {
            since
        }
    });
    let down = down_since.into_iter().chain(heard);
    let writer = peer.writer.borrow();
    let peer_reader = peer.reader.borrow();
    let judged = scheduler::network(|network, _, _| {
        let deliveries = network.deliveries.get(&process).map_or(&[][..], |all| all);
        let heard = (end, began - found.age);
        // Stale data are judged separately.
        let known = (found.code != Code::Stale)
            .then(|| {
                shared.laboratory.known(
                    plan,
                    network,
                    (&writer, &peer_reader.valid_since),
                    heard,
                    deliveries,
                )
            })
            .flatten();
        let seen = Seen {
            began,
            tick,
            is_stale: found.code == Code::Stale,
            is_fresh: found.code == Code::Fresh,
            age: found.age,
            sequence: found.sequence,
            stations: &found.stations,
            deliveries,
            known,
        };
        let mut reader = state.reader.borrow_mut();
        reader.judge(plan, end as u64, &writer, &seen)?;
        if let Some(known) = known.filter(|_| plan.bus == Bus::Dispatcher) {
            laboratory::judge_silence(plan, known, &seen)?;
        }
        if let Some(limit) = plan.watchdog(1 - end) {
            Reader::judge_watchdog(plan, limit.0, &writer, &seen)?;
        }
        reader.judge_frozen(plan, 1 - end, &writer, connected, &seen)?;
        if end == 0 {
            reader.judge_blind(plan, &peer_reader, connected, &seen)?;
        }
        for since in down {
            Reader::judge_down(plan, since, &seen)?;
        }
        match shared.controller_left.get() {
            Some(left) if end == 0 => Reader::judge_farewell(plan, &peer_reader, left, &seen),
            _ => Ok(()),
        }
    });
    shared.check(judged);
}
