//! When a fault begins and ends.

use super::{Begin, Fault, Lasts, TickTime};
use tickbus_image::signal::Slot;

/// The life of a fault, tick by tick.
#[derive(Debug)]
pub(super) struct Schedule {
    begin: Begin,
    lasts: Lasts,
    /// How many more times the fault may begin.
    left: u64,
    state: State,
    /// True if the fault must end at the next tick in any case.
    told_to_end: bool,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// `was` is the value of the condition at the previous tick.
    Waiting {
        was: bool,
    },
    Active(TickTime),
    Over,
}

/// The change at a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    Nothing,
    Begins,
    /// The fault may begin again.
    Pauses,
    /// The fault is over for good.
    Ends,
}

impl Schedule {
    pub(super) fn new(fault: &Fault) -> Self {
        Self {
            begin: fault.begin.clone(),
            lasts: fault.lasts,
            left: fault.times,
            state: State::Waiting { was: false },
            told_to_end: false,
        }
    }

    pub(super) fn is_active(&self) -> bool {
        matches!(self.state, State::Active(_))
    }

    /// Makes the fault end at the next tick.
    pub(super) fn end(&mut self) {
        self.told_to_end = true;
    }

    /// One tick, on the true values of the signals.
    pub(super) fn step(&mut self, moment: TickTime, slots: &[Slot]) -> Step {
        match self.state {
            State::Over => Step::Nothing,
            _ if self.told_to_end => {
                self.state = State::Over;
                Step::Ends
            }
            State::Waiting { was } => {
                if self.begins(moment, slots, was) {
                    self.state = State::Active(moment);
                    self.left -= 1;
                    Step::Begins
                } else {
                    Step::Nothing
                }
            }
            State::Active(since) => {
                let (over, was) = self.is_up(since, moment, slots);
                if !over {
                    Step::Nothing
                } else if self.left > 0 {
                    self.state = State::Waiting { was };
                    Step::Pauses
                } else {
                    self.state = State::Over;
                    Step::Ends
                }
            }
        }
    }

    fn begins(&mut self, moment: TickTime, slots: &[Slot], was: bool) -> bool {
        match &self.begin {
            Begin::AtOnce => true,
            Begin::At(time) => moment.time >= *time,
            Begin::Tick(tick) => moment.tick >= *tick,
            Begin::While(condition) => condition.holds(slots),
            Begin::When(condition) => {
                let is = condition.holds(slots);
                self.state = State::Waiting { was: is };
                is && !was
            }
        }
    }

    /// Returns true if the fault ends at this tick, and the value of its condition.
    fn is_up(&self, since: TickTime, moment: TickTime, slots: &[Slot]) -> (bool, bool) {
        let (ends, is) = match &self.begin {
            Begin::While(condition) => {
                let is = condition.holds(slots);
                (!is, is)
            }
            Begin::When(condition) => (false, condition.holds(slots)),
            _ => (false, false),
        };
        let over = match self.lasts {
            Lasts::UntilEnded => false,
            Lasts::For(time) => moment.time - since.time >= time,
            Lasts::Ticks(ticks) => moment.tick.saturating_sub(since.tick) >= ticks,
        };
        (ends || over, is)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::{Condition, Effect, SignalEffect};
    use tickbus_base::time::Nanos;
    use tickbus_image::signal::{Area, DataType, Signal, SignalTable};

    fn table() -> SignalTable {
        let signal = Signal::new("a", Area::Input, 0, DataType::Bool);
        SignalTable::of_one_station(1, 0, vec![signal])
    }

    fn when() -> Condition {
        Condition::parse("a == 1", &table()).expect("a condition")
    }

    /// Runs a fault over the levels of a signal, one per tick of 10 ms; `#` marks the ticks at which it is
    /// active.
    fn run(begin: Begin, lasts: Lasts, times: u64, levels: &str) -> String {
        let fault = Fault {
            name: "x".to_owned(),
            effect: Effect::Signal(0, SignalEffect::Invert),
            begin,
            lasts,
            times,
            seed: 1,
        };
        let mut schedule = Schedule::new(&fault);
        let mut seen = String::new();
        for (index, level) in levels.bytes().enumerate() {
            let moment = TickTime {
                time: Nanos::from_millis(10 * i64::try_from(index).unwrap()),
                tick: index as u64 + 1,
            };
            if level == b'X' {
                schedule.end();
            }
            let level = f64::from(u8::from(level == b'1'));
            schedule.step(moment, &[Slot::from_real(level)]);
            seen.push(if schedule.is_active() { '#' } else { '.' });
        }
        seen
    }

    #[test]
    fn every_trigger_and_every_end() {
        let span = Nanos::from_millis;
        let (ever, three) = (Lasts::UntilEnded, Lasts::Ticks(3));
        for (begin, lasts, times, levels, expected) in [
            (Begin::AtOnce, ever, 1, "000000", "######"),
            (Begin::AtOnce, ever, 1, "000X00", "###..."),
            (Begin::AtOnce, three, 1, "000000", "###..."),
            (Begin::Tick(3), three, 1, "0000000", "..###.."),
            (Begin::Tick(3), ever, 1, "0X00000", "......."),
            (
                Begin::At(span(20)),
                Lasts::For(span(20)),
                1,
                "0000000",
                "..##...",
            ),
            // A time between two ticks takes effect at the later one.
            (
                Begin::At(span(15)),
                Lasts::For(span(15)),
                1,
                "0000000",
                "..##...",
            ),
            (Begin::When(when()), ever, 1, "00110000", "..######"),
            (Begin::When(when()), three, 1, "0010001000", "..###....."),
            (Begin::When(when()), three, 2, "0010001000", "..###.###."),
            // A condition that is true from the start must become false before it can become true.
            (Begin::When(when()), three, 2, "1111110110", "###....###"),
            (
                Begin::While(when()),
                ever,
                u64::MAX,
                "011011000",
                ".##.##...",
            ),
            (
                Begin::While(when()),
                ever,
                u64::MAX,
                "0110X1100",
                ".##......",
            ),
        ] {
            let text = format!("{begin} {lasts} {times}");
            assert_eq!(run(begin, lasts, times, levels), expected, "{text}");
        }
    }
}
