//! The queue before stderr: logging never waits for a slow or stuck reader of stderr.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use crate::time::Nanos;

/// Capacity of the queue in bytes; enough for some thousand messages.
const MOST_BYTES: usize = 256 << 10;

/// Messages on their way, and the thread that writes them. Clones share them.
#[derive(Clone, Debug)]
pub(super) struct Queue(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    /// A message was pushed, or the queue has run empty.
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    messages: VecDeque<Box<[u8]>>,
    /// The total size of the messages in bytes.
    bytes: usize,
    /// True if the thread holds messages that are not written yet.
    writes: bool,
    /// The number of dropped messages, and of those that the log has not reported yet.
    dropped: u64,
    untold: u64,
}

impl Queue {
    /// An empty queue, and a thread that writes all messages to `to` for the rest of the process.
    ///
    /// # Errors
    ///
    /// The system refused the thread.
    pub(super) fn start(to: impl Write + Send + 'static) -> io::Result<Self> {
        let queue = Self(Arc::default());
        std::thread::Builder::new()
            .name("tickbus-log".to_owned())
            .spawn({
                let shared = Arc::clone(&queue.0);
                move || shared.write_all(to)
            })?;
        Ok(queue)
    }

    /// Queues a message; drops and counts it when there is no room.
    pub(super) fn push(&self, message: &[u8]) {
        let mut state = self.0.lock();
        if state.bytes + message.len() > MOST_BYTES {
            state.dropped += 1;
            state.untold += 1;
            return;
        }
        state.bytes += message.len();
        state.messages.push_back(message.into());
        drop(state);
        self.0.changed.notify_all();
    }

    pub(super) fn dropped(&self) -> u64 {
        self.0.lock().dropped
    }

    /// Waits until everything is written, but at most `limit`.
    pub(super) fn flush_within(&self, limit: Nanos) {
        let busy = |state: &mut State| state.writes || !state.messages.is_empty();
        let waited = self
            .0
            .changed
            .wait_timeout_while(self.0.lock(), limit.to_duration(), busy);
        drop(waited);
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // The queue is consistent after every single change, so a poisoned lock is safe to use.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes messages as they arrive, forever.
    fn write_all(&self, mut to: impl Write) {
        loop {
            let mut state = self.lock();
            state.writes = false;
            if state.messages.is_empty() {
                self.changed.notify_all();
            }
            let empty = |state: &mut State| state.messages.is_empty();
            let mut state = self
                .changed
                .wait_while(state, empty)
                .unwrap_or_else(PoisonError::into_inner);
            let messages = std::mem::take(&mut state.messages);
            let untold = std::mem::take(&mut state.untold);
            state.bytes = 0;
            state.writes = true;
            drop(state);
            for message in messages {
                // An error cannot be reported: stderr is the only place for it.
                let _ = to.write_all(&message);
            }
            let _ = to.flush();
            if untold > 0 {
                log::warn!(
                    "{untold} lines of the log were dropped, since they were not read as fast as they came"
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, Sender, channel};

    use super::*;

    /// A writer that takes a message only when the test allows it.
    struct Slow {
        may_read: Receiver<()>,
        read: Sender<Vec<u8>>,
    }

    impl Write for Slow {
        fn write(&mut self, message: &[u8]) -> io::Result<usize> {
            self.may_read.recv().map_err(io::Error::other)?;
            let _ = self.read.send(message.to_vec());
            Ok(message.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn queue() -> (Queue, Sender<()>, Receiver<Vec<u8>>) {
        let (lets, may_read) = channel();
        let (read, came) = channel();
        let queue = Queue::start(Slow { may_read, read }).expect("a thread");
        (queue, lets, came)
    }

    #[test]
    fn messages_arrive_in_order_and_a_flush_waits_for_them() {
        let (queue, lets, came) = queue();
        for number in 0..100 {
            queue.push(&[number]);
            lets.send(()).expect("it writes");
        }
        queue.flush_within(Nanos::from_secs(20));
        let came: Vec<u8> = came.try_iter().flatten().collect();
        assert_eq!(came, (0..100).collect::<Vec<u8>>());
        assert_eq!(queue.dropped(), 0);
    }

    #[test]
    fn what_nobody_reads_is_dropped_and_counted_and_nobody_waits() {
        let (queue, lets, came) = queue();
        let message = vec![7; 1 << 10];
        for _ in 0..1000 {
            queue.push(&message);
        }
        // The thread may have taken the first messages before it was made to wait.
        let dropped = queue.dropped();
        assert!((400..=1000 - 256).contains(&dropped), "{dropped}");
        queue.flush_within(Nanos::from_millis(1));
        for _ in 0..1000 - dropped {
            lets.send(()).expect("it writes");
        }
        queue.flush_within(Nanos::from_secs(20));
        assert_eq!(came.try_iter().count() as u64, 1000 - dropped);
    }
}
