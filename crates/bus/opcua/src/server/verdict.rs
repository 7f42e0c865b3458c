//! The changes that faults make to the answer to a request.

use std::time::{Duration, Instant};

use opcua::types::StatusCode;

/// How much later than stated the runtime's timer can fire: it counts whole milliseconds, and so does the system's call
/// that waits for it.
const COARSE: Duration = Duration::from_millis(2);

/// How faults change the answer to a request.
#[derive(Debug, Default)]
pub(super) struct Verdict {
    /// The stations that refuse the request, with this status.
    pub(super) refused: Vec<(usize, StatusCode)>,
    /// When the answer goes out, if not at once.
    pub(super) due: Option<Instant>,
}

impl Verdict {
    /// The status with which a signal of `station` is refused.
    pub(super) fn status(&self, station: usize) -> Option<StatusCode> {
        let found = self.refused.iter().find(|(of, _)| *of == station);
        found.map(|(_, status)| *status)
    }

    /// Holds the answer back until it is due. The end of the wait is spent polling, because the timer is too coarse.
    pub(super) async fn hold(&self) {
        let Some(due) = self.due else {
            return;
        };
        let left = due.saturating_duration_since(Instant::now());
        tokio::time::sleep(left.saturating_sub(COARSE)).await;
        while Instant::now() < due {
            tokio::task::yield_now().await;
        }
    }
}
