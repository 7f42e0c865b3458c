//! A run, as another thread sees it.

use std::sync::Arc;

use tickbus_base::time::Nanos;

use crate::members::Members;
use crate::{Pacing, State, Step};

/// A run at one moment, copied by its server on its own thread.
#[derive(Clone, Debug, PartialEq)]
pub struct RunView {
    /// Who takes part in it: the same one throughout, once everyone has joined.
    pub members: Arc<Members>,
    /// Where the run is.
    pub state: State,
    /// The step that runs, or ran last; `None` before all clients have joined.
    pub step: Option<Step>,
    /// The virtual time of one step.
    pub length: Nanos,
    /// How fast it runs at most.
    pub pacing: Pacing,
    /// Whether no further step begins.
    pub is_paused: bool,
    /// Whom the start waits for, in words; `None` once everyone has joined.
    pub missing: Option<String>,
    /// Per client, whether it owes the answer of this step.
    pub owes: Vec<bool>,
    /// How long those have had it by now.
    pub waited: Nanos,
    /// How long they may have it.
    pub hang: Nanos,
    /// The committed values, one per variable: raw values, see [`is_raw`](crate::is_raw).
    pub values: Vec<u64>,
}
