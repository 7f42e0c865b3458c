//! Repeated connection attempts that never block the caller.

use std::io;
use std::net::TcpStream;
use std::sync::mpsc::{self, Receiver, TryRecvError};

use crate::{Address, prepare, reach};
use tickbus_base::time::{Nanos, Stop};

/// The pause after a failed attempt or a lost connection, before the next attempt.
const PAUSE: Nanos = Nanos::from_secs(1);

/// How long the other machine may leave data unacknowledged.
const PATIENCE: Nanos = Nanos::from_secs(10);

/// Connects on a separate thread, because a look-up blocks, and so does a host that does not answer.
#[derive(Debug)]
pub struct Dialler {
    address: Address,
    stop: Stop,
    calling: Option<Receiver<io::Result<TcpStream>>>,
    not_before: Nanos,
}

impl Dialler {
    /// A dialler for `address`, which wakes `stop` when there is a result.
    pub fn new(address: &Address, stop: &Stop) -> Self {
        Self {
            address: address.clone(),
            stop: stop.clone(),
            calling: None,
            not_before: Nanos::ZERO,
        }
    }

    /// The connection was lost: the next attempt is made after a pause.
    pub fn pause(&mut self, now: Nanos) {
        self.not_before = now + PAUSE;
    }

    /// The time at which [`turn`](Self::turn) has something to do even if no result wakes `stop`.
    pub fn deadline(&self) -> Nanos {
        if self.calling.is_some() {
            Nanos::MAX
        } else {
            self.not_before
        }
    }

    /// Begins an attempt if one is due. Returns the result of an attempt that has ended: a stream that never blocks, or
    /// the error.
    pub fn turn(&mut self, now: Nanos) -> Option<io::Result<TcpStream>> {
        let Some(calling) = &self.calling else {
            if now >= self.not_before {
                self.begin(now);
            }
            return None;
        };
        let ended = match calling.try_recv() {
            Ok(ended) => ended,
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => Err(io::Error::other("the attempt broke off")),
        };
        self.calling = None;
        if ended.is_err() {
            self.pause(now);
        }
        Some(ended)
    }

    fn begin(&mut self, now: Nanos) {
        let (sender, receiver) = mpsc::channel();
        let (address, stop) = (self.address.clone(), self.stop.clone());
        let call = move || {
            let reached = reach(&address).and_then(|stream| {
                prepare(&stream, PATIENCE)?;
                Ok(stream)
            });
            // The receiver may be gone.
            let _ = sender.send(reached);
            stop.wake();
        };
        let thread = std::thread::Builder::new().name("tickbus-dial".to_owned());
        match thread.spawn(call) {
            Ok(_) => self.calling = Some(receiver),
            // The system cannot start a thread now.
            Err(_) => self.pause(now),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    #[test]
    fn the_next_attempt_after_one_that_failed_is_made_after_a_pause() {
        let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = taken.local_addr().expect("an address").to_string();
        drop(taken);
        let mut dialler = Dialler::new(&address.parse().expect("an address"), &Stop::new());
        let now = Nanos::from_secs(5);
        assert!(dialler.turn(now).is_none() && dialler.deadline() == Nanos::MAX);
        let ended = std::iter::repeat_with(|| dialler.turn(now)).find_map(|ended| {
            std::thread::yield_now();
            ended
        });
        assert!(ended.is_some_and(|ended| ended.is_err()), "nobody listens");
        assert_eq!(dialler.deadline(), now + PAUSE);
        assert!(dialler.turn(now).is_none());
        assert_eq!(dialler.deadline(), now + PAUSE, "nothing has begun");
    }
}
