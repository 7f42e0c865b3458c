//! How a run ends.

use std::fmt;

use tickbus_base::time::Nanos;

use crate::TraceHash;

/// A run that ended regularly, or was stopped between two steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// The number of steps. All clients have finished all of them.
    pub steps: u64,
    /// The virtual time of the last step; one step below 0 if there was none.
    pub time: Nanos,
    /// The hash over everything that was committed.
    pub hash: TraceHash,
}

/// A run that was broken off, or never began.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ended {
    /// The kind of reason.
    pub cause: Cause,
    /// The client responsible, if any.
    pub client: Option<String>,
    /// The reason, for people; it does not repeat the client's name.
    pub reason: String,
    /// The number of steps that were committed before.
    pub steps: u64,
}

/// Why a run was broken off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// The declarations contradict each other.
    Configuration,
    /// The server did not let this client take part.
    Refused,
    /// The connection with a client, or with the server, broke.
    Lost,
    /// A client, or the server, did not answer in time.
    Hung,
    /// A client, or the server, violated the protocol.
    Protocol,
    /// A client reported that it cannot continue.
    Failed,
    /// The server's logic failed.
    Logic,
    /// Somebody stopped the run before a step could be finished.
    Stopped,
    /// A system call failed.
    System,
}

impl Cause {
    /// All causes, in the order of their codes on the wire, from 1.
    pub const ALL: [Self; 9] = [
        Self::Configuration,
        Self::Refused,
        Self::Lost,
        Self::Hung,
        Self::Protocol,
        Self::Failed,
        Self::Logic,
        Self::Stopped,
        Self::System,
    ];

    /// The name in logs and results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Configuration => "configuration",
            Self::Refused => "refused",
            Self::Lost => "lost",
            Self::Hung => "hung",
            Self::Protocol => "protocol",
            Self::Failed => "failed",
            Self::Logic => "logic",
            Self::Stopped => "stopped",
            Self::System => "system",
        }
    }
}

impl Ended {
    /// A run that ended before its first step for a reason that no client caused.
    pub(crate) fn before(cause: Cause, reason: impl Into<String>) -> Self {
        Self {
            cause,
            client: None,
            reason: reason.into(),
            steps: 0,
        }
    }
}

impl fmt::Display for Ended {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.cause == Cause::Refused {
            f.write_str("the server refused this client")?;
            return write!(f, ": {}", self.reason);
        }
        match self.steps {
            0 => f.write_str("the run ended before its first step")?,
            1 => f.write_str("the run ended after 1 step")?,
            steps => write!(f, "the run ended after {steps} steps")?,
        }
        match &self.client {
            Some(client) => write!(f, ": client \"{client}\" {}", self.reason),
            None => write!(f, ": {}", self.reason),
        }
    }
}

impl std::error::Error for Ended {}
