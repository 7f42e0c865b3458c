//! A sweep: one scenario, run again with each fault of a list at each moment of a list.
//!
//! The run without a fault shows when each moment comes: a [`Plan`] is the list of runs. Up to its moment each of them is
//! the run without a fault, bit for bit, then it is compared with that one. Each run stands alone, so any number of
//! threads can share the list.

mod accepted;
mod disturbance;
mod judgement;
mod late;
mod matrix;
mod named;
mod page;
mod plan;
mod progress;
mod section;
mod survey;
mod tally;
mod trial;

use std::path::PathBuf;

pub use accepted::Accepted;
use disturbance::Disturbance;
pub use judgement::{Judgement, verdict_hash};
pub use matrix::{Mark as CellMark, matrix};
pub(super) use named::Named;
pub use page::{swept, swept_run};
pub use plan::{Cell, Plan};
use progress::Mark;
pub(super) use section::Scenario;
pub(super) use survey::{MOST_VALUES, Moment, Survey};
pub use tally::Tally;
use tickbus_image::signal::Slot;
pub(super) use trial::Trial;

use super::test::{Step, TextPosition};

/// The `[sweep]` of a test file.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// The position at which the sweep begins.
    pub place: TextPosition,
    rows: Vec<Row>,
    pub(super) moments: Vec<Moments>,
    pub(super) initial: Vec<(usize, Slot)>,
    pub(super) scenario: Vec<Step>,
    /// Any of these is the program's word that something is wrong. Never empty.
    pub(super) told: Vec<Named>,
    /// None of these may hold.
    pub(super) never: Vec<Named>,
    /// The changes of these are the progress. Never empty.
    goes_on: Vec<Mark>,
    /// The ticks in which the program tells a fault, or continues.
    within: u64,
    /// How many ticks sooner than without a fault a change may come.
    tolerance: u64,
    accepted: PathBuf,
    /// The command that accepts all verdicts.
    accept: &'static str,
}

/// One fault of a sweep, or a pair of them: a row of the matrix.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    /// The name of the disturbed signal or station; empty for the whole line.
    subject: String,
    /// The kind of fault, with its numbers if they are not the usual ones; of a pair the second fault.
    kind: String,
    /// The faults, which come at the same moment. Never empty.
    disturbances: Vec<Disturbance>,
}

impl Row {
    /// The name of the fault: `Level stuck-on`, `line-down`.
    fn name(&self) -> String {
        format!("{} {}", self.subject, self.kind)
            .trim_start()
            .to_owned()
    }

    /// Both faults at once.
    fn and(&self, other: &Self) -> Self {
        Self {
            subject: self.name(),
            kind: format!("+ {}", other.name()),
            disturbances: [&self.disturbances[..], &other.disturbances].concat(),
        }
    }
}

/// Moments as the file states them.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Moments {
    /// Each value that the signal with this index takes.
    EachValue(usize, TextPosition),
    /// The first time that a condition holds.
    First(Named),
}
