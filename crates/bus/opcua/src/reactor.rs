//! An async runtime without its own thread: a bus thread runs it while waiting.

use std::pin::pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::runtime::{Builder, Runtime};
use tokio::sync::Notify;

use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_fieldbus::BusError;

/// Runs tasks on the thread of its bus while the bus waits for its deadline, its [`Stop`] or news.
///
/// Deadlines are on the driver's clock. The tasks themselves wait in real time, such as for time-outs of OPC UA: that
/// crate accepts no injected clock.
///
/// The reactor is the waker of its token as long as it exists.
#[derive(Debug)]
pub(super) struct Reactor {
    /// `Some` until it is dropped.
    runtime: Option<Runtime>,
    wake: Arc<Notify>,
    stop: Stop,
}

/// The outcome of driving a future.
#[derive(Debug)]
pub(super) enum Driven<T> {
    /// The future is complete.
    Done(T),
    /// The deadline came first.
    Late,
    /// The stop came first.
    Stopped,
}

impl Reactor {
    /// A runtime whose waits `stop` ends.
    ///
    /// # Errors
    ///
    /// The system refused the resources for waiting.
    pub(super) fn new(stop: &Stop) -> Result<Self, BusError> {
        let runtime = Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build();
        let runtime = runtime.map_err(|error| {
            BusError::Link(format!(
                "the system cannot wait for sockets ({error}); close other programs or raise the limit \
                 of open files"
            ))
        })?;
        let wake = Arc::new(Notify::new());
        let waker = Arc::clone(&wake);
        stop.set_waker(Some(Arc::new(move || waker.notify_one())));
        Ok(Self {
            runtime: Some(runtime),
            wake,
            stop: stop.clone(),
        })
    }

    fn runtime(&self) -> &Runtime {
        self.runtime.as_ref().expect("it is dropped last")
    }

    /// A queue for news; an entry ends the wait.
    pub(super) fn inbox<T>(&self) -> Inbox<T> {
        Inbox {
            news: Arc::default(),
            wake: Arc::clone(&self.wake),
        }
    }

    /// Calls `make`, which may start tasks.
    pub(super) fn within<T>(&self, make: impl FnOnce() -> T) -> T {
        let _context = self.runtime().enter();
        make()
    }

    /// The number of tasks that have not ended.
    pub(super) fn tasks(&self) -> usize {
        self.runtime().metrics().num_alive_tasks()
    }

    /// Starts a task that runs during waits.
    pub(super) fn spawn(&self, task: impl Future<Output = ()> + Send + 'static) {
        // Not awaited: the task ends with the runtime at the latest.
        drop(self.runtime().spawn(task));
    }

    /// Waits until `deadline` has come on `clock`, news have arrived, or the token is stopped or woken. May return
    /// early.
    pub(super) fn wait(&self, clock: &dyn Clock, deadline: Nanos) {
        clock.wait_with(deadline, &self.stop, &mut |patience| {
            let patience = self.patience(patience);
            self.runtime().block_on(self.pause(patience));
        });
    }

    /// Runs `future` until it completes, `deadline` has come on `clock`, or the token is stopped.
    pub(super) fn drive<T>(
        &self,
        clock: &dyn Clock,
        deadline: Nanos,
        future: impl Future<Output = T>,
    ) -> Driven<T> {
        let mut future = pin!(future);
        let mut ended = None;
        loop {
            if self.stop.is_stopped() {
                return Driven::Stopped;
            }
            clock.wait_with(deadline, &self.stop, &mut |patience| {
                let patience = self.patience(patience);
                ended = self.runtime().block_on(async {
                    tokio::select! {
                        biased;
                        end = future.as_mut() => Some(end),
                        () = self.pause(patience) => None,
                    }
                });
            });
            if let Some(end) = ended.take() {
                return Driven::Done(end);
            }
            if clock.now() >= deadline {
                return Driven::Late;
            }
        }
    }

    /// Runs `future` to close something, in real time and with a limit, since the driver's clock may stand still.
    pub(super) fn farewell(&self, limit: Duration, future: impl Future) {
        self.runtime().block_on(async {
            // Do not wait any longer for a peer that does not answer.
            let _ = tokio::time::timeout(limit, future).await;
        });
    }

    /// A token that was woken before this wait would not wake it again.
    fn patience(&self, patience: Option<Duration>) -> Option<Duration> {
        if self.stop.is_woken() {
            Some(Duration::ZERO)
        } else {
            patience
        }
    }

    async fn pause(&self, patience: Option<Duration>) {
        match patience {
            None => self.wake.notified().await,
            // The timer would take a millisecond; ready tasks and sockets must get their turn without it.
            Some(Duration::ZERO) => tokio::task::yield_now().await,
            Some(span) => drop(tokio::time::timeout(span, self.wake.notified()).await),
        }
    }
}

impl Drop for Reactor {
    fn drop(&mut self) {
        self.stop.set_waker(None);
        if let Some(runtime) = self.runtime.take() {
            // Does not wait: drops the tasks.
            runtime.shutdown_background();
        }
    }
}

/// News from tasks to the waiting bus.
#[derive(Debug)]
pub(super) struct Inbox<T> {
    news: Arc<Mutex<Vec<T>>>,
    wake: Arc<Notify>,
}

impl<T> Clone for Inbox<T> {
    fn clone(&self) -> Self {
        Self {
            news: Arc::clone(&self.news),
            wake: Arc::clone(&self.wake),
        }
    }
}

impl<T> Inbox<T> {
    /// Adds one entry, and ends the wait.
    pub(super) fn push(&self, news: T) {
        self.lock().push(news);
        self.wake.notify_one();
    }

    /// Adds all of `news`, and ends the wait.
    pub(super) fn extend(&self, news: impl IntoIterator<Item = T>) {
        news.into_iter().for_each(|news| self.push(news));
    }

    /// Takes all entries, oldest first, by swapping with the empty `taken`.
    pub(super) fn take(&self, taken: &mut Vec<T>) {
        taken.clear();
        std::mem::swap(&mut *self.lock(), taken);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<T>> {
        // The list is consistent after every change, so a poisoned lock is safe to use.
        self.news.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_base::time::{Manual, Monotonic};

    #[test]
    fn a_stop_ends_a_wait_on_a_clock_that_stands_still() {
        let (clock, stop) = (Manual::new(), Stop::new());
        let reactor = Reactor::new(&stop).expect("a runtime");
        let waiting = std::thread::spawn({
            let clock = Arc::clone(&clock);
            move || reactor.drive(&*clock, Nanos::MAX, std::future::pending::<()>())
        });
        while !clock.is_settled(1) {
            std::thread::yield_now();
        }
        stop.stop();
        assert!(matches!(waiting.join(), Ok(Driven::Stopped)));
    }

    #[test]
    fn the_manual_clock_ends_a_wait_at_its_deadline() {
        let (clock, stop) = (Manual::new(), Stop::new());
        let waiting = std::thread::spawn({
            let clock = Arc::clone(&clock);
            move || {
                let reactor = Reactor::new(&stop).expect("a runtime");
                reactor.drive(&*clock, Nanos(10), std::future::pending::<()>())
            }
        });
        while !clock.is_settled(1) {
            std::thread::yield_now();
        }
        clock.advance(Nanos(10));
        assert!(matches!(waiting.join(), Ok(Driven::Late)));
    }

    #[test]
    fn tasks_run_while_the_thread_waits_and_their_news_end_the_wait() {
        let (clock, stop) = (Monotonic::shared(), Stop::new());
        let reactor = Reactor::new(&stop).expect("a runtime");
        let inbox = reactor.inbox();
        let sender = inbox.clone();
        reactor.spawn(async move {
            tokio::time::sleep(Duration::from_millis(1)).await;
            sender.push(7);
        });
        let mut news = Vec::new();
        while news.is_empty() {
            reactor.wait(&*clock, Nanos::MAX);
            inbox.take(&mut news);
        }
        assert_eq!(news, [7]);
    }
}
