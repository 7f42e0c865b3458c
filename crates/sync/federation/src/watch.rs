//! A watch over the calls into a foreign library, which block: the watch aborts a call that takes too long, or when its
//! owner is stopped.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::thread::{Builder, JoinHandle};

use tickbus_base::time::{Clock, Nanos, Stop};

/// How often the watch looks.
const LOOK: Nanos = Nanos::from_millis(50);

/// No call runs.
const IDLE: i64 = i64::MIN;

/// The watch; its thread ends when it is dropped.
#[derive(Debug)]
pub(crate) struct Watch {
    clock: Arc<dyn Clock>,
    stop: Stop,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    /// When the call that runs is aborted.
    until: AtomicI64,
    /// The watch has aborted a call.
    aborted: AtomicBool,
    ends: Stop,
}

impl Watch {
    /// A watch that calls `abort`, once, from its own thread.
    ///
    /// # Errors
    ///
    /// The system has no further thread.
    pub(crate) fn start(
        clock: &Arc<dyn Clock>,
        stop: &Stop,
        abort: impl Fn() + Send + 'static,
    ) -> Result<Self, String> {
        let shared = Arc::new(Shared {
            until: AtomicI64::new(IDLE),
            aborted: AtomicBool::new(false),
            ends: Stop::new(),
        });
        let builder = Builder::new().name("tickbus-watch".to_owned());
        let thread = builder.spawn({
            let (clock, stop, shared) = (Arc::clone(clock), stop.clone(), Arc::clone(&shared));
            move || {
                while !shared.ends.is_stopped() {
                    let now = clock.now();
                    let until = shared.until.load(Ordering::Acquire);
                    if until != IDLE && (stop.is_stopped() || now.0 >= until) {
                        shared.aborted.store(true, Ordering::Release);
                        return abort();
                    }
                    clock.wait_until(now + LOOK, &shared.ends);
                }
            }
        });
        let thread = thread.map_err(|error| format!("a thread cannot be started: {error}"))?;
        Ok(Self {
            clock: Arc::clone(clock),
            stop: stop.clone(),
            shared,
            thread: Some(thread),
        })
    }

    /// Makes a call; without a `limit` it may take any time. `what` completes "it has not …" in the error.
    ///
    /// # Errors
    ///
    /// Why the watch aborted the call, or the call's own error.
    pub(crate) fn call<T>(
        &self,
        limit: Option<Nanos>,
        what: &str,
        call: impl FnOnce() -> Result<T, String>,
    ) -> Result<T, String> {
        let until = limit.map_or(i64::MAX, |limit| (self.clock.now() + limit).0);
        self.shared.until.store(until, Ordering::Release);
        let result = call();
        self.shared.until.store(IDLE, Ordering::Release);
        if !self.shared.aborted.load(Ordering::Acquire) {
            return result;
        }
        match limit {
            _ if self.stop.is_stopped() => Err("it was stopped".to_owned()),
            Some(limit) => Err(format!("the federation has not {what} within {limit}")),
            None => result,
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.shared.ends.stop();
        if let Some(thread) = self.thread.take() {
            // A panic was reported by its own thread.
            let _ = thread.join();
        }
    }
}
