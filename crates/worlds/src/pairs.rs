//! Which pairs of features have met in a world.

use std::collections::BTreeMap;

use crate::plan::{Plan, all_features};

/// How many worlds had both features of a pair.
#[derive(Clone, Debug, Default)]
pub struct Pairs(BTreeMap<(&'static str, &'static str), u64>);

impl Pairs {
    /// A world is about to be run.
    pub fn add(&mut self, plan: &Plan) {
        let features = plan.features();
        for (index, one) in features.iter().enumerate() {
            for other in &features[index + 1..] {
                *self.0.entry(ordered(one, other)).or_default() += 1;
            }
        }
    }

    /// How many pairs have met.
    pub fn met(&self) -> usize {
        self.0.len()
    }

    /// The pairs that could have met, and have not.
    pub fn strangers(&self) -> Vec<String> {
        let mut strangers = Vec::new();
        let features = all_features();
        for (index, one) in features.iter().enumerate() {
            for other in &features[index + 1..] {
                if !self.0.contains_key(&ordered(one, other)) {
                    strangers.push(format!("{one} + {other}"));
                }
            }
        }
        strangers
    }
}

fn ordered(one: &'static str, other: &'static str) -> (&'static str, &'static str) {
    if one < other {
        (one, other)
    } else {
        (other, one)
    }
}
