//! The pairs of features that have met in a world, and those that never meet.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use crate::bus::Bus;
use crate::features;
use crate::plan::{Plan, all_features};

/// The number of each feature in [`all_features`].
static NUMBERS: LazyLock<BTreeMap<&'static str, usize>> = LazyLock::new(|| {
    let names = all_features().into_iter().enumerate();
    names.map(|(number, name)| (name, number)).collect()
});

/// Further features that no world has together, with the reason.
const APART: [(&[&str], &[&str], &str); 4] = [
    (
        &["stations"],
        &["s7"],
        "an S7 client of these worlds dials one station",
    ),
    (
        &["stations"],
        &["heartbeat", "alive", "hosted device", "hosted controller"],
        "programs and signs of life are those of a line with one station",
    ),
    (
        &["loopback"],
        &["bytes held", "reset", "killed"],
        "a loopback has no network, and both ends are one process",
    ),
    (
        &["hosted device"],
        &["hosted controller"],
        "one end at most is a program",
    ),
];

/// The number of worlds that had both features of a pair.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pairs {
    /// By the numbers of both features, the lower one first.
    counts: Vec<u64>,
}

impl Default for Pairs {
    fn default() -> Self {
        Self {
            counts: vec![0; NUMBERS.len() * NUMBERS.len()],
        }
    }
}

fn place(one: usize, other: usize) -> usize {
    one.min(other) * NUMBERS.len() + one.max(other)
}

impl Pairs {
    /// Counts a world that is about to run.
    pub fn add(&mut self, plan: &Plan) {
        let features = plan.features();
        let numbers: Vec<usize> = features.iter().map(|name| NUMBERS[name]).collect();
        for (index, one) in numbers.iter().enumerate() {
            for other in &numbers[index + 1..] {
                self.counts[place(*one, *other)] += 1;
            }
        }
    }

    /// Adds the counts of other worlds.
    pub fn merge(&mut self, other: &Self) {
        for (count, further) in self.counts.iter_mut().zip(&other.counts) {
            *count += further;
        }
    }

    /// The number of worlds that had both features.
    pub(crate) fn count(&self, one: &str, other: &str) -> u64 {
        self.counts[place(NUMBERS[one], NUMBERS[other])]
    }

    /// The number of pairs that have met.
    pub fn met(&self) -> usize {
        self.counts.iter().filter(|count| **count > 0).count()
    }

    /// The pairs that could have met but have not.
    pub(crate) fn strangers(&self) -> Vec<[&'static str; 2]> {
        let pairs = all_pairs()
            .filter(|[one, other]| self.count(one, other) == 0 && never_meet(one, other).is_none());
        pairs.collect()
    }
}

/// All pairs of features.
fn all_pairs() -> impl Iterator<Item = [&'static str; 2]> {
    let features = all_features();
    let pairs = (0..features.len()).flat_map(|one| (0..one).map(move |other| [other, one]));
    pairs.map(move |pair| pair.map(|number| features[number]))
}

/// The number of pairs that can meet.
pub(crate) fn possible() -> usize {
    let pairs = all_pairs().filter(|[one, other]| never_meet(one, other).is_none());
    pairs.count()
}

/// The reason why no world has both features; `None` if one can.
pub(crate) fn never_meet(one: &str, other: &str) -> Option<&'static str> {
    let is_bus = |name| Bus::NAMES.contains(&name);
    if is_bus(one) && is_bus(other) {
        return Some("a world has one bus");
    }
    let of_dispatcher = |name: &str| name.starts_with("dispatcher");
    let other_bus = |name| is_bus(name) && !of_dispatcher(name);
    let late = |name: &str| features::NAMES.contains(&name);
    let apart = |one, other| {
        if of_dispatcher(one) && other_bus(other) {
            return Some("a world has one bus");
        }
        if of_dispatcher(one) && late(other) {
            return Some("a dispatcher has one station, and no room beside its values");
        }
        let mut apart = APART.iter();
        let found = apart.find(|(some, others, _)| some.contains(&one) && others.contains(&other));
        found.map(|(_, _, why)| *why)
    };
    apart(one, other).or_else(|| apart(other, one))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_that_never_meet_do_not_and_nearly_all_others_do() {
        let mut pairs = Pairs::default();
        for number in 0..20_000_u64 {
            pairs.add(&Plan::draw(number));
        }
        for [one, other] in all_pairs() {
            if let Some(why) = never_meet(one, other) {
                assert_eq!(pairs.count(one, other), 0, "{one} + {other}, though {why}");
            }
        }
        let strangers = pairs.strangers();
        assert_eq!(strangers.len() + pairs.met(), possible());
        assert!(strangers.len() < possible() / 20, "{strangers:?}");
    }
}
