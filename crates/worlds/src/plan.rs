//! What a world consists of, drawn from its seed.

use std::fmt::Write as _;

use tickbus_base::time::Nanos;

use crate::network::Conditions;
use crate::random::{Random, scramble};
use crate::scheduler::Habits;

/// The line between the two ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Bus {
    Loopback,
    Socket,
    SocketOnChange,
    Modbus,
    S7,
}

/// What befalls a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Misfortune {
    /// All threads of an end stand still.
    Suspend { end: usize, span: Nanos },
    /// The simulation or the program at an end does not tick.
    Pause { end: usize, span: Nanos },
    /// Bytes are held up, and connecting gets no answer.
    Hold { span: Nanos },
    /// All connections break.
    Reset,
    /// The process of an end is killed, and another one starts later.
    Kill { end: usize, span: Nanos },
    /// The driver of an end closes, and opens again later.
    Close { end: usize, span: Nanos },
}

/// When it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Event {
    /// After the beginning.
    pub at: Nanos,
    /// What happens.
    pub what: Misfortune,
}

/// One end of the line: 0 is the device, 1 the controller.
#[derive(Clone, Debug)]
pub struct EndPlan {
    /// The time between two ticks.
    pub period: Nanos,
    /// Whether ticks come in two halves.
    pub halves: bool,
    /// `None`: as the driver does by default; `Some(None)`: off.
    pub watchdog: Option<Option<Nanos>>,
    /// `at_close = "hold"`.
    pub holds_at_close: bool,
    /// `while_stale = "hold"`.
    pub holds_while_stale: bool,
}

/// A whole world.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What it was drawn from; rules all that is not here.
    pub seed: u64,
    /// The line.
    pub bus: Bus,
    /// Whether the controller is the end that listens.
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
    /// A bit that is written beside the others, so that the frames have other sizes.
    pub numbers: bool,
    /// Both ends.
    pub ends: [EndPlan; 2],
    /// What the scheduler does.
    pub habits: Habits,
    /// How the network behaves.
    pub conditions: Conditions,
    /// How long misfortunes may happen.
    pub span: Nanos,
    /// What happens, in the order of time.
    pub events: Vec<Event>,
}

const fn us(count: i64) -> Nanos {
    Nanos::from_micros(count)
}

impl Plan {
    /// The world of a seed.
    pub fn draw(seed: u64) -> Self {
        let mut random = Random::new(scramble(seed));
        let bus = random.of(&[
            Bus::Loopback,
            Bus::Socket,
            Bus::Socket,
            Bus::SocketOnChange,
            Bus::Modbus,
            Bus::S7,
        ]);
        let cycle = us(random.of(&[1_000, 2_000, 5_000, 10_000]));
        let max_age = cycle.times(random.within(3, 12));
        let max_age = Nanos(max_age.0.max(8_000_000));
        // Each world draws which misfortunes and habits exist at all.
        let has = random.number();
        let is = |bit: u32| has >> bit & 1 == 1;
        let stations = match bus {
            Bus::Loopback | Bus::Socket | Bus::SocketOnChange if is(0) => {
                usize::try_from(random.within(2, 3)).expect("small")
            }
            _ => 1,
        };
        let mut end = |is_controller: bool| {
            let period = Nanos(cycle.0 * random.of(&[3, 7, 10, 21, 40]) / 10);
            let shortest = Nanos(
                max_age
                    .0
                    .max(cycle.0 * 10)
                    .max(period.0 * 4)
                    .max(10_000_000),
            );
            EndPlan {
                period,
                halves: random.once_in(2),
                watchdog: match random.below(3) {
                    0 => None,
                    1 if is_controller => Some(None),
                    _ => Some(Some(shortest.times(random.within(1, 3)))),
                },
                holds_at_close: random.once_in(4),
                holds_while_stale: random.once_in(3),
            }
        };
        let ends = [end(false), end(true)];
        let habits = Habits {
            preempts: if is(1) { random.of(&[8, 40, 200]) } else { 0 },
            late: if is(2) {
                random.of(&[100_000, 2_000_000])
            } else {
                0
            },
        };
        let conditions = Conditions {
            latency: (1_000, random.of(&[20_000, 200_000, 3_000_000])),
            splits: if is(3) { random.of(&[2, 10]) } else { 0 },
            capacity: if is(4) {
                random.of(&[16, 100])
            } else {
                64 * 1024
            },
        };
        let span = Nanos(max_age.0 * random.within(1, 4));
        let hold = if random.once_in(3) {
            cycle.times(random.within(1, 4))
        } else {
            Nanos::ZERO
        };
        let slowest = ends[0].period.max(ends[1].period).max(cycle);
        let pulses = Nanos(
            (slowest.0 * 6 + hold.0 * 2 + conditions.latency.1 * 4 + habits.late * 8)
                .max(max_age.0 / 2),
        );
        let mut events = Vec::new();
        let count = if is(5) { random.below(6) } else { 0 };
        for _ in 0..count {
            let at = Nanos(random.within(0, span.0));
            let which = usize::try_from(random.below(2)).expect("small");
            let length = Nanos(random.within(1_000_000, max_age.0 * 4));
            let what = match random.below(6) {
                0 if is(6) => Misfortune::Suspend {
                    end: which,
                    span: length,
                },
                1 if is(7) => Misfortune::Pause {
                    end: which,
                    span: length,
                },
                2 if is(8) && bus != Bus::Loopback => Misfortune::Hold { span: length },
                3 if is(9) && bus != Bus::Loopback => Misfortune::Reset,
                4 if is(10) && bus != Bus::Loopback => Misfortune::Kill {
                    end: which,
                    span: length,
                },
                5 if is(11) => Misfortune::Close {
                    end: which,
                    span: length,
                },
                _ => continue,
            };
            events.push(Event { at, what });
        }
        events.sort_by_key(|event| event.at);
        Self {
            seed,
            bus,
            controller_serves: is(12),
            stations,
            cycle,
            max_age,
            reconnect: us(random.of(&[10_000, 50_000])),
            hold,
            pulses,
            numbers: is(13),
            ends,
            habits,
            conditions,
            span,
            events,
        }
    }

    /// The names of its features, for the table of pairs that have met.
    pub fn features(&self) -> Vec<&'static str> {
        let mut features = vec![match self.bus {
            Bus::Loopback => "loopback",
            Bus::Socket => "socket",
            Bus::SocketOnChange => "on change",
            Bus::Modbus => "modbus",
            Bus::S7 => "s7",
        }];
        let mut add = |is: bool, name| {
            if is {
                features.push(name);
            }
        };
        add(self.stations > 1, "stations");
        add(self.controller_serves, "controller serves");
        add(self.hold > Nanos::ZERO, "hold");
        add(self.numbers, "numbers");
        add(self.ends.iter().any(|end| end.halves), "halves");
        add(
            self.ends
                .iter()
                .any(|end| matches!(end.watchdog, Some(Some(_)))),
            "watchdog",
        );
        add(
            self.ends
                .iter()
                .any(|end| matches!(end.watchdog, Some(None))),
            "no watchdog",
        );
        add(self.ends[1].holds_at_close, "at_close hold");
        add(self.ends[1].holds_while_stale, "while_stale hold");
        add(self.habits.preempts > 0, "preempted");
        add(self.habits.late > 0, "woken late");
        add(self.conditions.splits > 0, "split bytes");
        add(self.conditions.capacity < 1_000, "small buffers");
        add(self.conditions.latency.1 > 1_000_000, "slow network");
        for event in &self.events {
            let name = match event.what {
                Misfortune::Suspend { .. } => "suspended",
                Misfortune::Pause { .. } => "paused",
                Misfortune::Hold { .. } => "bytes held",
                Misfortune::Reset => "reset",
                Misfortune::Kill { .. } => "killed",
                Misfortune::Close { .. } => "closed",
            };
            if !features.contains(&name) {
                features.push(name);
            }
        }
        features
    }

    /// Whether the end is the one that listens.
    fn serves(&self, end: usize) -> bool {
        (end == 1) == self.controller_serves
    }

    /// The driver.cfg of an end; `link` is the name of a loopback.
    pub fn driver_cfg(&self, end: usize, link: &str) -> String {
        let mut text = String::new();
        let role = ["device", "controller"][end];
        let plan = &self.ends[end];
        let mut line = |line: std::fmt::Arguments<'_>| {
            // Writing to a String cannot fail.
            let _ = text.write_fmt(line);
            text.push('\n');
        };
        line(format_args!(
            "[driver]\nid = {}\nname = \"{role}\"\n[fieldbus]\nrole = \"{role}\"",
            end + 1
        ));
        let (cycle, max_age, reconnect) = (self.cycle, self.max_age, self.reconnect);
        line(format_args!(
            "cycle = \"{cycle}\"\nmax_age = \"{max_age}\"\nreconnect = [\"{reconnect}\"]"
        ));
        match plan.watchdog {
            None => {}
            Some(None) => line(format_args!("watchdog = \"off\"")),
            Some(Some(span)) => line(format_args!("watchdog = \"{span}\"")),
        }
        if end == 1 {
            let outputs = |holds| if holds { "hold" } else { "fail_safe" };
            line(format_args!(
                "at_close = \"{}\"",
                outputs(plan.holds_at_close)
            ));
            line(format_args!(
                "while_stale = \"{}\"",
                outputs(plan.holds_while_stale)
            ));
        }
        let serves = self.serves(end);
        let other = ["controller", "device"][end];
        match self.bus {
            Bus::Loopback => line(format_args!("kind = \"loopback\"\nlink = \"{link}\"")),
            Bus::Socket | Bus::SocketOnChange => {
                let role_tcp = if serves { "listen" } else { "connect" };
                line(format_args!(
                    "kind = \"socket\"\naddress = \"127.0.0.1:20030\"\nrole_tcp = \"{role_tcp}\""
                ));
                if self.bus == Bus::SocketOnChange {
                    line(format_args!("send = \"on-change\""));
                }
            }
            Bus::Modbus if serves => line(format_args!(
                "kind = \"modbus-server\"\naddress = \"127.0.0.1:20030\""
            )),
            Bus::S7 if serves => line(format_args!(
                "kind = \"s7-server\"\naddress = \"127.0.0.1:20030\""
            )),
            Bus::Modbus | Bus::S7 => {
                let kind = if self.bus == Bus::S7 { "s7" } else { "modbus" };
                line(format_args!(
                    "kind = \"{kind}-client\"\naddress = \"127.0.0.1:20030\"\nwrite_to = \"tickbus {other}\""
                ));
            }
        }
        if self.stations > 1 {
            for station in 0..self.stations {
                line(format_args!("[[station]]\nname = \"s{station}\""));
            }
        }
        for station in 0..self.stations {
            for area in ['Q', 'I'] {
                let mut signal = |name: &str, address: &str, rest: &str| {
                    line(format_args!(
                        "[[signal]]\nname = \"{name}{area}{station}\"\naddress = \"%{area}{address}\"\n{rest}"
                    ));
                    if self.stations > 1 {
                        line(format_args!("station = \"s{station}\""));
                    }
                };
                signal(
                    "stamp",
                    "L0",
                    &format!("type = \"LWORD\"\nfail_safe = {FAIL_SAFE}"),
                );
                let hold = if area == 'I' && self.hold > Nanos::ZERO {
                    format!("\nhold = \"{}\"", self.hold)
                } else {
                    String::new()
                };
                signal("pulse", "X8.0", &format!("latch = \"rising\"{hold}"));
                signal("level", "X8.1", "");
                if self.numbers {
                    signal(
                        "whole",
                        "W10",
                        "type = \"INT\"\norder = \"DCBA\"\nfail_safe = -7",
                    );
                    signal(
                        "real",
                        "D12",
                        "type = \"REAL\"\nscale = { raw = [0, 100], value = [0.0, 50.0] }\nfail_safe = 2.5",
                    );
                }
            }
        }
        text
    }
}

/// The fail-safe value of stamps: of no life.
pub(crate) const FAIL_SAFE: u64 = 2_989;
