//! Runs many worlds, on one processor or on all, and keeps the findings.

use std::any::Any;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread;

use tickbus_base::time::{Clock, Nanos};

use crate::broken::Broken;
use crate::pairs::Pairs;
use crate::plan::Plan;
use crate::seed::Seed;

/// The distance between the seed numbers of two processors, so that no world runs twice.
const APART: u64 = 1_000_000_000;

/// The promise of a world that panicked.
const PANIC: &str = "panic";

/// A world that broke a promise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The promise, and the observation.
    pub broken: Broken,
    /// The world.
    pub seed: Seed,
    /// A smaller world that breaks the same promise.
    pub small: Seed,
    /// The features of the smaller world.
    pub features: Vec<&'static str>,
}

impl Finding {
    /// Shrinks a world that broke a promise.
    fn of(seed: Seed, broken: Broken) -> Self {
        // A panic leaves its thread in a state that further worlds cannot rely on.
        let small = if broken.promise == PANIC {
            seed
        } else {
            seed.shrunk(broken.promise)
        };
        Self {
            features: Plan::draw(small).features(),
            broken,
            seed,
            small,
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { broken, seed, .. } = self;
        let features = self.features.join(", ");
        write!(
            f,
            "{broken}\n  seed {seed}; smaller, with {features}:\n  worlds {}",
            self.small
        )
    }
}

/// A run of many worlds.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// The number of worlds.
    pub worlds: u64,
    /// The worlds that broke a promise.
    pub findings: Vec<Finding>,
    /// The pairs of features that have met.
    pub pairs: Pairs,
}

impl Run {
    /// Runs worlds from `first` on until `limit` has passed; passes each finding to `report` at once.
    ///
    /// A world that panics is a finding, and ends the run.
    pub fn on_one(first: Seed, limit: Nanos, clock: &dyn Clock, report: &dyn Fn(&Finding)) -> Self {
        let begun = clock.now();
        let mut run = Self::default();
        let mut next = first;
        while clock.now() - begun < limit {
            let seed = next;
            next = seed.next();
            let plan = Plan::draw(seed);
            run.pairs.add(&plan);
            run.worlds += 1;
            let outcome = catch_unwind(AssertUnwindSafe(|| plan.run()));
            let outcome = outcome.unwrap_or_else(|panic| {
                Err(Broken {
                    promise: PANIC,
                    what: message(&*panic),
                })
            });
            let Err(broken) = outcome else { continue };
            let finding = Finding::of(seed, broken);
            report(&finding);
            let is_panic = finding.broken.promise == PANIC;
            run.findings.push(finding);
            if is_panic {
                break;
            }
        }
        run
    }

    /// Runs worlds on `processors` threads until `limit` has passed; any of the threads passes each finding to `report`
    /// at once.
    ///
    /// # Panics
    ///
    /// The system starts no thread.
    pub fn on_all(
        first: Seed,
        limit: Nanos,
        processors: usize,
        clock: &dyn Clock,
        report: &(dyn Fn(&Finding) + Sync),
    ) -> Self {
        let mut all = Self::default();
        thread::scope(|scope| {
            let start = |first| scope.spawn(move || Self::on_one(first, limit, clock, report));
            let threads: Vec<_> = firsts(first, processors).map(start).collect();
            for thread in threads {
                all.merge(thread.join().expect("panics of worlds are findings"));
            }
        });
        all
    }

    /// Adds another run.
    pub fn merge(&mut self, other: Self) {
        self.worlds += other.worlds;
        self.findings.extend(other.findings);
        self.pairs.merge(&other.pairs);
    }
}

/// The first seed of each processor.
fn firsts(first: Seed, processors: usize) -> impl Iterator<Item = Seed> {
    (0..processors as u64).map(move |processor| Seed {
        number: first.number.wrapping_add(processor * APART),
        ..first
    })
}

/// The message of a panic, on one line.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    let text = text.unwrap_or_else(|| "without a message".to_owned());
    text.lines().collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use tickbus_base::time::Monotonic;

    use super::*;

    fn run_of(first: u64, worlds: u64) -> Run {
        let mut run = Run {
            worlds,
            ..Run::default()
        };
        for number in first..first + worlds {
            run.pairs.add(&Plan::draw(number));
        }
        let broken = Broken {
            promise: "order",
            what: format!("in {first}"),
        };
        run.findings.push(Finding {
            broken,
            seed: first.into(),
            small: first.into(),
            features: vec!["socket"],
        });
        run
    }

    #[test]
    fn merged_runs_count_as_one_run_does() {
        let (mut merged, other) = (run_of(0, 60), run_of(60, 40));
        let findings = [&merged.findings[..], &other.findings[..]].concat();
        merged.merge(other);
        let whole = run_of(0, 100);
        assert_eq!(merged.worlds, 100);
        assert_eq!(merged.findings, findings);
        assert_eq!(merged.pairs, whole.pairs);
        assert!(merged.pairs.met() > 100, "{}", merged.pairs.met());
    }

    #[test]
    fn all_processors_run_worlds_of_their_own() {
        let clock = Monotonic::shared();
        let first = Seed::from(4711);
        let report = |finding: &Finding| panic!("{finding}");
        let limit = Nanos::from_millis(200);
        let run = Run::on_all(first, limit, 2, &*clock, &report);
        assert!(run.worlds >= 2, "{} worlds", run.worlds);
        let numbers: Vec<u64> = firsts(first, 3).map(|seed| seed.number).collect();
        assert_eq!(numbers, [4711, 4711 + APART, 4711 + 2 * APART]);
        assert!(run.pairs.met() > 0, "no pair has met");
    }
}
