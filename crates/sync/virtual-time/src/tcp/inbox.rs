//! Received bytes, from which frames are taken.

use std::io::Read as _;

use tickbus_base::net::BlockingStream;

use super::is_later;
use crate::wire;

/// The result of a read.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Arrived {
    Something,
    NothingYet,
    /// The connection is gone, for this reason.
    Gone(String),
}

/// The received bytes of a connection that were not taken yet.
#[derive(Debug)]
pub(super) struct Inbox {
    bytes: Vec<u8>,
    start: usize,
    end: usize,
}

impl Inbox {
    /// An empty one with room for `size` bytes at first.
    pub(super) fn new(size: usize) -> Self {
        Self {
            bytes: vec![0; size],
            start: 0,
            end: 0,
        }
    }

    /// The bytes that were not taken.
    pub(super) fn arrived(&self) -> &[u8] {
        &self.bytes[self.start..self.end]
    }

    /// Takes the next complete frame, without its header.
    pub(super) fn frame(&mut self) -> Result<Option<&[u8]>, String> {
        let frame = wire::frame(&self.bytes[self.start..self.end])?;
        if let Some(frame) = frame {
            self.start += wire::HEADER + frame.len();
        }
        Ok(frame)
    }

    /// Reads once, for as long as the stream blocks.
    pub(super) fn read(&mut self, mut stream: &BlockingStream) -> Arrived {
        if self.start == self.end {
            (self.start, self.end) = (0, 0);
        } else if self.start > 0 {
            self.bytes.copy_within(self.start..self.end, 0);
            (self.start, self.end) = (0, self.end - self.start);
        }
        if self.end == self.bytes.len() {
            // Frames have a limit, so this ends; and the peer has to send as many bytes as we allocate.
            self.bytes.resize(2 * self.end, 0);
        }
        match stream.read(&mut self.bytes[self.end..]) {
            Ok(0) => Arrived::Gone("it closed the connection".to_owned()),
            Ok(count) => {
                self.end += count;
                Arrived::Something
            }
            Err(error) if is_later(&error) => Arrived::NothingYet,
            Err(error) => Arrived::Gone(error.to_string()),
        }
    }
}
