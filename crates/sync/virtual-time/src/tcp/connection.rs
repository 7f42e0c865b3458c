//! The server's end of one connection.

use std::io::{self, Write as _};

use tickbus_base::net::{BlockingStream, TcpStream};
use tickbus_base::time::Nanos;
use tickbus_net::{IS_BROWSER, begins_like_browser, close_gracefully, prepare};

use super::inbox::{Arrived, Inbox};
use super::is_later;
use crate::server::ToClient;
use crate::wire;

/// The time limit of a read or write.
pub(super) const BLOCKED: Nanos = Nanos::from_millis(20);

/// The initial size of the buffer for received bytes.
const BUFFER: usize = 4096;

/// A connection with its buffers. The socket blocks, for at most 20 ms: in the steady state the server then reads an
/// answer with one call, without asking first if it is there.
#[derive(Debug)]
pub(super) struct Connection {
    stream: BlockingStream,
    inbox: Inbox,
    out: Vec<u8>,
    written: usize,
}

impl Connection {
    /// A connection whose peer may leave sent data unacknowledged for `patience`.
    pub(super) fn new(stream: TcpStream, patience: Nanos) -> io::Result<Self> {
        prepare(stream.os(), patience)?;
        Ok(Self {
            stream: stream.block(BLOCKED, Some(BLOCKED))?,
            inbox: Inbox::new(BUFFER),
            out: Vec::with_capacity(BUFFER),
            written: 0,
        })
    }

    /// The socket, for waiting.
    pub(super) const fn stream(&self) -> &TcpStream {
        self.stream.stream()
    }

    /// Reads once.
    pub(super) fn read(&mut self) -> Arrived {
        self.inbox.read(&self.stream)
    }

    /// Takes the next complete frame, without its header.
    pub(super) fn frame(&mut self) -> Result<Option<&[u8]>, String> {
        let is_browser = begins_like_browser(self.inbox.arrived());
        self.inbox.frame().map_err(|why| {
            if is_browser {
                IS_BROWSER.to_owned()
            } else {
                why
            }
        })
    }

    /// True if the next complete frame holds the values of a step.
    pub(super) fn has_values(&self) -> bool {
        let next = wire::frame(self.inbox.arrived());
        matches!(next, Ok(Some(frame)) if wire::is_done(frame))
    }

    /// The step of the last complete frame, if that holds values.
    pub(super) fn last_step(&self) -> Option<u64> {
        let mut left = self.inbox.arrived();
        let mut last = None;
        while let Ok(Some(frame)) = wire::frame(left) {
            last = wire::done_step(frame);
            left = &left[wire::HEADER + frame.len()..];
        }
        last
    }

    /// The number of bytes that were received and not taken.
    pub(super) fn waiting(&self) -> usize {
        self.inbox.arrived().len()
    }

    /// Sends a message, or as much of it as the system accepts.
    pub(super) fn send(&mut self, message: &ToClient<'_>) -> io::Result<()> {
        wire::to_client(&mut self.out, message);
        self.write()
    }

    /// Writes the rest.
    pub(super) fn write(&mut self) -> io::Result<()> {
        while self.is_blocked() {
            match (&self.stream).write(&self.out[self.written..]) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => self.written += count,
                Err(error) if is_later(&error) => return Ok(()),
                Err(error) => return Err(error),
            }
        }
        self.out.clear();
        self.written = 0;
        Ok(())
    }

    /// True if there is a rest to write.
    pub(super) fn is_blocked(&self) -> bool {
        self.written < self.out.len()
    }

    /// Makes reads and writes return at once from now on.
    pub(super) fn never_block(&self) {
        // If this fails, the connection has failed, and will report that.
        let _ = self.stream.never_block();
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.never_block();
        close_gracefully(&self.stream);
    }
}
