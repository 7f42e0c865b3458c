//! Injected clocks.

use std::fmt;
use std::sync::atomic::{AtomicI64, AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::simulation::Simulation;
use super::stop::Shared;
use super::{Nanos, Stop};

/// A source of time that threads can also wait on.
pub trait Clock: Send + Sync + fmt::Debug {
    /// The current time.
    fn now(&self) -> Nanos;

    /// Waits until `deadline`, or until `stop` is stopped or woken, whichever is first.
    fn wait_until(&self, deadline: Nanos, stop: &Stop);

    /// Lets `sleep` wait in the operating system, for a thread that also waits for something other than the time, such
    /// as a socket.
    ///
    /// `sleep` gets the longest time that it may wait; `None` means until the [waker](Stop::set_waker) of `stop` wakes
    /// it. `sleep` may return early; the caller then reads the clock again.
    fn wait_with(&self, deadline: Nanos, stop: &Stop, sleep: &mut dyn FnMut(Option<Duration>));

    /// True if the clock advances on its own, at the pace of the computer's clock, so that a counter can tell the time
    /// between two reads.
    fn is_steady(&self) -> bool {
        false
    }

    /// True if the time passes without being set, by the ticking thread, between two calls of the simulation.
    fn passes_alone(&self) -> bool {
        self.is_steady()
    }

    /// The replacement of the operating system when a whole run is simulated.
    fn simulation(&self) -> Option<&dyn Simulation> {
        None
    }

    /// The date at which this clock read zero, as the time since 1 January 1970 UTC; `None` for a clock
    /// without dates.
    fn epoch(&self) -> Option<Nanos> {
        None
    }
}

/// The operating system's monotonic clock; its epoch is the first use in the process.
///
/// The tick reads this clock as well, by a [`QuickClock`](crate::QuickClock): on tickbus' platforms that is no system
/// call (on Linux some 25 ns in the vDSO). A time kept in memory by another thread would cost less, but on a busy
/// machine it would lag by the tens of milliseconds for which that thread is not scheduled. Nor is the kernel's coarse
/// clock (`CLOCK_MONOTONIC_COARSE`) read: it lags while the one processor that advances it is busy or, in a virtual
/// machine, is not scheduled, by 15 ms where its resolution is 4 ms, and nothing bounds that.
///
/// The clock stands still while the computer sleeps.
#[derive(Debug)]
pub struct Monotonic(());

static EPOCH: LazyLock<Instant> = LazyLock::new(Instant::now);

fn monotonic_now() -> Nanos {
    Nanos(i64::try_from(EPOCH.elapsed().as_nanos()).unwrap_or(i64::MAX))
}

impl Monotonic {
    /// The clock of the process, shared by everyone.
    pub fn shared() -> Arc<Self> {
        static SHARED: LazyLock<Arc<Monotonic>> = LazyLock::new(|| Arc::new(Monotonic(())));
        Arc::clone(&SHARED)
    }
}

fn wait_monotonic(deadline: Nanos, stop: &Stop) {
    stop.wait_while(|| {
        let remaining = deadline - monotonic_now();
        (remaining > Nanos::ZERO).then(|| Some(remaining.to_duration()))
    });
}

impl Clock for Monotonic {
    fn now(&self) -> Nanos {
        monotonic_now()
    }

    fn wait_until(&self, deadline: Nanos, stop: &Stop) {
        wait_monotonic(deadline, stop);
    }

    fn wait_with(&self, deadline: Nanos, _stop: &Stop, sleep: &mut dyn FnMut(Option<Duration>)) {
        sleep((deadline != Nanos::MAX).then(|| (deadline - monotonic_now()).to_duration()));
    }

    fn is_steady(&self) -> bool {
        true
    }

    fn epoch(&self) -> Option<Nanos> {
        let date = SystemTime::now().duration_since(UNIX_EPOCH).ok()?;
        let date = i64::try_from(date.as_nanos()).ok()?;
        Some(Nanos(date) - monotonic_now())
    }
}

/// A clock that stands still until it is advanced: for tests, and for simulation time.
#[derive(Debug, Default)]
pub struct Manual {
    now: AtomicI64,
    waiters: Mutex<Vec<Waiter>>,
    /// The number of waiters: usually zero where simulation time is the clock, so the tick takes no lock.
    waiting: AtomicUsize,
}

/// A thread that waits on a manual clock.
#[derive(Debug)]
struct Waiter {
    deadline: Nanos,
    stop: Weak<Shared>,
}

impl Manual {
    /// A clock that shows zero.
    pub fn new() -> Arc<Self> {
        Arc::default()
    }

    /// Moves the clock on by `span` and wakes every wait whose deadline has come.
    pub fn advance(&self, span: Nanos) {
        self.set(self.now() + span);
    }

    /// Sets the clock to `now`; a clock never runs backwards, so an earlier time changes nothing.
    pub fn set(&self, now: Nanos) {
        let now = Nanos(now.0.max(self.now.fetch_max(now.0, Ordering::SeqCst)));
        // A waiter adds itself to `waiting` before it reads `now`. So it either reads the new time, or is counted here.
        if self.waiting.load(Ordering::SeqCst) > 0 {
            self.wake(now);
        }
    }

    /// Shows zero again, for a simulation that restarts. Waits keep their deadlines.
    pub fn restart(&self) {
        self.now.store(0, Ordering::SeqCst);
    }

    /// Wakes every wait whose deadline has come.
    #[cold]
    fn wake(&self, now: Nanos) {
        // Collected first: a waker may take its time, and threads come and go meanwhile.
        let due: Vec<_> = self
            .lock()
            .iter()
            .filter(|waiter| waiter.deadline <= now)
            .filter_map(|waiter| waiter.stop.upgrade())
            .collect();
        for waiter in due {
            waiter.nudge();
        }
    }

    /// True if at least `threads` threads wait on this clock and none of them has reached its deadline: then everything
    /// due so far is done.
    pub fn is_settled(&self, threads: usize) -> bool {
        let waiters = self.lock();
        let now = self.now();
        waiters.len() >= threads && waiters.iter().all(|waiter| waiter.deadline > now)
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Waiter>> {
        // The list is consistent after every single change, so a poisoned lock is safe to use.
        self.waiters.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Clock for Manual {
    fn now(&self) -> Nanos {
        Nanos(self.now.load(Ordering::SeqCst))
    }

    fn wait_until(&self, deadline: Nanos, stop: &Stop) {
        self.wait_listed(deadline, stop, || {
            stop.wait_while(|| (self.now() < deadline).then_some(None));
        });
    }

    fn wait_with(&self, deadline: Nanos, stop: &Stop, sleep: &mut dyn FnMut(Option<Duration>)) {
        self.wait_listed(deadline, stop, || {
            sleep((deadline <= self.now()).then_some(Duration::ZERO));
        });
    }
}

impl Manual {
    /// Waits as a thread known to the clock. The thread enters the list before it reads the time, so it misses no
    /// advance.
    fn wait_listed(&self, deadline: Nanos, stop: &Stop, wait: impl FnOnce()) {
        let me = stop.downgrade();
        self.waiting.fetch_add(1, Ordering::SeqCst);
        self.lock().push(Waiter {
            deadline,
            stop: me.clone(),
        });
        wait();
        self.lock().retain(|waiter| !waiter.stop.ptr_eq(&me));
        self.waiting.fetch_sub(1, Ordering::SeqCst);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    #[test]
    fn manual_wait_ends_at_its_deadline_and_not_before() {
        let clock = Manual::new();
        let stop = Stop::new();
        let (sender, receiver) = mpsc::channel();
        let waiting = std::thread::spawn({
            let (clock, stop) = (Arc::clone(&clock), stop.clone());
            move || {
                clock.wait_until(Nanos(10), &stop);
                sender.send(clock.now()).expect("the test still listens");
            }
        });
        clock.advance(Nanos(9));
        assert!(receiver.try_recv().is_err());
        clock.advance(Nanos(1));
        assert_eq!(receiver.recv(), Ok(Nanos(10)));
        waiting.join().expect("no panic");
    }

    #[test]
    fn stop_ends_a_wait_for_never() {
        let clock = Manual::new();
        let stop = Stop::new();
        let waiting = std::thread::spawn({
            let (clock, stop) = (Arc::clone(&clock), stop.clone());
            move || clock.wait_until(Nanos::MAX, &stop)
        });
        stop.stop();
        waiting.join().expect("no panic");
        assert!(stop.is_stopped());
    }

    #[test]
    fn a_wake_that_comes_early_counts_once() {
        let clock = Manual::new();
        let stop = Stop::new();
        stop.wake();
        clock.wait_until(Nanos::MAX, &stop);
        clock.set(Nanos(5));
        clock.wait_until(Nanos(5), &stop);
        assert!(!stop.is_stopped());
    }

    #[test]
    fn the_shared_clock_is_one() {
        let one = Monotonic::shared();
        let two = Monotonic::shared();
        assert!(Arc::ptr_eq(&one, &two));
        let before = one.now();
        one.wait_until(before + Nanos::from_millis(1), &Stop::new());
        assert!(two.now() >= before + Nanos::from_millis(1));
    }
}
