//! A blocking line to the server.

use std::io::{Read as _, Write as _};
use std::sync::Arc;

use tickbus_base::net::{BlockingStream, TcpStream};
use tickbus_base::time::{Clock, Nanos, Stop};

use super::is_later;
use crate::client::{Line, closed, silent};
use crate::{Cause, Ended, wire};

/// How long a read blocks before it checks for a stop.
pub(super) const LOOK: Nanos = Nanos::from_millis(50);

/// The time without any TCP acknowledgement after which the other machine counts as lost.
pub(super) const PATIENCE: Nanos = Nanos::from_secs(10);

/// A line to the server.
#[derive(Debug)]
pub(super) struct TcpLine {
    stream: BlockingStream,
    clock: Arc<dyn Clock>,
    stop: Stop,
    /// When `receive` gives up in any case.
    leaves: Option<Nanos>,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
}

impl TcpLine {
    pub(super) fn new(stream: BlockingStream, clock: &Arc<dyn Clock>, stop: &Stop) -> Self {
        Self {
            stream,
            clock: Arc::clone(clock),
            stop: stop.clone(),
            leaves: None,
            buffer: vec![0; 4096],
            start: 0,
            end: 0,
        }
    }

    /// The socket, for waiting.
    pub(super) const fn stream(&self) -> &TcpStream {
        self.stream.stream()
    }

    pub(super) fn clock(&self) -> &dyn Clock {
        &*self.clock
    }

    /// True if a frame has arrived that was not received yet.
    pub(super) fn has_frame(&self) -> bool {
        let arrived = wire::frame(&self.buffer[self.start..self.end]);
        !matches!(arrived, Ok(None))
    }

    /// Why a wait that has lasted since `begun` has to end now; `None` if it goes on.
    pub(super) fn impatient(&self, begun: Nanos, limit: Nanos) -> Option<Ended> {
        if self.stop.is_stopped() {
            return Some(Ended::before(Cause::Stopped, "this client was stopped"));
        }
        let now = self.clock.now();
        if self.leaves.is_some_and(|by| now >= by) {
            return Some(closed());
        }
        (now >= begun + limit - LOOK).then(|| silent(limit))
    }
}

pub(super) fn lost(what: impl std::fmt::Display) -> Ended {
    Ended::before(Cause::Lost, format!("the server was lost: {what}"))
}

impl Line for TcpLine {
    fn send(&mut self, frame: &[u8]) {
        // On failure, the next read returns the server's last words, or that the server is lost.
        let _ = (&self.stream).write_all(frame);
    }

    fn receive(&mut self, limit: Nanos) -> Result<&[u8], Ended> {
        // Read the clock only when there is time for that.
        let mut begun = None;
        loop {
            let arrived = wire::frame_length(&self.buffer[self.start..self.end]);
            let violated = |what| {
                let reason = format!("the server violates the protocol: it {what}");
                Ended::before(Cause::Protocol, reason)
            };
            if let Some(length) = arrived.map_err(violated)?
                && length <= self.end - self.start
            {
                let frame = self.start + wire::HEADER..self.start + length;
                self.start = frame.end;
                return Ok(&self.buffer[frame]);
            }
            self.buffer.copy_within(self.start..self.end, 0);
            (self.start, self.end) = (0, self.end - self.start);
            if self.end == self.buffer.len() {
                self.buffer.resize(2 * self.end, 0);
            }
            match (&self.stream).read(&mut self.buffer[self.end..]) {
                Ok(0) => return Err(lost("it closed the connection")),
                Ok(count) => self.end += count,
                Err(error) if is_later(&error) => {
                    let begun = *begun.get_or_insert_with(|| self.clock.now());
                    if let Some(ended) = self.impatient(begun, limit) {
                        return Err(ended);
                    }
                }
                Err(error) => return Err(lost(error)),
            }
        }
    }

    fn leave_within(&mut self, limit: Nanos) {
        self.leaves = Some(self.clock.now() + limit);
    }
}
