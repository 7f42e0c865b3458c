//! Clocks, as they are handed in.

use std::fmt;
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError, Weak};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::stop::Shared;
use super::{Nanos, Stop};

/// A source of time that can also be waited on.
pub trait Clock: Send + Sync + fmt::Debug {
    /// The time now.
    fn now(&self) -> Nanos;

    /// The time as it was a few milliseconds ago at most, to be read without a call into the system.
    ///
    /// This is what the tick path reads.
    fn coarse(&self) -> CoarseTime;

    /// Waits until `deadline`, or until `stop` is stopped or woken, whichever is first.
    fn wait_until(&self, deadline: Nanos, stop: &Stop);

    /// Lets `sleep` wait in the operating system, for a thread that waits for more than the time.
    ///
    /// `sleep` gets the longest that it may wait; `None` means until the [waker](Stop::set_waker) of
    /// `stop` wakes it. It may end early; who waits looks at the clock again.
    fn wait_with(&self, deadline: Nanos, stop: &Stop, sleep: &mut dyn FnMut(Option<Duration>));

    /// The date at which this clock showed zero, as the time since 1 January 1970 UTC; `None` for a clock that has no
    /// dates.
    fn epoch(&self) -> Option<Nanos> {
        None
    }
}

/// The time of a clock, kept in memory by the clock.
#[derive(Clone, Debug)]
pub struct CoarseTime(Arc<AtomicI64>);

impl CoarseTime {
    /// The time now, or a few milliseconds ago.
    #[inline]
    pub fn now(&self) -> Nanos {
        Nanos(self.0.load(Ordering::Relaxed))
    }
}

/// How far [`Monotonic::coarse`] may lag.
const COARSE_STEP: Nanos = Nanos::from_millis(2);

/// The operating system's monotonic clock; its epoch is the first use in the process.
///
/// One thread per process keeps the coarse time, for as long as any clone lives.
#[derive(Debug)]
pub struct Monotonic {
    coarse: Arc<AtomicI64>,
    stop: Stop,
    keeper: Option<JoinHandle<()>>,
}

static EPOCH: LazyLock<Instant> = LazyLock::new(Instant::now);

fn monotonic_now() -> Nanos {
    Nanos(i64::try_from(EPOCH.elapsed().as_nanos()).unwrap_or(i64::MAX))
}

impl Monotonic {
    /// The process's clock, started on first use and shared by all who hold it.
    ///
    /// # Errors
    ///
    /// The system refused the thread that keeps the coarse time.
    pub fn shared() -> std::io::Result<Arc<Self>> {
        static SHARED: Mutex<Weak<Monotonic>> = Mutex::new(Weak::new());
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(clock) = shared.upgrade() {
            return Ok(clock);
        }
        let coarse = Arc::new(AtomicI64::new(monotonic_now().0));
        let stop = Stop::new();
        let keeper = std::thread::Builder::new()
            .name("tickbus-clock".into())
            .spawn({
                let (coarse, stop) = (Arc::clone(&coarse), stop.clone());
                move || {
                    while !stop.is_stopped() {
                        coarse.store(monotonic_now().0, Ordering::Relaxed);
                        wait_monotonic(monotonic_now() + COARSE_STEP, &stop);
                    }
                }
            })?;
        let clock = Arc::new(Self {
            coarse,
            stop,
            keeper: Some(keeper),
        });
        *shared = Arc::downgrade(&clock);
        Ok(clock)
    }
}

impl Drop for Monotonic {
    fn drop(&mut self) {
        self.stop.stop();
        if let Some(keeper) = self.keeper.take() {
            // The keeper cannot panic; were it to, there is nobody left to tell.
            let _ = keeper.join();
        }
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

    fn coarse(&self) -> CoarseTime {
        CoarseTime(Arc::clone(&self.coarse))
    }

    fn wait_until(&self, deadline: Nanos, stop: &Stop) {
        wait_monotonic(deadline, stop);
    }

    fn wait_with(&self, deadline: Nanos, _stop: &Stop, sleep: &mut dyn FnMut(Option<Duration>)) {
        sleep((deadline != Nanos::MAX).then(|| (deadline - monotonic_now()).to_duration()));
    }

    fn epoch(&self) -> Option<Nanos> {
        let date = SystemTime::now().duration_since(UNIX_EPOCH).ok()?;
        let date = i64::try_from(date.as_nanos()).ok()?;
        Some(Nanos(date) - monotonic_now())
    }
}

/// A clock that stands still until it is told to advance: for tests, and for simulation time.
#[derive(Debug, Default)]
pub struct Manual {
    now: Arc<AtomicI64>,
    waiters: Mutex<Vec<Waiter>>,
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

    /// Sets the clock to `now`; a clock never goes back, so an earlier time changes nothing.
    pub fn set(&self, now: Nanos) {
        self.now.fetch_max(now.0, Ordering::SeqCst);
        let now = self.now();
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

    /// Whether at least `threads` threads wait on this clock, and none of them has reached its deadline:
    /// then all that was due by now has been done.
    pub fn is_settled(&self, threads: usize) -> bool {
        let waiters = self.lock();
        let now = self.now();
        waiters.len() >= threads && waiters.iter().all(|waiter| waiter.deadline > now)
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Waiter>> {
        // A list of numbers and tokens is whole between any two of its changes.
        self.waiters.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Clock for Manual {
    fn now(&self) -> Nanos {
        Nanos(self.now.load(Ordering::SeqCst))
    }

    fn coarse(&self) -> CoarseTime {
        CoarseTime(Arc::clone(&self.now))
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
    /// Waits as a thread that the clock knows of. It is on the list before it looks at the time, so no
    /// advance is missed.
    fn wait_listed(&self, deadline: Nanos, stop: &Stop, wait: impl FnOnce()) {
        let me = stop.downgrade();
        self.lock().push(Waiter {
            deadline,
            stop: me.clone(),
        });
        wait();
        self.lock().retain(|waiter| !waiter.stop.ptr_eq(&me));
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
        let one = Monotonic::shared().expect("a thread");
        let two = Monotonic::shared().expect("a thread");
        assert!(Arc::ptr_eq(&one, &two));
        let before = one.now();
        one.wait_until(before + Nanos::from_millis(1), &Stop::new());
        assert!(two.now() >= before + Nanos::from_millis(1));
    }
}
