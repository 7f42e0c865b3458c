//! The changes that faults make to the answer to a request.

use std::time::Duration;

use opcua::types::StatusCode;

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

    /// Holds the answer back. The timer counts whole milliseconds, so that the answer goes out up to 2 ms later.
    pub(super) async fn hold(&self) {
        if !self.late.is_zero() {
            tokio::time::sleep(self.late).await;
        }
    }
}
