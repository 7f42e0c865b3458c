//! The server's view of its run, for other threads.

use std::sync::Arc;

use tickbus_base::time::Nanos;

use super::{Phase, Server};
use crate::RunView;

impl Server<'_> {
    /// A copy of the run at `now`; `None` once it has ended.
    pub fn view(&mut self, now: Nanos) -> Option<RunView> {
        let members = match &self.phase {
            Phase::Joining(joining, _) => Arc::new(joining.members()),
            Phase::Running(barrier, _) => Arc::clone(barrier.members()),
            Phase::Ended(_) => return None,
        };
        let (owes, values) = match &self.phase {
            Phase::Running(barrier, _) => (barrier.owes(), barrier.committed().to_vec()),
            _ => (vec![false; members.clients.len()], Vec::new()),
        };
        let waited = if owes.contains(&true) {
            now - self.asked
        } else {
            Nanos::ZERO
        };
        Some(RunView {
            members,
            state: self.state(),
            step: self.step(),
            length: self.settings.step,
            pacing: self.settings.pacing,
            is_paused: self.is_paused(),
            missing: self.missing(),
            owes,
            waited: waited.max(Nanos::ZERO),
            hang: self.settings.hang,
            values,
        })
    }
}
