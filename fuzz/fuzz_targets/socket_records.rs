//! Any sequence of events on one connection of the socket bus: bytes that arrive in any pieces, a system that
//! accepts any part of what is sent, time that passes.
//!
//! The input is a header with the parameters, followed by operations of two or more bytes.

#![no_main]

use libfuzzer_sys::fuzz_target;
use tickbus_bus_socket::{Sending, Session, SessionParameters};
use tickbus_base::time::Nanos;

fuzz_target!(|data: &[u8]| {
    if let Some((terms, operations)) = terms(data) {
        Run::new(terms).operate(operations);
    }
});

fn terms(data: &[u8]) -> Option<(SessionParameters, &[u8])> {
    let (header, operations) = data.split_first_chunk::<7>()?;
    let [sending, cycle, least, age, receives, sends, wide] = *header;
    let wide = 1 + usize::from(wide) * 8;
    let terms = SessionParameters {
        sending: [Sending::Cyclic, Sending::OnChange, Sending::Reply][usize::from(sending) % 3],
        cycle: Nanos(1 + i64::from(cycle)),
        min_interval: Nanos(i64::from(least)),
        max_age: Nanos(1 + i64::from(age)),
        receives: usize::from(receives) * wide,
        sends: usize::from(sends),
    };
    Some((terms, operations))
}

struct Run {
    terms: SessionParameters,
    session: Session,
    now: Nanos,
    /// Everything received, and the records extracted from it.
    heard: Vec<u8>,
    records: Vec<u8>,
    /// Everything sent; each record is one byte repeated.
    said: Vec<u8>,
    image: u8,
}

impl Run {
    fn new(terms: SessionParameters) -> Self {
        let (heard, records, said) = (Vec::new(), Vec::new(), Vec::new());
        let session = Session::new(terms, Nanos::ZERO);
        Self { terms, session, now: Nanos::ZERO, heard, records, said, image: 0 }
    }

    fn operate(mut self, mut operations: &[u8]) {
        while let [operation, operand, rest @ ..] = operations {
            operations = rest;
            let count = usize::from(*operand);
            match operation % 4 {
                0 => self.now = self.now + Nanos(i64::from(*operand)),
                1 => {
                    let (bytes, after) = rest.split_at(count.min(rest.len()));
                    operations = after;
                    self.hear(bytes);
                }
                2 => self.speak(count),
                _ => {
                    let filling = [*operand; 1024];
                    self.hear(&filling);
                }
            }
            if self.session.check(self.now).is_err() {
                break;
            }
        }
        self.finish();
    }

    fn hear(&mut self, mut bytes: &[u8]) {
        self.heard.extend_from_slice(bytes);
        while !bytes.is_empty() {
            let space = self.session.space();
            let count = space.len().min(bytes.len());
            assert!(count > 0, "no space for the next byte");
            space[..count].copy_from_slice(&bytes[..count]);
            self.session.arrived(self.now, count);
            bytes = &bytes[count..];
            while let Some(record) = self.session.take() {
                self.records.extend_from_slice(record);
            }
        }
    }

    fn speak(&mut self, mut room: usize) {
        loop {
            if let Some(record) = self.session.due(self.now) {
                self.image = self.image.wrapping_add(1);
                record.fill(self.image);
                self.session.made(self.now, |before, now| before != now);
            }
            let rest = self.session.to_write();
            if rest.is_empty() {
                break;
            }
            let count = rest.len().min(room);
            self.said.extend_from_slice(&rest[..count]);
            room -= count;
            if !self.session.wrote(count) {
                // Blocked until the system accepts more, or time has passed.
                break;
            }
        }
        if self.session.check(self.now).is_ok() {
            assert!(self.session.deadline() > self.now, "a deadline that has passed");
        }
    }

    fn finish(mut self) {
        self.speak(usize::MAX);
        // Every ending can be put into words.
        let _ = self.session.left().of("peer").to_string();
        let SessionParameters { receives, sends, sending, .. } = self.terms;
        if receives > 0 {
            let whole = self.heard.len() / receives * receives;
            assert_eq!(self.records, self.heard[..whole], "the records are the stream, cut");
        }
        if sends > 0 {
            assert_eq!(self.said.len() % sends, 0, "a part of a record went out");
            for record in self.said.chunks(sends) {
                assert!(record.iter().all(|byte| *byte == record[0]), "two images in one record");
            }
            if sending == Sending::Reply && receives > 0 {
                assert_eq!(self.said.len() / sends, self.records.len() / receives, "one for one");
            }
        }
    }
}
