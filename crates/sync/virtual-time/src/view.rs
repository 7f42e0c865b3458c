//! A run as other threads see it.

use std::sync::Arc;

use tickbus_base::time::Nanos;

use crate::members::Members;
use crate::{Pacing, State, Step};

/// A run at one moment, copied by its server on its own thread.
#[derive(Clone, Debug, PartialEq)]
pub struct RunView {
    /// The participants: the same object throughout, once everyone has joined.
    pub members: Arc<Members>,
    /// The state of the run.
    pub state: State,
    /// The current or last step; `None` before all clients have joined.
    pub step: Option<Step>,
    /// The virtual time of one step.
    pub length: Nanos,
    /// The speed limit.
    pub pacing: Pacing,
    /// True if no further step begins.
    pub is_paused: bool,
    /// The clients that the start waits for, in words; `None` once everyone has joined.
    pub missing: Option<String>,
    /// Per client, true if it owes the answer of this step.
    pub owes: Vec<bool>,
    /// How long these clients have had the request so far.
    pub waited: Nanos,
    /// The time limit for their answers.
    pub hang: Nanos,
    /// The committed values, one per variable: raw values, see [`is_raw`](crate::is_raw).
    pub values: Vec<u64>,
}
