//! A run on virtual time, drawn from its seed.

use std::fmt::Write as _;

use tickbus_base::time::Nanos;

use super::LONGEST;
use crate::config::PORT;
use crate::network::Conditions;
use crate::plan::FAIL_SAFE;
use crate::random::{Random, scramble};
use crate::scheduler::Habits;
use crate::seed::Seed;

/// A misfortune of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum What {
    Suspend(usize, Nanos),
    Pause(usize, Nanos),
    Hold(Nanos),
    /// From here on, misfortunes end a run: connections break, a client or the server is killed, a client closes, the
    /// server is stopped.
    Reset,
    Kill(usize),
    Close(usize),
    Stop,
}

/// One of the two ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct EndCourse {
    /// The end has one step in this many of the server's.
    pub(super) multiple: u64,
    pub(super) halves: bool,
}

/// A whole run, drawn from its seed.
#[derive(Clone, Debug)]
pub(super) struct Course {
    pub(super) steps: u64,
    pub(super) stations: u64,
    pub(super) ends: [EndCourse; 2],
    pub(super) habits: Habits,
    pub(super) conditions: Conditions,
    pub(super) events: Vec<(Nanos, What)>,
}

impl Course {
    pub(super) fn draw(seed: Seed) -> Self {
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

    /// The same run without scheduler habits and misfortunes.
    pub(super) fn quiet(&self) -> Self {
        Self {
            habits: Habits::default(),
            events: Vec::new(),
            ..self.clone()
        }
    }

    pub(super) fn has(&self, test: impl Fn(What) -> bool) -> bool {
        self.events.iter().any(|event| test(event.1))
    }

    /// The number of ticks that an end has in a run of `steps` steps.
    pub(super) fn ticks(&self, end: usize, steps: u64) -> u64 {
        steps.div_ceil(self.ends[end].multiple)
    }

    /// The tick of its peer that an end sees in its own tick `tick`; 0 for the values from before the first tick.
    pub(super) fn expected(&self, end: usize, tick: u64) -> u64 {
        // Values written in a step are read in the next one.
        let step = 1 + (tick - 1) * self.ends[end].multiple;
        let answers = self.ticks(1 - end, step - 1);
        // An exchange passes its values before it gets a step; a half does so afterwards.
        answers + u64::from(!self.ends[1 - end].halves)
    }

    pub(super) fn driver_cfg(&self, end: usize) -> String {
        let role = ["device", "controller"][end];
        let multiple = self.ends[end].multiple;
        let mut text = format!(
            "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nrole = \"{role}\"\nkind = \"sdsp\"\n\
             address = \"127.0.0.1:{PORT}\"\nmultiple = {multiple}\ntimeout = \"5s\"\n"
        );
        for station in 0..self.stations {
            let _ = writeln!(text, "[[station]]\nname = \"s{station}\"");
        }
        for station in 0..self.stations {
            for area in ['Q', 'I'] {
                let mut signal = |name: &str, place: &str, rest: &str| {
                    let _ = writeln!(
                        text,
                        "[[signal]]\nname = \"{name}{area}{station}\"\naddress = \"%{area}{place}\"\n{rest}\nstation = \"s{station}\""
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
