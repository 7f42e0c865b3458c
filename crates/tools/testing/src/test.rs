//! Tests as read from a file, and their steps.

use std::sync::Arc;

use tickbus_fieldbus::faults::Fault;
use tickbus_image::signal::Slot;
use tickbus_reply::Condition;

/// Line and column, both from 1.
pub type TextPosition = (usize, usize);

/// One test.
#[derive(Clone, Debug, PartialEq)]
pub struct Test {
    /// The test's name, unique in its file.
    pub name: String,
    /// The position at which the test begins.
    pub place: TextPosition,
    pub(super) initial: Vec<(usize, Slot)>,
    pub(super) steps: Vec<Step>,
}

/// One step: sets signals, lets time pass, and checks expectations, in this order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Step {
    pub(super) place: TextPosition,
    /// The advice if the step fails, for people.
    pub(super) hint: Option<Arc<str>>,
    /// The row of the table that this step is, from 1.
    pub(super) row: Option<usize>,
    pub(super) set: Vec<(usize, Slot)>,
    pub(super) force: Vec<(usize, Slot)>,
    pub(super) release: Vec<usize>,
    pub(super) inject: Vec<(Fault, TextPosition)>,
    /// Faults to end, by name.
    pub(super) end: Vec<(String, TextPosition)>,
    pub(super) passage: Option<Passage>,
    pub(super) expect: Vec<(Condition, TextPosition)>,
    pub(super) unswallowed: Vec<Unswallowed>,
    /// The number of ticks for which the expectations must hold.
    pub(super) during: u64,
    pub(super) always: Vec<(Condition, TextPosition)>,
    pub(super) always_unswallowed: Vec<Unswallowed>,
    pub(super) never: Vec<(Condition, TextPosition)>,
}

impl Step {
    /// True if time passes in this step.
    pub(super) const fn takes_time(&self) -> bool {
        self.passage.is_some() || self.during > 0
    }

    /// True if the step expects that nothing is swallowed.
    pub(super) const fn counts_swallowed(&self) -> bool {
        !self.unswallowed.is_empty() || !self.always_unswallowed.is_empty()
    }
}

/// The expectation that no change of these signals was swallowed since the test began.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unswallowed {
    /// Indexes in the table.
    pub(super) signals: Vec<usize>,
    pub(super) place: TextPosition,
}

/// How time passes in a step.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Passage {
    /// This many ticks.
    Ticks(u64),
    /// This many ticks, with a button pressed.
    Press(usize, u64),
    /// Until all of these hold, for at most this many ticks.
    Await(Vec<(Condition, TextPosition)>, u64),
}
