//! The examination of a line.

use tickbus_fieldbus::examine::{Examination, Wire, WireEnd};

use super::{Message, Options, Sending, TcpRole};

impl Options {
    /// Examines the line: whether the peer accepts a connection, and whether records come without a question.
    pub(crate) fn examine(&self, examination: &mut Examination<'_>) {
        if self.tcp == TcpRole::Listen {
            let addresses = if self.stations.is_empty() {
                std::slice::from_ref(&self.address)
            } else {
                &self.stations[..]
            };
            let can = addresses
                .iter()
                .all(|address| examination.can_listen(address));
            if can {
                examination.sizes("a record in each direction");
            }
            return;
        }
        let Some((_, wire)) = examination.reach(&self.address) else {
            return;
        };
        examination.sizes("a record in each direction");
        self.receive(examination, wire);
    }

    /// The step `protocol`: whether bytes come, and whether they are whole records.
    fn receive(&self, examination: &mut Examination<'_>, mut wire: Wire) {
        let within = examination.watch;
        let deadline = wire.now() + within;
        let mut received = Vec::new();
        let end = loop {
            match wire.receive(&mut received, deadline) {
                Ok(()) if examination.stop.is_stopped() => break WireEnd::Silent,
                Ok(()) => {}
                Err(end) => break end,
            }
        };
        let count = received.len();
        match (end, count) {
            (WireEnd::Silent, 0) => {
                let next = match self.sending {
                    Sending::Reply => "the peer begins: see whether its program runs",
                    _ => {
                        "the peer may send on change alone, or wait for the first record; otherwise see whether its \
                         program runs"
                    }
                };
                let evidence = format!("the peer sends nothing within {within}");
                examination.warn("protocol", "silent", evidence, next);
            }
            (WireEnd::Silent, _) => self.judge(examination, count),
            (end, _) => {
                let next = "see whether the peer serves one connection, and another program has it";
                let evidence = format!("the peer {end} after {count} bytes");
                examination.fail("protocol", "connection-lost", evidence, next);
            }
        }
    }

    /// Judges whether a number of bytes is one of whole records.
    fn judge(&self, examination: &mut Examination<'_>, count: usize) {
        let (_, area) = examination.setup.role.areas();
        let stations = examination.setup.table.stations.iter();
        let record: usize = stations.map(|station| station.bytes(area)).sum();
        let within = examination.watch;
        if self.message != Message::Image || record == 0 {
            examination.ok("protocol", format!("{count} bytes came within {within}"));
            return;
        }
        let evidence = format!("{count} bytes came within {within}");
        if count.is_multiple_of(record) {
            let records = count / record;
            let evidence = format!("{evidence}: {records} records of {record} bytes");
            examination.ok("protocol", evidence);
        } else {
            let evidence = format!("{evidence}, which are no whole records of {record} bytes");
            let next = "compare the length of a record with that of the peer: input_bytes and output_bytes set it";
            examination.warn("protocol", "record-length", evidence, next);
        }
    }
}
