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

impl Examination<'_> {
    /// How often values are read while they are watched.
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
        let mut rounds = Vec::new();
        for number in 0..Self::ROUNDS {
            clock.wait_until(begin + pause.times(i64::from(number)), self.stop);
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
        let [first, rest @ ..] = rounds else {
            return;
        };
        let changes = |signal: usize| {
            let value = |round: &Round| round.values.get(signal).cloned();
            rest.iter().any(|round| value(round) != value(first))
        };
        let span = rounds
            .last()
            .map_or(Nanos::ZERO, |last| last.begin - first.begin);
        let span = Nanos(span.0 / 1_000_000 * 1_000_000);
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
        let still = self
            .watched
            .iter()
            .find(|(signal, within)| *within < span && !changes(*signal));
        if let Some((signal, within)) = still {
            let name = &signals[*signal].name;
            self.fail(
                "age",
                "life-sign-still",
                format!("\"{name}\" did not change within {span}, and has to within {within}"),
                "see whether the PLC is in RUN, and whether its program counts the signal up; check its address",
            );
            return;
        }
        let changed = (0..signals.len()).filter(|signal| changes(*signal)).count();
        self.ok(
            "age",
            format!(
                "a reading takes {usual} (max_age is {max_age}); {changed} of {} signals changed within {span}",
                signals.len()
            ),
        );
    }
}
