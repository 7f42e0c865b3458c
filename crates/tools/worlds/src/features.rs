//! Features of a driver.cfg beyond its line. They are drawn from the seed after everything else, so that older seeds
//! keep their worlds.

use crate::bus::Bus;
use crate::faults::{Effect, FaultPlan, Way};
use crate::random::{Random, scramble};
use crate::seed::Seed;
use crate::typed::Typed;

/// The simulation time that an end hands in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Times {
    /// No time: the clock counts.
    Clock,
    /// This many nanoseconds more in each tick.
    Steps(i64),
    /// Like `Steps`, but now and then a tick is as early as one before it.
    Back(i64),
}

/// The table `[record]` of an end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordPlan {
    /// True for CSV, false for VCD.
    pub is_csv: bool,
    /// The key `ring`.
    pub ring: Option<u64>,
    /// The maximum length of the file, in bytes.
    pub disk: Option<u64>,
    /// True if others want the same file.
    pub is_contended: bool,
    /// True if the file is cut somewhere after a kill, as by a power failure.
    pub is_torn: bool,
}

/// The features that both ends have beyond the line.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// The recording of each end.
    pub recordings: [Option<RecordPlan>; 2],
    /// The simulation time of each end.
    pub times: [Times; 2],
    /// True if recordings are replayed: by exchanges of the same kind, and by ticks at other times.
    pub replays: bool,
    /// The signals beside the stamps: those that the device reads, and those that the controller reads.
    pub typed: [Vec<Typed>; 2],
    /// Injected faults, and forced signals.
    pub faults: Vec<FaultPlan>,
    /// True for an end that somebody watches.
    pub watched: [bool; 2],
    /// The heartbeat of each end: its interval in ticks, and true if the other end watches it.
    pub beats: [Option<(i64, bool)>; 2],
    /// The end that is a PLC program, scanned by tickbus.
    pub hosted: Option<usize>,
    /// True if pulses come in pairs, the second one while the first is still held.
    pub pairs: bool,
}

impl Features {
    /// The features of a seed.
    pub(crate) fn draw(
        seed: Seed,
        (bus, stations): (Bus, usize),
        numbers: bool,
        max_age: i64,
    ) -> Self {
        // A Modbus client does not write gaps, so values after a gap take a separate request, and are seen later.
        let (first, has_gaps) = match bus {
            Bus::Modbus | Bus::ModbusRtu => (if numbers { 16 } else { 10 }, false),
            _ => (16, true),
        };
        let random = &mut Random::new(scramble(seed.number ^ 0x6D6F_7265));
        // Each feature exists in a quarter of all worlds.
        let has = random.number() & random.number() & u64::from(seed.more);
        // A dispatcher has one station for everything that it carries, and no room beside it.
        let has = if bus == Bus::Dispatcher { 0 } else { has };
        let is = |bit: u32| has >> bit & 1 == 1;
        let recordings = [0, 1].map(|end| {
            let plan = RecordPlan {
                is_csv: random.once_in(2),
                ring: random.once_in(3).then(|| random.of(&[1, 4, 16, 64])),
                disk: random
                    .once_in(3)
                    .then(|| random.below(30_000))
                    .filter(|_| is(2)),
                is_contended: is(3) && random.once_in(2),
                is_torn: is(4) && random.once_in(2),
            };
            is(end).then_some(plan)
        });
        let times = [5, 6].map(|bit| {
            let step = random.of(&[1, 1_000, 999_999, 10_000_000]);
            let times = random.of(&[Times::Steps(step), Times::Back(step)]);
            if is(bit) { times } else { Times::Clock }
        });
        let typed = [8, 9].map(|bit| {
            let typed = Typed::draw(random, first, has_gaps);
            if is(bit) { typed } else { Vec::new() }
        });
        let faults = FaultPlan::draw(random, numbers, max_age).into_iter();
        let faults = faults.filter(|fault| match fault.way {
            Way::Forced => is(11),
            _ if fault.is_of_line() => is(12),
            _ => is(10),
        });
        let mut features = Self {
            hosted: None,
            pairs: is(18),
            beats: [None; 2],
            faults: faults.collect(),
            watched: [13, 14].map(is),
            typed,
            recordings,
            times,
            replays: is(7),
        };
        let hosted = usize::try_from(random.below(2)).expect("small");
        features.beats = [16, 17].map(|bit| {
            let beat = (random.of(&[1, 3]), random.once_in(2));
            (is(bit) && stations == 1).then_some(beat)
        });
        if is(15) && stations == 1 {
            features.host(hosted);
        }
        features
    }

    /// Makes an end a program: it has no recording, passes no time, and its faults are those of its driver.cfg.
    fn host(&mut self, end: usize) {
        self.hosted = Some(end);
        self.recordings[end] = None;
        self.watched[end] = false;
        // The program decides on its own heartbeat.
        self.beats[end] = None;
        self.faults
            .retain(|fault| fault.end != end || fault.way == Way::File);
    }

    /// The names of the features.
    pub(crate) fn names(&self) -> Vec<&'static str> {
        let mut names = Vec::new();
        let mut add = |is: bool, name| {
            if is {
                names.push(name);
            }
        };
        let any = |test: &dyn Fn(&RecordPlan) -> bool| {
            self.recordings
                .iter()
                .any(|plan| plan.as_ref().is_some_and(test))
        };
        add(any(&|plan| plan.is_csv), "record csv");
        add(any(&|plan| !plan.is_csv), "record vcd");
        add(any(&|plan| plan.ring.is_some()), "small ring");
        add(any(&|plan| plan.disk.is_some()), "full disk");
        add(any(&|plan| plan.is_contended), "file in use");
        add(any(&|plan| plan.is_torn), "torn file");
        add(any(&|_| self.replays), "replay");
        let has = |test: &dyn Fn(Times) -> bool| self.times.iter().any(|times| test(*times));
        add(has(&|times| matches!(times, Times::Steps(_))), "own time");
        add(
            has(&|times| matches!(times, Times::Back(_))),
            "time goes back",
        );
        let typed = |test: &dyn Fn(&Typed) -> bool| self.typed.iter().flatten().any(test);
        add(typed(&|typed| typed.order != "ABCD"), "byte order");
        add(typed(&|typed| typed.scale.is_some()), "scale");
        add(typed(&|typed| typed.is_split), "bytes read");
        for number in [8, 16, 32, 64] {
            let name = match number {
                8 => "8 bits",
                16 => "16 bits",
                32 => "32 bits",
                _ => "64 bits",
            };
            add(typed(&|typed| typed.bits == number), name);
        }
        let beats = self.beats.iter().flatten();
        add(beats.clone().count() > 0, "heartbeat");
        add(beats.clone().any(|(_, is_watched)| *is_watched), "alive");
        add(self.pairs, "pairs of pulses");
        add(self.hosted == Some(0), "hosted device");
        add(self.hosted == Some(1), "hosted controller");
        add(self.watched.contains(&true), "watched");
        for fault in &self.faults {
            let name = match fault.effect {
                _ if fault.way == Way::Forced => "forced",
                Effect::Stuck(..) => "stuck",
                Effect::Invert(_) => "inverted",
                Effect::Offset(..) => "offset",
                Effect::Noise(..) | Effect::Flicker(_) => "noise",
                Effect::Delay(_) => "delay",
                Effect::LateValues(_) => "late values",
                Effect::Drop(_) => "dropped frames",
                Effect::Duplicate(_) => "duplicate",
                Effect::LinkDown => "link down",
            };
            add(true, name);
        }
        names.sort_unstable();
        names.dedup();
        names
    }

    /// The maximum number of bytes of a station in one direction.
    pub(crate) fn frame(&self) -> usize {
        let typed = self.typed.iter().flatten();
        typed.map(|typed| typed.place + 8).max().unwrap_or(16)
    }

    /// The signals beside the stamps in one direction.
    pub(crate) fn beside(&self, area: char) -> &[Typed] {
        &self.typed[usize::from(area == 'I')]
    }
}

/// The names of all features that are drawn here.
pub(crate) const NAMES: &[&str] = &[
    "record csv",
    "record vcd",
    "small ring",
    "full disk",
    "file in use",
    "torn file",
    "replay",
    "own time",
    "time goes back",
    "byte order",
    "scale",
    "bytes read",
    "8 bits",
    "16 bits",
    "32 bits",
    "64 bits",
    "heartbeat",
    "alive",
    "pairs of pulses",
    "hosted device",
    "hosted controller",
    "watched",
    "forced",
    "stuck",
    "inverted",
    "offset",
    "noise",
    "delay",
    "late values",
    "dropped frames",
    "duplicate",
    "link down",
];

impl Times {
    /// The time of a tick, from 1.
    pub(crate) fn at(self, tick: u64) -> Option<i64> {
        let tick = i64::try_from(tick).expect("small");
        match self {
            Self::Clock => None,
            Self::Steps(step) => Some(step * tick),
            Self::Back(step) => Some(step * if tick % 7 == 0 { tick - 3 } else { tick }),
        }
    }
}
