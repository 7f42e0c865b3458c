//! The bytes and values that wait to be sent to one side.

use std::io::Write as _;

use tickbus_dispatcher::{Channel, Number};

/// While fewer bytes than this wait, each line of values is forwarded as it is; otherwise only the newest value of each
/// channel is kept. A line at 9600 baud sends about this many bytes in a second.
const ROOM: usize = 1024;

/// From here on nothing more is accepted.
const FULL: usize = 64 * 1024;

/// The longest line of values that have waited, plus one value, in bytes; short, so that newer ones are not late.
const LONGEST: usize = 256;

/// Bytes that wait to be sent, followed by the newest value of each channel.
#[derive(Debug)]
pub(crate) struct Outbox {
    end: &'static [u8],
    bytes: Vec<u8>,
    written: usize,
    waiting: Vec<(Channel, Number)>,
    /// Values that were replaced by newer ones.
    pub(crate) overtaken: u64,
}

impl Outbox {
    /// An empty outbox, whose lines end with `end`.
    pub(crate) const fn new(end: &'static [u8]) -> Self {
        Self {
            end,
            bytes: Vec::new(),
            written: 0,
            waiting: Vec::new(),
            overtaken: 0,
        }
    }

    /// True if the backlog is so large that nothing more should be requested.
    pub(crate) fn is_full(&self) -> bool {
        self.bytes.len() - self.written >= FULL
    }

    /// Adds a line.
    pub(crate) fn line(&mut self, text: &[u8]) {
        self.bytes.extend_from_slice(text);
        self.bytes.extend_from_slice(self.end);
    }

    /// Adds a line of values, which are `items`.
    pub(crate) fn values(&mut self, text: &[u8], items: &[(Channel, Number)]) {
        if self.waiting.is_empty() && self.bytes.len() - self.written < ROOM {
            self.line(text);
        } else {
            self.newest(items);
        }
    }

    /// Adds values that replace the waiting ones of their channels.
    pub(crate) fn newest(&mut self, items: &[(Channel, Number)]) {
        for item in items {
            self.overtaken += u64::from(put(&mut self.waiting, *item));
        }
    }

    /// The bytes to send now.
    pub(crate) fn next_bytes(&mut self) -> &[u8] {
        if self.written == self.bytes.len() {
            self.bytes.clear();
            self.written = 0;
            let mut taken = 0;
            for (channel, number) in &self.waiting {
                if taken == 0 {
                    self.bytes.push(b'P');
                } else if self.bytes.len() >= LONGEST {
                    break;
                }
                // Writing to a vector cannot fail.
                let _ = write!(self.bytes, " {channel}={number}");
                taken += 1;
            }
            if taken > 0 {
                self.waiting.drain(..taken);
                self.bytes.extend_from_slice(self.end);
            }
        }
        &self.bytes[self.written..]
    }

    /// The first `count` bytes of [`next_bytes`](Self::next_bytes) were sent.
    pub(crate) fn wrote(&mut self, count: usize) {
        self.written += count;
        if self.written > FULL {
            self.bytes.drain(..self.written);
            self.written = 0;
        }
    }

    /// Drops everything that waits.
    pub(crate) fn clear(&mut self) {
        self.bytes = Vec::new();
        self.written = 0;
        self.waiting.clear();
    }
}

/// Replaces the value of its channel, or appends it; returns whether there was one.
pub(crate) fn put(list: &mut Vec<(Channel, Number)>, item: (Channel, Number)) -> bool {
    let found = list.iter_mut().find(|(channel, _)| *channel == item.0);
    if let Some(old) = found {
        *old = item;
        return true;
    }
    list.push(item);
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(channel: &str, number: u32) -> (Channel, Number) {
        let channel = Channel::parse(channel.as_bytes()).expect("a channel");
        let number = Number::parse(number.to_string().as_bytes());
        (channel, number.expect("a number"))
    }

    #[test]
    fn lines_pass_as_they_are_until_the_side_is_slow_and_then_the_newest_values_remain() {
        let mut outbox = Outbox::new(b"\r");
        let (mut sent, mut made) = (Vec::new(), 0);
        while made < 1000 {
            let text = format!("P I1={made} I2={made}");
            outbox.values(text.as_bytes(), &[value("I1", made), value("I2", made)]);
            made += 1;
        }
        loop {
            let count = outbox.next_bytes().len().min(7);
            if count == 0 {
                break;
            }
            sent.extend_from_slice(&outbox.next_bytes()[..count]);
            outbox.wrote(count);
        }
        let sent = String::from_utf8(sent).expect("text");
        let lines: Vec<&str> = sent.split_terminator('\r').collect();
        let (last, first) = lines.split_last().expect("a line");
        for (number, line) in first.iter().enumerate() {
            assert_eq!(*line, format!("P I1={number} I2={number}"));
        }
        assert_eq!(*last, "P I1=999 I2=999");
        let passed = u64::try_from(first.len()).expect("few");
        assert_eq!(outbox.overtaken, 2 * (1000 - passed - 1));
        assert!(sent.len() < ROOM + LONGEST);
    }

    #[test]
    fn values_that_waited_come_in_lines_of_moderate_length() {
        let mut outbox = Outbox::new(b"\n");
        let all: Vec<_> = (1..=256).map(|i| value(&format!("AI{i}"), i)).collect();
        outbox.newest(&all);
        let mut read = Vec::new();
        loop {
            let text = String::from_utf8(outbox.next_bytes().to_vec()).expect("text");
            if text.is_empty() {
                break;
            }
            outbox.wrote(text.len());
            assert!(text.len() < LONGEST + 20, "{text}");
            let line = text
                .strip_prefix("P ")
                .and_then(|line| line.strip_suffix('\n'));
            read.extend(line.expect("a line").split(' ').map(str::to_owned));
        }
        assert_eq!(
            read,
            (1..=256).map(|i| format!("AI{i}={i}")).collect::<Vec<_>>()
        );
    }
}
