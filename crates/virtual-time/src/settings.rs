//! What a server is told before the run.

use tickbus_base::Mistake;
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

impl Settings {
    /// Checks what does not concern the clients.
    pub(crate) fn check(&self) -> Result<(), Mistake> {
        for (name, span) in [
            ("step", self.step),
            ("hang", self.hang),
            ("join", self.join),
        ] {
            if span <= Nanos::ZERO {
                let what = format!("the span \"{name}\" is {span}");
                return Err(Mistake::new(what, "it must be longer than no time at all"));
            }
        }
        match self.pacing {
            Pacing::Times(factor) if !(factor.is_finite() && factor > 0.0) => Err(Mistake::new(
                format!("the pace is {factor} times real time"),
                "a pace is a number above zero, such as 1 for real time",
            )),
            _ => Ok(()),
        }
    }
}

impl Pacing {
    /// The wall-clock time between two steps of `step`; `None` without a limit.
    pub(crate) fn interval(self, step: Nanos) -> Option<Nanos> {
        match self {
            Self::Fast => None,
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_precision_loss,
                reason = "a cast to integers saturates, and a nanosecond more or less is no matter"
            )]
            Self::Times(factor) => Some(Nanos(((step.0 as f64 / factor) as i64).max(1))),
        }
    }
}
