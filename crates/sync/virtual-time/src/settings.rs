//! The settings of a server.

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;

/// The settings of a server.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The virtual time of one step, above zero.
    pub step: Nanos,
    /// When the run begins.
    pub start: StartCondition,
    /// The number of steps; `None` runs until stopped.
    pub steps: Option<u64>,
    /// The speed limit.
    pub pacing: Pacing,
    /// True if the run begins paused.
    pub paused: bool,
    /// The time limit for a client's answer. Wall-clock time never changes a result: it only ends a run that hangs.
    pub hang: Nanos,
    /// The time limit for all clients to join.
    pub join: Nanos,
    /// True if the clients exchange their values without the server, if they can: see
    /// [`ToClient::Meet`](crate::server::ToClient::Meet). The result is the same.
    pub direct: bool,
    /// How long the run waits for a member that is lost to come back; `None`: the run ends.
    pub rejoin: Option<Nanos>,
}

/// When a run begins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StartCondition {
    /// When clients with these names have joined; others are refused.
    Names(Vec<String>),
    /// When this many clients have joined, whatever their names.
    Count(usize),
}

/// The speed limit of virtual time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pacing {
    /// As fast as the clients can.
    Fast,
    /// This many times as fast as the wall clock: 1 is real time. Above zero. Late steps are not made up for.
    Times(f64),
}

impl Settings {
    /// A run as fast as possible, in steps of `step`. It begins under the condition `start` and ends when stopped; a
    /// client has ten seconds to answer, and any time to join.
    pub const fn new(step: Nanos, start: StartCondition) -> Self {
        Self {
            step,
            start,
            steps: None,
            pacing: Pacing::Fast,
            paused: false,
            hang: Nanos::from_secs(10),
            join: Nanos::MAX,
            direct: false,
            rejoin: None,
        }
    }
}

impl Settings {
    /// Checks everything that does not concern the clients.
    pub(crate) fn check(&self) -> Result<(), Mistake> {
        for (name, span) in [
            ("step", self.step),
            ("hang", self.hang),
            ("join", self.join),
            ("rejoin", self.rejoin.unwrap_or(Nanos::MAX)),
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
