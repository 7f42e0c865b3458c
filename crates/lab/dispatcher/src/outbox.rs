//! The bytes and values that a client has not read yet.

use std::fmt;

use crate::channel::Channel;
use crate::host::Rank;
use crate::number::Number;

/// The bytes of an outbox above which no further answers are made.
const FULL: usize = 64 * 1024;

/// The bytes of an outbox above which values wait in their channels. Below the limit for answers, so that a client that
/// only sends values and never reads is still served.
const JAMMED: usize = 32 * 1024;

/// The bytes of an outbox below which waiting values are turned into lines.
const ROOM: usize = 16 * 1024;

/// The longest line of values that is made, in bytes, without its last value.
const LONGEST: usize = 4000;

/// An input's channel as it stands in a line of values: `I4=`. For another dispatcher it is a number: `17=`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Label {
    text: [u8; 8],
    length: u8,
}

impl Label {
    /// Of a channel, or of a number below ten million.
    pub(crate) fn new(name: impl fmt::Display) -> Self {
        let label = format!("{name}=");
        let mut text = [0; 8];
        text[..label.len()].copy_from_slice(label.as_bytes());
        #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
        let length = label.len() as u8;
        Self { text, length }
    }
}

/// A part of the device list still to be written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Listing {
    /// The last device written, by the order of registration.
    pub(crate) after: Option<Rank>,
    /// The rank that ends the list: devices after it came after the request.
    pub(crate) end: Rank,
    /// Devices written.
    pub(crate) count: usize,
    /// The labels of the channels are part of the list.
    pub(crate) with_names: bool,
    /// A device that is written in part, up to the label of this channel.
    pub(crate) begun: Option<(Rank, Channel)>,
}

/// The bytes that the system has not accepted for a client yet, and the data waiting after them: at most the newest
/// value of each input.
#[derive(Debug, Default)]
pub(crate) struct Outbox {
    bytes: Vec<u8>,
    written: usize,
    /// Inputs whose newest value waits, in the order in which the waiting began.
    pub(crate) waiting: Vec<usize>,
    pub(crate) listing: Option<Listing>,
    /// The outbox contained a device list. Lists are rare, so the memory is freed afterwards.
    pub(crate) is_swollen: bool,
    /// The received line that caused the last line of values, and where that begins.
    line: u64,
    line_start: usize,
    /// True if the outbox is in the list of touched seats.
    pub(crate) is_touched: bool,
}

impl Outbox {
    /// The bytes to write.
    pub(crate) fn to_write(&self) -> &[u8] {
        &self.bytes[self.written..]
    }

    /// The system has accepted `count` bytes.
    pub(crate) fn wrote(&mut self, count: usize) {
        self.written += count;
        self.line = 0;
        if self.written == self.bytes.len() {
            self.bytes.clear();
            self.written = 0;
            if std::mem::take(&mut self.is_swollen) {
                self.bytes = Vec::new();
            }
        } else if self.written > FULL {
            self.bytes.drain(..self.written);
            self.written = 0;
        }
    }

    /// True if no more answers may be made for now.
    pub(crate) fn is_full(&self) -> bool {
        self.to_write().len() >= FULL
    }

    /// True if lines of values may be made.
    pub(crate) fn has_room(&self) -> bool {
        self.to_write().len() < ROOM
    }

    /// True if a value has to wait in its channel: after others, after a list, or because the client does not read.
    pub(crate) fn is_jammed(&self) -> bool {
        !self.waiting.is_empty() || self.listing.is_some() || self.to_write().len() >= JAMMED
    }

    /// Adds a line.
    pub(crate) fn line(&mut self, text: &str) {
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.extend_from_slice(b"\r\n");
        self.line = 0;
    }

    /// Adds a value; to the last line, if the same received line caused that. Values that a client sends together thus
    /// arrive together.
    #[inline]
    pub(crate) fn value(&mut self, line: u64, label: &Label, number: &Number) {
        let mut text = [0; 40];
        let mut at = 2;
        if self.line == line && self.bytes.len() - self.line_start < LONGEST {
            self.bytes.truncate(self.bytes.len() - 2);
            text[0] = b' ';
            at = 1;
        } else {
            self.line = line;
            self.line_start = self.bytes.len();
            text[..2].copy_from_slice(b"P ");
        }
        // Copies of fixed length take fewer instructions than those of variable length.
        text[at..at + 8].copy_from_slice(&label.text);
        at += usize::from(label.length);
        text[at..at + 24].copy_from_slice(number.padded());
        at += number.len();
        text[at..at + 2].copy_from_slice(b"\r\n");
        let start = self.bytes.len();
        self.bytes.extend_from_slice(&text);
        self.bytes.truncate(start + at + 2);
    }
}
