//! Library calls that may not return.

use std::sync::Arc;

use tickbus_base::time::{Clock, Monotonic, Nanos, Stop};

use super::Port;
use crate::{BusError, LinkStatus};

/// How often a call in progress is checked.
const LOOK: Nanos = Nanos::from_millis(250);

impl Port {
    /// Runs `bus` while another thread watches its [calls](Self::calling): a call that does not return cannot report
    /// itself. `name` is the driver's name.
    ///
    /// # Errors
    ///
    /// The errors of `bus`, or the system cannot start the thread.
    pub fn watching_calls(
        &mut self,
        name: &str,
        bus: impl FnOnce(&mut Self) -> Result<(), BusError>,
    ) -> Result<(), BusError> {
        /// Ends the watch even if the bus panics.
        struct StopOnDrop<'a>(&'a Stop);

        impl Drop for StopOnDrop<'_> {
            fn drop(&mut self) {
                self.0.stop();
            }
        }

        let cannot =
            |error: std::io::Error| BusError::Link(format!("the system refused a thread: {error}"));
        // The watch uses the system's time, whatever clock the driver has. The watch may be left behind together with
        // the bus thread.
        let real = Monotonic::shared();
        let (watch, over) = (self.call_watch(), Stop::new());
        std::thread::scope(|scope| {
            std::thread::Builder::new()
                .name(format!("watch {name}"))
                .spawn_scoped(scope, || {
                    while !over.is_stopped() {
                        real.wait_until(real.now() + LOOK, &over);
                        watch.look();
                    }
                })
                .map_err(cannot)?;
            let _end = StopOnDrop(&over);
            bus(self)
        })
    }

    /// Lets another thread supervise the [calls](Self::calling) of this one.
    pub fn call_watch(&self) -> CallWatch {
        CallWatch {
            status: self.image.status.clone(),
            clock: Arc::clone(&self.clock),
        }
    }

    /// Makes a library call that may not return; the statistics report a call that lasts longer than `limit`.
    pub fn calling<R>(&self, what: &Arc<str>, limit: Nanos, call: impl FnOnce() -> R) -> R {
        /// Ends the call in any case: a call that panics has not hung.
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
    /// Makes the line stale, and logs this, if a call exceeds its limit.
    pub fn look(&self) {
        self.status.observe_call(self.clock.now());
    }
}
