//! The outputs of a client: the values that were set, and those still to be sent.

use crate::channel::{Channel, Counts};
use crate::number::{LONGEST_NUMBER, Number};

/// The longest line of values, in bytes, without its last value.
const LONGEST: usize = 4000;

#[derive(Debug)]
pub(super) struct Outputs {
    counts: Counts,
    all: Box<[Output]>,
    has_news: bool,
}

#[derive(Debug)]
struct Output {
    /// With a leading blank: ` Q1=`.
    label: Box<str>,
    value: Number,
    is_new: bool,
}

impl Outputs {
    pub(super) fn new(counts: Counts) -> Self {
        let output = |channel| Output {
            label: format!(" {channel}=").into(),
            value: Number::UNKNOWN,
            is_new: false,
        };
        Self {
            counts,
            all: counts.channels(true).map(output).collect(),
            has_news: false,
        }
    }

    /// The most bytes that [`write`](Self::write) adds.
    pub(super) fn longest(&self) -> usize {
        let values = self
            .all
            .iter()
            .map(|output| output.label.len() + LONGEST_NUMBER);
        let values = values.sum::<usize>();
        values + 3 * (values / LONGEST + 1)
    }

    pub(super) fn set(&mut self, channel: Channel, value: Number) {
        let place = self
            .counts
            .has_from_1(channel)
            .then(|| self.counts.place(channel))
            .flatten();
        let place = place.filter(|_| channel.kind.is_output());
        let output = &mut self.all[place.expect("an output of this client")];
        if output.value != value {
            output.value = value;
            output.is_new = true;
            self.has_news = true;
        }
    }

    /// Marks all known values for resending.
    pub(super) fn repeat(&mut self) {
        for output in &mut self.all {
            output.is_new = output.value.is_known();
            self.has_news |= output.is_new;
        }
    }

    pub(super) const fn has_news(&self) -> bool {
        self.has_news
    }

    /// Writes lines of all values that are due.
    pub(super) fn write(&mut self, out: &mut Vec<u8>) {
        let mut start = None;
        for output in &mut self.all {
            if !std::mem::take(&mut output.is_new) {
                continue;
            }
            if start.is_some_and(|start| out.len() - start >= LONGEST) {
                out.extend_from_slice(b"\r\n");
                start = None;
            }
            if start.is_none() {
                start = Some(out.len());
                out.push(b'P');
            }
            out.extend_from_slice(output.label.as_bytes());
            out.extend_from_slice(output.value.as_str().as_bytes());
        }
        if start.is_some() {
            out.extend_from_slice(b"\r\n");
        }
        self.has_news = false;
    }
}
