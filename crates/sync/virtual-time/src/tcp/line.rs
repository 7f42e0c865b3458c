//! A blocking line to the server.

use std::io::Write as _;
use std::sync::Arc;

use tickbus_base::net::{BlockingStream, TcpStream};
use tickbus_base::time::{Clock, Nanos, Stop};

use super::inbox::{Arrived, Inbox};
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
    inbox: Inbox,
}

impl TcpLine {
    pub(super) fn new(stream: BlockingStream, clock: &Arc<dyn Clock>, stop: &Stop) -> Self {
        Self {
            stream,
            clock: Arc::clone(clock),
            stop: stop.clone(),
            leaves: None,
            inbox: Inbox::new(4096),
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
        let arrived = wire::frame(self.inbox.arrived());
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
        let violated = |what| {
            let reason = format!("the server violates the protocol: it {what}");
            Ended::before(Cause::Protocol, reason)
        };
        loop {
            let arrived = wire::frame(self.inbox.arrived());
            if arrived.map_err(violated)?.is_some() {
                let frame = self.inbox.frame().map_err(violated)?;
                return Ok(frame.expect("it has arrived"));
            }
            match self.inbox.read(&self.stream) {
                Arrived::Something => {}
                Arrived::NothingYet => {
                    let begun = *begun.get_or_insert_with(|| self.clock.now());
                    if let Some(ended) = self.impatient(begun, limit) {
                        return Err(ended);
                    }
                }
                Arrived::Gone(reason) => return Err(lost(reason)),
            }
        }
    }

    fn leave_within(&mut self, limit: Nanos) {
        self.leaves = Some(self.clock.now() + limit);
    }
}
