//! The neighbours of the drivers: the dispatcher's board, and a run on virtual time. Each is judged against a model
//! that runs from the same seeds.

mod board;
mod lockstep;

use std::fmt;
use std::str::FromStr;

use crate::broken::Broken;
use crate::seed::Seed;

/// A part of tickbus that is judged beside worlds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Neighbour {
    /// The dispatcher, its clients and their lines.
    Board,
    /// A server of virtual time, and two ends in lock-step.
    Lockstep,
}

impl Neighbour {
    /// All neighbours.
    pub const ALL: [Self; 2] = [Self::Board, Self::Lockstep];

    /// The name of the neighbour in the corpus.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Board => "board",
            Self::Lockstep => "lockstep",
        }
    }

    /// Runs the events drawn from this seed, and adds them to `trace`.
    ///
    /// # Errors
    ///
    /// The product and the model differ.
    pub fn run(self, seed: Seed, trace: &mut Vec<String>) -> Result<(), Broken> {
        match self {
            Self::Board => board::run(seed, trace),
            Self::Lockstep => lockstep::run(seed, trace),
        }
    }

    /// The smallest seed found that breaks the same promise.
    #[must_use]
    pub fn shrunk(self, seed: Seed, promise: &str) -> Seed {
        seed.smallest(|seed| {
            let broken = self.run(seed, &mut Vec::new());
            broken.is_err_and(|broken| broken.promise == promise)
        })
    }
}

impl fmt::Display for Neighbour {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Neighbour {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut all = Self::ALL.into_iter();
        all.find(|it| it.name() == text).ok_or_else(|| {
            format!(
                "\"{text}\" is no neighbour; write {}",
                Self::ALL.map(Self::name).join(" or ")
            )
        })
    }
}
