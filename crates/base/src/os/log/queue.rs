//! The queue before stderr: nobody who logs waits for whoever reads there, or does not.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use crate::time::Nanos;

/// What the queue holds, in bytes; some thousand messages.
const MOST_BYTES: usize = 256 << 10;

/// Messages on their way, and the thread that writes them. Clones share them.
#[derive(Clone, Debug)]
pub(super) struct Queue(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    /// Something has come, or all of it has gone.
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    messages: VecDeque<Box<[u8]>>,
    /// Bytes of those.
    bytes: usize,
    /// Whether the thread has messages that are not written yet.
    writes: bool,
    /// How many messages did not fit; and of those, how many the log has not told of yet.
    dropped: u64,
    untold: u64,
}

impl Queue {
    /// An empty queue, with a thread that writes to `to` what comes, for the rest of the process.
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

    /// Takes a message, or drops and counts it when there is no room.
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

    /// Waits until all is written, but for no longer than `limit`.
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
        // A queue is whole between any two of its changes.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes what comes, without end.
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
                // Where nobody reads, nobody is told either.
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

    /// Somebody who reads a message when a test lets him.
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
        // The thread may have taken the first ones before it had to wait.
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
