//! The other end of a bus within this process.

use std::sync::Arc;

use crate::statistics::Counters;

use super::HostThread;

/// The other end of a bus within this process: a PLC program or a recording.
#[derive(Debug)]
pub(crate) struct OtherEnd {
    pub(crate) counters: Arc<dyn Counters>,
    #[expect(dead_code, reason = "kept for its drop")]
    thread: Option<HostThread>,
}

impl OtherEnd {
    /// The other end that the tick steps.
    pub(crate) fn stepped(counters: Arc<dyn Counters>) -> Self {
        let thread = None;
        Self { counters, thread }
    }

    /// A program on a thread of its own.
    pub(crate) fn on_thread(host: HostThread) -> Self {
        Self {
            counters: Arc::clone(&host.counters) as _,
            thread: Some(host),
        }
    }
}
