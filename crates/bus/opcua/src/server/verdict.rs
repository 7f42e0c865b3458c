//! The changes that faults make to the answer to a request.

use std::time::{Duration, Instant};

use opcua::types::StatusCode;

/// By how much a timer of the runtime can be late: it counts whole milliseconds, and so does the wait of the system
/// below it.
const TIMER: Duration = Duration::from_millis(4);

/// How faults change the answer to a request.
#[derive(Debug, Default)]
pub(super) struct Verdict {
    /// The stations that refuse the request, with this status.
    pub(super) refused: Vec<(usize, StatusCode)>,
    /// How much later the answer goes out.
    pub(super) late: Duration,
}

impl Verdict {
    /// The status with which a signal of `station` is refused.
    pub(super) fn status(&self, station: usize) -> Option<StatusCode> {
        let found = self.refused.iter().find(|(of, _)| *of == station);
        found.map(|(_, status)| *status)
    }

    /// Holds the answer to a request that came at `since` back.
    pub(super) async fn hold(&self, since: Instant) {
        if self.late.is_zero() {
            return;
        }
        let due = since + self.late;
        tokio::time::sleep(self.late.saturating_sub(TIMER)).await;
        while Instant::now() < due {
            tokio::task::yield_now().await;
        }
    }
}
