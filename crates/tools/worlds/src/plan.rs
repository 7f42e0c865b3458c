//! The plan of a world, drawn from its seed.

mod faults;

use tickbus_base::time::Nanos;

pub use crate::bus::Bus;
use crate::features::{self, Features};
use crate::network::Conditions;
use crate::random::{Random, scramble};
use crate::scheduler::Habits;
use crate::seed::Seed;
use crate::{master, wire};

/// A misfortune of a world. Ends are 0, the device, 1, the controller, and [`BETWEEN`], the dispatcher; spans are
/// durations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misfortune {
    /// All threads of an end stand still.
    Suspend(usize, Nanos),
    /// The simulation or the program at an end does not tick.
    Pause(usize, Nanos),
    /// Bytes are held up, and connecting gets no answer.
    Hold(Nanos),
    /// All connections break.
    Reset,
    /// The process of an end is killed, and another one starts later.
    Kill(usize, Nanos),
    /// The driver of an end closes, and opens again later.
    Close(usize, Nanos),
}

/// The dispatcher, where misfortunes name an end.
pub const BETWEEN: usize = 2;

/// Makes the random numbers of later features independent of those of the seed.
const LATER: u64 = 0x6C61_7465_7200;

/// The bit of `more` that allows several units of Modbus.
const UNITS: u32 = 19;

/// The bit of `more` that allows PROFIBUS.
const PROFIBUS: u32 = 20;

/// When it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// After the beginning.
    pub at: Nanos,
    /// The misfortune.
    pub what: Misfortune,
}

/// The key `watchdog` of an end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watchdog {
    /// The key is absent.
    Default,
    /// `"off"`.
    Off,
    /// A duration.
    After(Nanos),
}

/// One end of the line: 0 is the device, 1 the controller.
#[derive(Clone, Debug)]
pub struct EndPlan {
    /// The time between two ticks.
    pub period: Nanos,
    /// True if ticks come in two halves.
    pub halves: bool,
    /// When the other end gets fail-safe values if this one does not tick.
    pub watchdog: Watchdog,
    /// `at_close = "hold"`.
    pub holds_at_close: bool,
    /// `while_stale = "hold"`.
    pub holds_while_stale: bool,
}

/// The behaviour of the dispatcher of a world.
#[derive(Clone, Copy, Debug, Default)]
pub struct LaboratoryPlan {
    /// The ends ask for their connections; without that, they stand in its patch.
    pub is_asked: bool,
    /// `--hold`: an input that has lost its source keeps its value.
    pub holds: bool,
}

/// A whole world.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The seed that the plan was drawn from; it rules everything that has no field here.
    pub seed: Seed,
    /// The line.
    pub bus: Bus,
    /// True if the controller is the end that listens.
    pub controller_serves: bool,
    /// How many stations the line has.
    pub stations: usize,
    /// The bus cycle.
    pub cycle: Nanos,
    /// The limit of age.
    pub max_age: Nanos,
    /// The pause between two attempts to connect.
    pub reconnect: Nanos,
    /// How long pulses towards the PLC are held; zero for one exchange.
    pub hold: Nanos,
    /// Pulses are this far apart.
    pub pulses: Nanos,
    /// The time between the two pulses of a pair.
    pub pair: Nanos,
    /// A bit that is written beside the others, so that the frames have other sizes.
    pub numbers: bool,
    /// The behaviour of the dispatcher, if there is one.
    pub laboratory: LaboratoryPlan,
    /// Both ends.
    pub ends: [EndPlan; 2],
    /// The habits of the scheduler.
    pub habits: Habits,
    /// How the network behaves.
    pub conditions: Conditions,
    /// How long misfortunes may happen.
    pub span: Nanos,
    /// The misfortunes, in the order of time.
    pub events: Vec<Event>,
    /// The further features of both ends.
    pub features: Features,
}

impl EndPlan {
    fn draw(random: &mut Random, cycle: Nanos, max_age: Nanos, is_controller: bool) -> Self {
        let period = Nanos(cycle.0 * random.of(&[3, 7, 10, 21, 40]) / 10);
        let least = [max_age.0, cycle.0 * 10, period.0 * 4, 10_000_000];
        let least = Nanos(least.into_iter().max().unwrap_or_default());
        let watchdog = least.times(random.within(1, 3));
        Self {
            period,
            halves: random.once_in(2),
            watchdog: match random.below(3) {
                0 => Watchdog::Default,
                1 if is_controller => Watchdog::Off,
                _ => Watchdog::After(watchdog),
            },
            holds_at_close: random.once_in(4),
            holds_while_stale: random.once_in(3),
        }
    }
}

/// Which habits a world has, of those that may exist.
fn draw_habits(random: &mut Random, is: impl Fn(u32) -> bool, max_age: Nanos) -> Habits {
    let (preempts, late) = (random.of(&[8, 40, 200]), random.of(&[100_000, 2_000_000]));
    let starves = max_age.0 * random.within(1, 3);
    Habits {
        preempts: if is(1) { preempts } else { 0 },
        late: if is(2) { late } else { 0 },
        starves: if is(1) && is(14) { starves } else { 0 },
    }
}

/// Draws the conditions of the network.
fn draw_conditions(random: &mut Random, is: impl Fn(u32) -> bool, bus: Bus) -> Conditions {
    let slowest = random.of(&[20_000, 200_000, 3_000_000]);
    // An answer fits into what a system keeps for a connection.
    let small = if bus.asks() || bus == Bus::Dispatcher {
        [600, 1_000]
    } else {
        [16, 100]
    };
    let (splits, capacity) = (random.of(&[2, 10]), random.of(&small));
    Conditions {
        latency: (1_000, slowest),
        splits: if is(3) { splits } else { 0 },
        capacity: if is(4) { capacity } else { 64 * 1024 },
    }
}

const fn us(count: i64) -> Nanos {
    Nanos::from_micros(count)
}

impl Plan {
    /// The world of a seed. What a mask leaves out is drawn all the same, so that the rest stays as it is.
    pub fn draw(seed: impl Into<Seed>) -> Self {
        let seed = seed.into();
        let random = &mut Random::new(scramble(seed.number));
        let bus = random.of(&[
            Bus::Loopback,
            Bus::Socket,
            Bus::Socket,
            Bus::SocketOnChange,
            Bus::Modbus,
            Bus::ModbusRtu,
            Bus::S7,
        ]);
        let cycle = us(random.of(&[1_000, 2_000, 5_000, 10_000]));
        let max_age = cycle.times(random.within(3, 12));
        let max_age = Nanos(max_age.0.max(8_000_000));
        // Each world draws which misfortunes and habits exist at all.
        let has = random.number() & seed.features;
        let is = |bit: u32| has >> bit & 1 == 1;
        // Buses that came later are drawn from numbers of their own: old seeds keep their meaning.
        let later = &mut Random::new(scramble(seed.number ^ LATER));
        let bus = if is(40) && is(43) {
            Bus::Dispatcher
        } else {
            bus
        };
        let allows = |bit: u32, chance: u64| {
            seed.more >> bit & 1 == 1
                && Random::new(scramble(seed.number ^ LATER ^ u64::from(bit))).once_in(chance)
        };
        let bus = if allows(PROFIBUS, 24) {
            Bus::Profibus
        } else {
            bus
        };
        let many = usize::try_from(random.within(2, 3)).expect("small");
        let has_units = bus.has_units() && allows(UNITS, 3);
        let stations = if is(0) && bus.has_stations() || has_units {
            many
        } else {
            1
        };
        let ends = [
            EndPlan::draw(random, cycle, max_age, false),
            EndPlan::draw(random, cycle, max_age, true),
        ];
        let habits = draw_habits(random, is, max_age);
        let conditions = draw_conditions(random, is, bus);
        let span = Nanos(max_age.0 * random.within(1, 4));
        let hold = cycle.times(random.within(1, 4));
        let hold = if random.once_in(3) { hold } else { Nanos::ZERO };
        let reconnect = us(random.of(&[10_000, 50_000]));
        let mut plan = Self {
            seed,
            bus,
            // The master of PROFIBUS asks.
            controller_serves: is(12) && bus != Bus::Profibus,
            stations,
            cycle,
            max_age,
            reconnect,
            hold,
            pulses: Nanos::ZERO,
            pair: Nanos::ZERO,
            numbers: is(13),
            laboratory: LaboratoryPlan {
                // Rarely: what was refused is asked for again after 5 s, and such a world takes long.
                is_asked: bus == Bus::Dispatcher && is(41) && later.once_in(6),
                holds: bus == Bus::Dispatcher && is(42),
            },
            ends,
            habits,
            conditions,
            span,
            events: Vec::new(),
            features: Features::draw(seed, (bus, stations), is(13), max_age.0),
        };
        plan.draw_events(random, is);
        if seed.turn > 0 {
            plan.turn();
        }
        if plan.features.typed.iter().any(|typed| !typed.is_empty()) {
            // Of long frames, buffers of a few bytes would carry less than what is made in a cycle.
            let bytes = plan.features.frame() * plan.stations;
            plan.conditions.capacity = plan.conditions.capacity.max(bytes);
        }
        if has_units || bus == Bus::Profibus {
            // A unit has half of max_age for an answer, and the others wait meanwhile.
            plan.max_age = plan.max_age.max(Nanos(plan.round_trip()));
        }
        let between = plan.events_between(later, is);
        plan.events.extend(between);
        plan.events.sort_by_key(|event| event.at);
        let slowest = plan.ends[0].period.max(plan.ends[1].period).max(cycle);
        let line = plan.round_trip() + plan.habits.late * 8 + plan.restart();
        let count = if plan.features.pairs { 2 } else { 1 };
        plan.pulses = Nanos(((slowest.0 * 6 + hold.0 * 2 + line) * count).max(max_age.0 / 2));
        // Edges between two exchanges merge.
        plan.pair = Nanos(slowest.0 * 2 + line);
        plan
    }

    /// The same two drivers, and other habits, another network, other misfortunes.
    fn turn(&mut self) {
        let random = &mut Random::new(scramble(self.seed.chance()));
        let has = random.number() & self.seed.features;
        let is = |bit: u32| has >> bit & 1 == 1;
        self.habits = draw_habits(random, is, self.max_age);
        self.conditions = draw_conditions(random, is, self.bus);
        self.span = Nanos(self.max_age.0 * random.within(1, 4));
        self.draw_events(random, is);
    }

    /// Draws what happens, and when.
    fn draw_events(&mut self, random: &mut Random, is: impl Fn(u32) -> bool + Copy) {
        self.events.clear();
        for index in 0..random.below(6) {
            let drawn = self.draw_event(random, is);
            self.events
                .extend(drawn.filter(|_| is(5) && self.seed.events >> index & 1 == 1));
        }
        self.events.sort_by_key(|event| event.at);
    }

    /// The time that the network takes for a whole cycle at most, in ns.
    pub(crate) fn round_trip(&self) -> i64 {
        // A request is asked and answered before the next one, in as many pieces as the connection takes.
        if self.bus == Bus::Profibus {
            // Each request may be repeated, and so may the one for other masters.
            let requests = i64::try_from(self.stations).expect("small") + 1;
            return self.slot() * master::TRIES * requests;
        }
        let ways = match self.bus {
            Bus::Dispatcher => 8,
            bus if bus.asks() => 12 * self.stations,
            _ => 4,
        };
        let ways = i64::try_from(ways).expect("small");
        let bytes = self.features.frame() * self.stations;
        let pieces = match self.conditions.capacity {
            capacity if capacity < 500 => (bytes / capacity + 1).max(4),
            _ => 1,
        };
        let pieces = i64::try_from(pieces).expect("small");
        self.conditions.latency.1 * ways * pieces
    }

    /// The time within which a slave of PROFIBUS answers even if its thread runs late, in ns.
    pub(crate) fn slot(&self) -> i64 {
        let preempted = if self.habits.preempts > 0 {
            3_000_000
        } else {
            0
        };
        let answer = wire::characters(self.features.frame() + 11);
        self.conditions.latency.1 * 2 + self.habits.late * 4 + preempted + answer * 2 + 1_000_000
    }

    /// The time that a slave of PROFIBUS takes to return after two damaged telegrams in a row, in ns. Its master requests
    /// the diagnosis twice, and sends parameters and configuration, one in a bus cycle; some of these may be damaged, too.
    fn restart(&self) -> i64 {
        if self.bus == Bus::Profibus && self.conditions.splits > 0 {
            self.cycle.0 * 10 + self.slot() * 4
        } else {
            0
        }
    }

    /// The misfortunes of the dispatcher between the ends.
    fn events_between(&self, random: &mut Random, is: impl Fn(u32) -> bool) -> Vec<Event> {
        let mut events = Vec::new();
        for index in 5..8 {
            let at = Nanos(random.within(0, self.span.0));
            let span = Nanos(random.within(1_000_000, self.max_age.0 * 4));
            let what = match random.below(6) {
                0 | 1 if is(6) => Misfortune::Suspend(BETWEEN, span),
                2 if is(10) => Misfortune::Kill(BETWEEN, span),
                3 if is(11) => Misfortune::Close(BETWEEN, span),
                _ => continue,
            };
            if self.bus == Bus::Dispatcher && is(5) && self.seed.events >> index & 1 == 1 {
                events.push(Event { at, what });
            }
        }
        events
    }

    fn draw_event(&self, random: &mut Random, is: impl Fn(u32) -> bool) -> Option<Event> {
        let at = Nanos(random.within(0, self.span.0));
        let end = usize::try_from(random.below(2)).expect("small");
        let span = Nanos(random.within(1_000_000, self.max_age.0 * 4));
        let has_network = self.bus != Bus::Loopback;
        let what = match random.below(6) {
            0 if is(6) => Misfortune::Suspend(end, span),
            1 if is(7) => Misfortune::Pause(end, span),
            2 if is(8) && has_network => Misfortune::Hold(span),
            3 if is(9) && has_network => Misfortune::Reset,
            4 if is(10) && has_network => Misfortune::Kill(end, span),
            5 if is(11) => Misfortune::Close(end, span),
            _ => return None,
        };
        Some(Event { at, what })
    }

    /// The names of its features, for the table of pairs that have met.
    pub fn features(&self) -> Vec<&'static str> {
        let mut features = vec![self.bus.name()];
        let mut add = |is: bool, name| {
            if is {
                features.push(name);
            }
        };
        add(self.stations > 1, "stations");
        add(self.controller_serves, "controller serves");
        add(self.hold > Nanos::ZERO, "hold");
        add(self.laboratory.is_asked, "dispatcher asked");
        add(self.laboratory.holds, "dispatcher holds");
        add(self.numbers, "numbers");
        add(self.ends.iter().any(|end| end.halves), "halves");
        add(
            self.ends
                .iter()
                .any(|end| matches!(end.watchdog, Watchdog::After(_))),
            "watchdog",
        );
        add(
            self.ends.iter().any(|end| end.watchdog == Watchdog::Off),
            "no watchdog",
        );
        add(self.ends[1].holds_at_close, "at_close hold");
        add(self.ends[1].holds_while_stale, "while_stale hold");
        add(self.habits.preempts > 0, "preempted");
        add(self.habits.late > 0, "woken late");
        add(self.habits.starves > 0, "starved");
        add(self.conditions.splits > 0, "split bytes");
        add(self.conditions.capacity <= 1_000, "small buffers");
        add(self.conditions.latency.1 > 1_000_000, "slow network");
        for event in &self.events {
            let name = match event.what {
                Misfortune::Suspend(BETWEEN, _) => "dispatcher suspended",
                Misfortune::Kill(BETWEEN, _) => "dispatcher killed",
                Misfortune::Close(BETWEEN, _) => "dispatcher closed",
                Misfortune::Suspend(..) => "suspended",
                Misfortune::Pause(..) => "paused",
                Misfortune::Hold(..) => "bytes held",
                Misfortune::Reset => "reset",
                Misfortune::Kill(..) => "killed",
                Misfortune::Close(..) => "closed",
            };
            if !features.contains(&name) {
                features.push(name);
            }
        }
        features.extend(self.features.names());
        features
    }
}

/// All features that a world can have, each of the buses one.
pub(crate) fn all_features() -> Vec<&'static str> {
    [&Bus::NAMES[..], FEATURES, features::NAMES].concat()
}

const FEATURES: &[&str] = &[
    "stations",
    "controller serves",
    "hold",
    "numbers",
    "halves",
    "watchdog",
    "no watchdog",
    "at_close hold",
    "while_stale hold",
    "preempted",
    "woken late",
    "starved",
    "split bytes",
    "small buffers",
    "slow network",
    "suspended",
    "paused",
    "bytes held",
    "reset",
    "killed",
    "closed",
    "dispatcher asked",
    "dispatcher holds",
    "dispatcher suspended",
    "dispatcher killed",
    "dispatcher closed",
];

/// The fail-safe value of stamps: of no life.
pub(crate) const FAIL_SAFE: u64 = 2_989;
