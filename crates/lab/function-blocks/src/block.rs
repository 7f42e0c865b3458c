//! The blocks.

use tickbus_base::time::Nanos;
use tickbus_plc::blocks::{Ctu, Rs, Tof, Ton, Tp};

use crate::week::{Cam, WallTime};
use crate::wires::{Quantity, Signals, Wire};

/// The kind of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    And,
    Or,
    Xor,
    Not,
    Rs,
    OnDelay,
    OffDelay,
    Pulse,
    Counter,
    WeeklyTimer,
    Comparator,
    Hysteresis,
}

impl Kind {
    /// All kinds, with their names in programs.
    pub(crate) const NAMES: [(&str, Self); 12] = [
        ("AND", Self::And),
        ("OR", Self::Or),
        ("XOR", Self::Xor),
        ("NOT", Self::Not),
        ("RS", Self::Rs),
        ("on-delay", Self::OnDelay),
        ("off-delay", Self::OffDelay),
        ("pulse", Self::Pulse),
        ("counter", Self::Counter),
        ("weekly-timer", Self::WeeklyTimer),
        ("comparator", Self::Comparator),
        ("hysteresis", Self::Hysteresis),
    ];
}

/// A block with its wires, its parameters and its memory.
#[derive(Clone, Debug)]
pub(crate) enum Block {
    And(Vec<Wire>),
    Or(Vec<Wire>),
    Xor([Wire; 2]),
    Not(Wire),
    Rs {
        set: Wire,
        reset: Wire,
        memory: Rs,
    },
    OnDelay {
        input: Wire,
        time: Nanos,
        timer: Ton,
    },
    OffDelay {
        input: Wire,
        time: Nanos,
        timer: Tof,
    },
    Pulse {
        input: Wire,
        time: Nanos,
        timer: Tp,
    },
    Counter {
        input: Wire,
        reset: Option<Wire>,
        limit: i16,
        counter: Ctu,
    },
    WeeklyTimer(Vec<Cam>),
    Comparator {
        a: Quantity,
        b: Quantity,
    },
    Hysteresis {
        input: Quantity,
        on: f64,
        off: f64,
    },
}

impl Block {
    /// Evaluates the block at `place`. Returns when it would change without any other change; [`Nanos::MAX`] if never.
    pub(crate) fn evaluate(
        &mut self,
        place: usize,
        signals: &mut Signals,
        now: Nanos,
        wall: WallTime,
    ) -> Nanos {
        let mut due = Nanos::MAX;
        let is_on = match self {
            Self::And(wires) => wires.iter().all(|wire| signals.is_on(*wire)),
            Self::Or(wires) => wires.iter().any(|wire| signals.is_on(*wire)),
            Self::Xor([a, b]) => signals.is_on(*a) != signals.is_on(*b),
            Self::Not(wire) => !signals.is_on(*wire),
            Self::Rs { set, reset, memory } => {
                memory.call(signals.is_on(*set), signals.is_on(*reset))
            }
            Self::OnDelay { input, time, timer } => {
                let input = signals.is_on(*input);
                let is_on = timer.call(now, input, *time);
                if input && !is_on {
                    due = now + (*time - timer.et);
                }
                is_on
            }
            Self::OffDelay { input, time, timer } => {
                let input = signals.is_on(*input);
                let is_on = timer.call(now, input, *time);
                if is_on && !input {
                    due = now + (*time - timer.et);
                }
                is_on
            }
            Self::Pulse { input, time, timer } => {
                let is_on = timer.call(now, signals.is_on(*input), *time);
                if is_on {
                    due = now + (*time - timer.et);
                }
                is_on
            }
            Self::Counter {
                input,
                reset,
                limit,
                counter,
            } => {
                let reset = reset.is_some_and(|wire| signals.is_on(wire));
                let is_on = counter.call(signals.is_on(*input), reset, *limit);
                signals.counts[place] = counter.cv;
                is_on
            }
            Self::WeeklyTimer(cams) => {
                let changes = cams.iter().map(|cam| cam.until_change(wall));
                due = changes.min().map_or(due, |span| now + span);
                cams.iter().any(|cam| cam.is_on(wall))
            }
            Self::Comparator { a, b } => signals.number(*a) > signals.number(*b),
            Self::Hysteresis { input, on, off } => {
                let number = signals.number(*input);
                let (is_past_on, is_past_off) = if on > off {
                    (number >= *on, number <= *off)
                } else {
                    (number <= *on, number >= *off)
                };
                is_past_on || (signals.blocks[place] && !is_past_off)
            }
        };
        signals.blocks[place] = is_on;
        due
    }
}
