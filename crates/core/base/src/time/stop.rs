//! The token that stops a thread, and wakes it for that.

use std::fmt;
use std::sync::{Arc, Condvar, Mutex, PoisonError, Weak};
use std::time::Duration;

/// Wakes a thread that waits in the operating system.
pub type Waker = Arc<dyn Fn() + Send + Sync>;

/// Stops a thread, and wakes it if it waits.
///
/// Clones share one state. A thread that waits on a [`Clock`](super::Clock) passes its token, so that
/// stopping never has to wait for a deadline.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<Shared>);

#[derive(Debug, Default)]
pub(super) struct Shared {
    state: Mutex<State>,
    woken: Condvar,
}

#[derive(Default)]
struct State {
    stopped: bool,
    /// Set by [`Stop::wake`], taken by the next wait: a wake before the wait is not lost.
    wake: bool,
    waker: Option<Waker>,
}

impl fmt::Debug for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("State")
            .field("stopped", &self.stopped)
            .field("wake", &self.wake)
            .finish_non_exhaustive()
    }
}

impl Stop {
    /// A token that has not been stopped.
    pub fn new() -> Self {
        Self::default()
    }

    /// Stops for good, and wakes every waiting thread.
    pub fn stop(&self) {
        self.0.lock().stopped = true;
        self.0.rouse();
    }

    /// True if [`stop`](Self::stop) was called.
    pub fn is_stopped(&self) -> bool {
        self.0.lock().stopped
    }

    /// Ends the current or the next wait of the thread, without stopping it.
    pub fn wake(&self) {
        self.0.lock().wake = true;
        self.0.rouse();
    }

    /// Sets the `waker` to be called by everything that would end a wait, for a thread that waits in the
    /// operating system and not here; `None` removes it.
    ///
    /// The waker is called from any thread and must not block.
    pub fn set_waker(&self, waker: Option<Waker>) {
        self.0.lock().waker = waker;
    }

    /// True if the current wait is over: stopped, or woken. A wake counts once.
    pub fn is_woken(&self) -> bool {
        let mut state = self.0.lock();
        state.stopped || std::mem::take(&mut state.wake)
    }

    pub(super) fn downgrade(&self) -> Weak<Shared> {
        Arc::downgrade(&self.0)
    }

    /// Waits until stopped, woken, or `remaining()` returns `None`; `Some(None)` waits without a limit until
    /// nudged.
    pub(super) fn wait_while(&self, mut remaining: impl FnMut() -> Option<Option<Duration>>) {
        let mut state = self.0.lock();
        while !state.stopped && !std::mem::take(&mut state.wake) {
            state = match remaining() {
                None => return,
                Some(None) => self
                    .0
                    .woken
                    .wait(state)
                    .unwrap_or_else(PoisonError::into_inner),
                Some(Some(span)) => {
                    self.0
                        .woken
                        .wait_timeout(state, span)
                        .unwrap_or_else(PoisonError::into_inner)
                        .0
                }
            };
        }
    }
}

impl Shared {
    fn lock(&self) -> std::sync::MutexGuard<'_, State> {
        // The state is two independent booleans: any combination is valid, even after a panic elsewhere.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes a waiting thread check its deadline again.
    pub(super) fn nudge(&self) {
        // Lock and release, so that the nudge cannot fall between a thread's check of its deadline and its wait.
        drop(self.lock());
        self.rouse();
    }

    fn rouse(&self) {
        self.woken.notify_all();
        // Called without the lock: a waker may use the token.
        let waker = self.lock().waker.clone();
        if let Some(waker) = waker {
            waker();
        }
    }
}
