//! The settings of a server.

use std::path::PathBuf;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;

use crate::saved_run::SavedRun;

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
    /// How values get from client to client. The result is the same.
    pub exchange: Exchange,
    /// The file of a run that is to be saved; the server then keeps in memory all that its clients write.
    pub save: Option<Save>,
    /// The saved run that this one continues.
    pub restore: Option<SavedRun>,
}

/// How values get from client to client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exchange {
    /// The server passes the values on.
    ByServer {
        /// How long the run waits for a member that is lost to come back; `None`: the run ends.
        rejoin: Option<Nanos>,
    },
    /// The clients exchange their values without the server, if they can: see
    /// [`ToClient::Meet`](crate::server::ToClient::Meet).
    Direct,
}

impl Exchange {
    /// How long the run waits for a member that is lost.
    pub(crate) const fn rejoin(self) -> Option<Nanos> {
        match self {
            Self::ByServer { rejoin } => rejoin,
            Self::Direct => None,
        }
    }
}

/// Where, and when, a run is saved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Save {
    /// The file; an older one is replaced as a whole.
    pub file: PathBuf,
    /// The step after which the run is saved; `None`: on [`Control::Save`](crate::server::Control::Save) alone.
    pub at: Option<u64>,
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
            exchange: Exchange::ByServer { rejoin: None },
            save: None,
            restore: None,
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
            ("rejoin", self.exchange.rejoin().unwrap_or(Nanos::MAX)),
        ] {
            if span <= Nanos::ZERO {
                let what = format!("the span \"{name}\" is {span}");
                return Err(Mistake::new(what, "it must be longer than no time at all"));
            }
        }
        if let (Some(Save { at: Some(at), .. }), Some(steps)) = (&self.save, self.steps)
            && *at > steps
        {
            return Err(Mistake::new(
                format!("the run is to be saved after step {at}, and ends after step {steps}"),
                "save it at an earlier step, or let it run longer",
            ));
        }
        if let Some(saved) = &self.restore {
            self.check_restore(saved)?;
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

impl Settings {
    /// Checks that this run can continue `saved`.
    fn check_restore(&self, saved: &SavedRun) -> Result<(), Mistake> {
        let (step, length) = (saved.step, saved.length);
        if self.step != length {
            return Err(Mistake::new(
                format!(
                    "the saved run has steps of {length}, and this one of {}",
                    self.step
                ),
                format!("give it steps of {length}"),
            ));
        }
        if let Some(steps) = self.steps.filter(|steps| *steps < step) {
            return Err(Mistake::new(
                format!("the run was saved after step {step}, and is to end after step {steps}"),
                "let it run longer",
            ));
        }
        if let Some(at) = self.save.as_ref().and_then(|save| save.at)
            && at < step
        {
            return Err(Mistake::new(
                format!("the run was saved after step {step}, and is to be saved after step {at}"),
                "save it at a later step",
            ));
        }
        let names: Vec<&str> = saved.clients().collect();
        let are_same = match &self.start {
            StartCondition::Count(count) => *count == names.len(),
            StartCondition::Names(expected) => {
                expected.len() == names.len()
                    && expected.iter().all(|name| names.contains(&&**name))
            }
        };
        if !are_same {
            return Err(Mistake::new(
                format!("the clients are others than those of the saved run: {names:?}"),
                "let these clients take part",
            ));
        }
        Ok(())
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
