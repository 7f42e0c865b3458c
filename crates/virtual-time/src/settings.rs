//! What a server is told before the run.

use tickbus_base::time::Nanos;

/// How a server runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The virtual time of one step, above zero.
    pub step: Nanos,
    /// When the run begins.
    pub start: StartCondition,
    /// How many steps the run has; `None` runs until it is stopped.
    pub steps: Option<u64>,
    /// How fast it runs at most.
    pub pacing: Pacing,
    /// Whether it begins paused.
    pub paused: bool,
    /// How long a client may take to answer. Wall-clock time never changes a result: it only ends a run that hangs.
    pub hang: Nanos,
    /// How long the clients may take to join, all in all.
    pub join: Nanos,
}

/// When a run begins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StartCondition {
    /// When clients with these names have joined; others are refused.
    Names(Vec<String>),
    /// When this many clients have joined, whatever their names.
    Count(usize),
}

/// How fast virtual time passes at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pacing {
    /// As fast as the clients can.
    Fast,
    /// This many times as fast as the wall clock: 1 is real time. Above zero. Steps that come late are not made up for.
    Times(f64),
}

impl Settings {
    /// A run as fast as possible, in steps of `step`, that begins under the condition `start` and ends when stopped; a
    /// client may take ten seconds to answer, and any time to join.
    pub const fn new(step: Nanos, start: StartCondition) -> Self {
        Self {
            step,
            start,
            steps: None,
            pacing: Pacing::Fast,
            paused: false,
            hang: Nanos::from_secs(10),
            join: Nanos::MAX,
        }
    }
}
