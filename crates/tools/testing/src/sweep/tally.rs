//! The runs of a sweep, counted by their verdicts.

use std::collections::BTreeMap;
use std::fmt;

use super::accepted::Accepted;
use super::judgement::Judgement;
use super::plan::{Cell, Plan};

/// The word for a run that cannot be judged.
const WRONG: &str = "wrong";

/// The runs of a sweep, counted by their verdicts. Displayed as the line below the matrix.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    runs: usize,
    words: BTreeMap<&'static str, usize>,
    accepted: usize,
    without_why: usize,
}

impl Tally {
    /// Counts a run, which passes or does not.
    pub fn add(
        &mut self,
        (plan, accepted): (&Plan, &Accepted),
        cell: &Cell,
        (judgement, passes): (Option<&Judgement>, bool),
    ) {
        let word = judgement.map_or(WRONG, Judgement::word);
        self.runs += 1;
        *self.words.entry(word).or_default() += 1;
        if passes && !judgement.is_some_and(Judgement::is_right) {
            self.accepted += 1;
            self.without_why += usize::from(accepted.why(plan, cell).is_empty());
        }
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "sweep: runs={}", self.runs)?;
        for word in Judgement::WORDS.iter().chain(&[WRONG]) {
            let times = self.words.get(word).copied().unwrap_or_default();
            write!(f, " {word}={times}")?;
        }
        let Self {
            accepted,
            without_why,
            ..
        } = self;
        write!(f, " accepted={accepted} without_why={without_why}")
    }
}
