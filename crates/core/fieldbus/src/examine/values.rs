//! Values that were read several times: whether they change, and how long a round takes.

use tickbus_base::time::Nanos;

use super::Examination;

/// One reading of all signals.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Round {
    /// When the reading began.
    pub begin: Nanos,
    /// How long the reading took, with as few requests as the driver makes.
    pub took: Nanos,
    /// The bytes of each signal of the table, in the order of the table; empty if it could not be read.
    pub values: Vec<Vec<u8>>,
}

/// The pauses of further rounds, in 29ths of the usual pause. They are uneven: a bit that blinks in step with even pauses
/// would always be met in the same state.
const UNEVEN: [i64; 12] = [3, 7, 4, 11, 5, 9, 2, 13, 6, 10, 8, 12];

impl Examination<'_> {
    /// How often values are read while they are watched; a sign of life that does not change then is read some more times.
    pub const ROUNDS: u32 = 5;

    /// How long values have to be watched: as configured, and a little longer than each sign of life needs, up to 10 s.
    pub fn watching(&self) -> Nanos {
        const LONGEST: Nanos = Nanos::from_secs(10);
        let life = self
            .watched
            .iter()
            .map(|(_, within)| *within + Nanos::from_millis(100));
        life.max()
            .unwrap_or(Nanos::ZERO)
            .min(LONGEST)
            .max(self.watch)
    }

    /// Reads all values several times by `read`, which returns nothing once the connection has ended; the step `age`.
    pub fn watch_values(&mut self, mut read: impl FnMut() -> Option<Round>) {
        let clock = self.setup.clock;
        let span = self.watching();
        let pause = Nanos(span.0 / i64::from(Self::ROUNDS - 1));
        let begin = clock.now();
        let mut due = begin;
        let mut rounds = Vec::new();
        let even = (1..Self::ROUNDS).map(|_| pause);
        let uneven = UNEVEN.map(|part| Nanos(pause.0 / 29 * part));
        let pauses = std::iter::once(Nanos::ZERO).chain(even).chain(uneven);
        for pause in pauses {
            if rounds.len() >= Self::ROUNDS as usize && self.still(&rounds).is_none() {
                break;
            }
            due += pause;
            clock.wait_until(due, self.stop);
            let Some(round) = read() else {
                let after = clock.now() - begin;
                self.fail(
                    "age",
                    "connection-lost",
                    format!("the connection ended after {after} of reading"),
                    "see whether the PLC restarts, or closes connections that are idle or too many",
                );
                return;
            };
            rounds.push(round);
        }
        self.judge_age(&rounds);
    }

    fn judge_age(&mut self, rounds: &[Round]) {
        let max_age = self.setup.max_age;
        // The median: one late answer is no slow line. Microseconds are enough for people.
        let mut took: Vec<Nanos> = rounds.iter().map(|round| round.took).collect();
        took.sort_unstable();
        let usual = took.get(took.len() / 2).copied().unwrap_or_default();
        let usual = Nanos(usual.0 / 1000 * 1000);
        let span = watched_for(rounds);
        if usual > max_age {
            self.fail(
                "age",
                "too-slow",
                format!("reading all signals takes {usual}, and max_age is {max_age}"),
                "set max_age to at least three times that, read fewer signals, or relieve the PLC",
            );
            return;
        }
        let signals = &self.setup.table.signals;
        if let Some((signal, within)) = self.still(rounds) {
            let name = &signals[signal].name;
            self.fail(
                "age",
                "life-sign-still",
                format!("\"{name}\" did not change within {span}, and has to within {within}"),
                "see whether the PLC is in RUN, and whether its program counts the signal up; check its address",
            );
            return;
        }
        let changed = (0..signals.len())
            .filter(|signal| changes(rounds, *signal))
            .count();
        self.ok(
            "age",
            format!(
                "a reading takes {usual} (max_age is {max_age}); {changed} of {} signals changed within {span}",
                signals.len()
            ),
        );
    }

    /// A sign of life that did not change, and the time within which it has to.
    fn still(&self, rounds: &[Round]) -> Option<(usize, Nanos)> {
        let span = watched_for(rounds);
        let mut watched = self.watched.iter().copied();
        watched.find(|(signal, within)| *within < span && !changes(rounds, *signal))
    }
}

/// True if a signal has not the same value in all rounds.
fn changes(rounds: &[Round], signal: usize) -> bool {
    let mut values = rounds.iter().map(|round| round.values.get(signal));
    let first = values.next();
    values.any(|value| Some(value) != first)
}

/// The time from the first round to the last one, in milliseconds.
fn watched_for(rounds: &[Round]) -> Nanos {
    let (Some(first), Some(last)) = (rounds.first(), rounds.last()) else {
        return Nanos::ZERO;
    };
    Nanos((last.begin - first.begin).0 / 1_000_000 * 1_000_000)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BusSetup, Events, Role};
    use std::path::Path;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicI64, Ordering};
    use std::time::Duration;
    use tickbus_base::time::{Clock, Stop};
    use tickbus_image::signal::{Area, DataType, Signal, SignalTable};

    /// A clock that passes by waiting alone.
    #[derive(Debug, Default)]
    struct Waiting(AtomicI64);

    impl Clock for Waiting {
        fn now(&self) -> Nanos {
            Nanos(self.0.load(Ordering::Relaxed))
        }

        fn wait_until(&self, deadline: Nanos, _: &Stop) {
            self.0.store(deadline.0, Ordering::Relaxed);
        }

        fn wait_with(&self, _: Nanos, _: &Stop, sleep: &mut dyn FnMut(Option<Duration>)) {
            sleep(Some(Duration::ZERO));
        }
    }

    /// The cause of the step `age`, for a bit that changes after each `half`, and the number of readings.
    fn blinking(half: Nanos, watch: Nanos) -> (Option<&'static str>, usize) {
        let signals = vec![Signal::new("Life", Area::Output, 0, DataType::Bool)];
        let table = SignalTable::of_one_station(0, 1, signals);
        let clock: Arc<dyn Clock> = Arc::new(Waiting::default());
        let stop = Stop::new();
        let setup = BusSetup {
            name: "x",
            id: 1,
            folder: Path::new(""),
            role: Role::Device,
            table: &table,
            cycle: None,
            max_age: Nanos::from_millis(100),
            events: Events::None,
            clock: &clock,
            hosted: None,
        };
        let watched = vec![(0, Nanos::from_millis(600))];
        let mut examination = Examination::new(setup, watched, watch, &stop);
        let mut readings = 0;
        examination.watch_values(|| {
            readings += 1;
            let begin = clock.now();
            let values = vec![vec![u8::from(begin.0 / half.0 % 2 == 1)]];
            let took = Nanos::from_millis(1);
            Some(Round {
                begin,
                took,
                values,
            })
        });
        (examination.steps[0].cause, readings)
    }

    #[test]
    fn a_sign_of_life_that_blinks_in_step_with_the_readings_is_seen() {
        for (watch, half) in [
            (1000, 125),
            (2000, 250),
            (2000, 125),
            (1000, 25),
            (4000, 500),
        ] {
            let (watch, half) = (Nanos::from_millis(watch), Nanos::from_millis(half));
            let (cause, _) = blinking(half, watch);
            assert_eq!(cause, None, "{half} during {watch}");
        }
        let second = Nanos::from_secs(1);
        assert_eq!(blinking(Nanos::from_millis(300), second), (None, 5));
        let still = blinking(Nanos::from_secs(100), second);
        assert_eq!(still, (Some("life-sign-still"), 17));
    }
}
