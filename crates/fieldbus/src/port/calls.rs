//! Calls of a library that may not return.

use std::sync::Arc;

use tickbus_base::time::{Clock, Nanos};

use super::Port;
use crate::LinkStatus;

impl Port {
    /// Lets another thread supervise the [calls](Self::calling) of this one.
    pub fn call_watch(&self) -> CallWatch {
        CallWatch {
            status: self.image.status.clone(),
            clock: Arc::clone(&self.clock),
        }
    }

    /// Makes a library call that may not return; the statistics report it if it lasts longer than `limit`.
    pub fn calling<R>(&self, what: &Arc<str>, limit: Nanos, call: impl FnOnce() -> R) -> R {
        /// Ends the call in any case: one that panics has not hung.
        struct Ends<'a>(&'a Port);

        impl Drop for Ends<'_> {
            fn drop(&mut self) {
                self.0.image.status.call_ends(self.0.clock.now());
            }
        }

        let status = &self.image.status;
        status.call_begins(self.clock.now(), what, limit);
        let _ends = Ends(self);
        call()
    }
}

/// Supervises a bus thread's library calls from another thread.
#[derive(Clone, Debug)]
pub struct CallWatch {
    status: LinkStatus,
    clock: Arc<dyn Clock>,
}

impl CallWatch {
    /// Makes the line stale, and logs that, when a call exceeds its limit.
    pub fn look(&self) {
        self.status.observe_call(self.clock.now());
    }
}
