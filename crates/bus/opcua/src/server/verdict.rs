//! The changes that faults make to the answer to a request.

use std::time::Duration;

use opcua::types::StatusCode;
use tickbus_base::time::{Clock as _, Monotonic, Nanos};

/// How much later than stated the runtime's timer can fire: it counts whole milliseconds, and so does the system's call
/// that waits for it.
const COARSE: Duration = Duration::from_millis(2);

/// How faults change the answer to a request.
#[derive(Debug, Default)]
pub(super) struct Verdict {
    /// The stations that refuse the request, with this status.
    pub(super) refused: Vec<(usize, StatusCode)>,
    /// How much later the answer goes out.
    pub(super) late: Nanos,
}

impl Verdict {
    /// The status with which a signal of `station` is refused.
    pub(super) fn status(&self, station: usize) -> Option<StatusCode> {
        let found = self.refused.iter().find(|(of, _)| *of == station);
        found.map(|(_, status)| *status)
    }

    /// Holds the answer back. The end of the wait is spent polling, because the timer is too coarse.
    pub(super) async fn hold(&self) {
        if self.late == Nanos::ZERO {
            return;
        }
        let clock = Monotonic::shared();
        let due = clock.now() + self.late;
        let late = self.late.to_duration();
        tokio::time::sleep(late.saturating_sub(COARSE)).await;
        while clock.now() < due {
            tokio::task::yield_now().await;
        }
    }
}
