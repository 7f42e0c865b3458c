//! Connecting, again and again, without keeping anybody waiting.

use std::io;
use std::net::TcpStream;
use std::sync::mpsc::{self, Receiver, TryRecvError};

use super::{Address, prepare, reach};
use tickbus_base::time::{Nanos, Stop};

/// How long after an attempt has failed, or a connection was lost, the next attempt begins.
const PAUSE: Nanos = Nanos::from_secs(1);

/// How long the other machine may leave data unacknowledged.
const PATIENCE: Nanos = Nanos::from_secs(10);

/// Connects on a thread of its own: looking a name up blocks, and so does a host that does not answer.
#[derive(Debug)]
pub struct Dialler {
    address: Address,
    stop: Stop,
    calling: Option<Receiver<io::Result<TcpStream>>>,
    not_before: Nanos,
}

impl Dialler {
    /// Calls `address`; wakes `stop` when there is a result.
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

    /// When [`turn`](Self::turn) has something to do even if it is not woken.
    pub fn deadline(&self) -> Nanos {
        if self.calling.is_some() {
            Nanos::MAX
        } else {
            self.not_before
        }
    }

    /// Begins an attempt if it is time, and returns the result of one that has ended: a stream that never blocks, or why
    /// there is none.
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
            // The system has no thread now.
            Err(_) => self.pause(now),
        }
    }
}
