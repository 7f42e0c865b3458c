//! The thread of a free bus: runs the bus, and restarts it after its line has failed.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use log::Level;
use tickbus_base::RealTime;
use tickbus_base::thread::Thread;
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_driver_cfg::Timing;
use tickbus_fieldbus::{BusError, Cause, Farewell, Free, LinkState, LinkStatus, Outputs, Port};
use tickbus_image::signal::SignalTable;

use super::real_time::begin;

/// The longest time to wait for the peer to take the last values.
const LONGEST_FAREWELL: Nanos = Nanos::from_secs(2);

/// A bus thread. Dropping it sends the fail-safe values if the driver asks for that, then stops the bus and waits until
/// the thread has ended.
///
/// A bus that does not end within its `close_timeout` is stuck in a call that never returns. Its thread is left behind
/// with everything it uses, because nothing can be freed safely.
#[derive(Debug)]
pub(super) struct BusThread {
    stop: Stop,
    name: String,
    status: LinkStatus,
    close_timeout: Nanos,
    /// Sends the fail-safe values at the end; `None` if the peer keeps its last values.
    farewell: Option<Farewell>,
    clock: Arc<dyn Clock>,
    thread: Option<Thread>,
    handover: Arc<Handover>,
}

/// The way of a port from a bus that ends to the next one.
#[derive(Debug, Default)]
struct Handover {
    /// True if the line goes on after this bus.
    goes_on: AtomicBool,
    port: Mutex<Option<Port>>,
}

impl BusThread {
    /// Starts a thread that serves `bus` with the signals in `table`. `timing` has the pauses between attempts (the last one repeats), and the
    /// settings for the outputs. `real_time` are the settings of the thread.
    pub(super) fn start(
        bus: Box<dyn Free>,
        mut port: Port,
        table: &SignalTable,
        timing: &Timing,
        status: LinkStatus,
        (name, real_time): (&str, Option<RealTime>),
    ) -> std::io::Result<Self> {
        let cycles = bus.last_cycles();
        if cycles > 0 {
            port.set_while_stale(timing.while_stale);
        }
        // A clock that stands still between two calls brings no further cycle.
        let is_due = timing.at_close == Outputs::FailSafe && port.clock().passes_alone();
        let farewell = (is_due && cycles > 0).then(|| port.farewell(cycles, table));
        let reconnect = timing.reconnect.clone();
        let stop = Stop::new();
        let close_timeout = bus.close_timeout();
        let clock = Arc::clone(port.clock());
        let handover = Arc::<Handover>::default();
        let thread = Thread::spawn(&*clock, &format!("bus {name}"), {
            let (stop, status, clock) = (stop.clone(), status.clone(), Arc::clone(&clock));
            let handover = Arc::clone(&handover);
            move || {
                // Freeing the bus's resources, such as unloading a library, may take time: the thread ends after that.
                let (mut bus, mut port) = (bus, port);
                begin(real_time, "the bus", &status, &*clock);
                let has_panicked =
                    !serve(&mut *bus, &mut port, &*clock, &reconnect, &status, &stop);
                if handover.goes_on.load(Ordering::SeqCst) {
                    drop(bus);
                    *handover.lock() = Some(port);
                } else if !has_panicked {
                    status.enter(clock.now(), LinkState::Closed, Cause::Closed, "closed");
                }
            }
        })?;
        Ok(Self {
            stop,
            name: name.to_owned(),
            status,
            close_timeout,
            farewell,
            clock,
            thread: Some(thread),
            handover,
        })
    }

    /// Ends the bus as a drop does, and returns its port for the next bus; `None` if the bus is stuck in a call.
    pub(super) fn end_for_next(self) -> Option<Port> {
        self.handover.goes_on.store(true, Ordering::SeqCst);
        let handover = Arc::clone(&self.handover);
        drop(self);
        handover.lock().take()
    }

    /// Leaves the peer, if there is one, with the fail-safe values.
    fn take_leave(&self) {
        let Some(farewell) = &self.farewell else {
            return;
        };
        let link = self.status.link();
        if link.cause == Cause::Injected || !farewell.begin() {
            return;
        }
        self.stop.wake();
        let limit = self.status.max_age().min(LONGEST_FAREWELL);
        if !farewell.wait(&*self.clock, limit) {
            // For any other state, the log has reported the reason already, or does so now.
            let is_news =
                link.state == LinkState::Running && self.status.state() == LinkState::Running;
            log::log!(
                if is_news { Level::Warn } else { Level::Info },
                "driver \"{}\": closes, and the peer has not confirmed the fail-safe values within {limit}; it may keep \
                 the last ones ({})",
                self.name,
                link.reason
            );
        }
    }
}

impl Handover {
    fn lock(&self) -> MutexGuard<'_, Option<Port>> {
        // The port is there as a whole, or not.
        self.port.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for BusThread {
    fn drop(&mut self) {
        self.take_leave();
        self.stop.stop();
        let Some(thread) = self.thread.take() else {
            return;
        };
        if !thread.join_within(&*self.clock, self.close_timeout) {
            log::error!(
                "driver \"{}\": the bus did not end within {}, and its thread is left behind ({})",
                self.name,
                self.close_timeout,
                self.status.link().reason
            );
        }
    }
}

/// Runs the bus until `stop`; returns false if it panicked before.
fn serve(
    bus: &mut dyn Free,
    port: &mut Port,
    clock: &dyn Clock,
    reconnect: &[Nanos],
    status: &LinkStatus,
    stop: &Stop,
) -> bool {
    let mut attempt = 0;
    while !stop.is_stopped() {
        port.opening("opening the line");
        let runs = status.runs();
        let ended = match catch_unwind(AssertUnwindSafe(|| bus.run(port, stop))) {
            Ok(Ok(())) if stop.is_stopped() => break,
            Ok(Ok(())) => BusError::Link("the bus ended by itself".to_owned()),
            Ok(Err(error)) => error,
            Err(panic) => {
                let reason = format!(
                    "the bus thread panicked ({}); close the driver and open it again",
                    panic_text(&*panic)
                );
                status.enter(clock.now(), LinkState::Failed, Cause::Defect, &reason);
                return false;
            }
        };
        port.line_ended();
        if status.runs() > runs {
            attempt = 0;
        }
        let pause = reconnect[attempt.min(reconnect.len() - 1)];
        attempt += 1;
        let now = clock.now();
        let reason = format!("{ended}; next attempt in {pause}");
        let next = now + pause;
        status.failed(now, (&ended).into(), &reason, next);
        while clock.now() < next && !stop.is_stopped() {
            // May return early because of a wake-up meant for the previous attempt.
            clock.wait_until(next, stop);
        }
    }
    true
}

/// Returns the message of a panic.
pub fn panic_text(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&'static str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no text")
}
