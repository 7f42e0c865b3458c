//! Converts the frames of a connection's stations to records and back.

use std::ops::Range;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::{DeadBands, Frames, Port, Receipt, Role};
use tickbus_image::signal::SignalTable;

use super::parts::{Messages, Parts};

/// The frames of the stations that one connection serves.
#[derive(Debug)]
pub(super) struct ConnectionFrames {
    stations: Range<usize>,
    /// Sizes of outgoing frames, and the comparison of each.
    sent: Box<[(usize, DeadBands)]>,
    /// `Some` if a message has one axis rather than the whole image.
    messages: Option<Messages>,
}

impl ConnectionFrames {
    /// Whole images of `stations`, one after another.
    pub(super) fn new(table: &SignalTable, role: Role, stations: Range<usize>) -> Self {
        let (area, _) = role.areas();
        let sent = stations.clone().map(|index| {
            let bands = DeadBands::new(table, index, area);
            (table.stations[index].bytes(area), bands)
        });
        Self {
            sent: sent.collect(),
            stations,
            messages: None,
        }
    }

    /// Splits the single station into parts, each in its own message: outgoing and incoming.
    pub(super) fn in_parts(self, sent: Parts, received: Parts) -> Self {
        Self {
            messages: Some(Messages::new(sent, received)),
            ..self
        }
    }

    /// The stations.
    pub(super) fn stations(&self) -> Range<usize> {
        self.stations.clone()
    }

    /// Sizes of outgoing and incoming records, in bytes.
    pub(super) fn sizes(&self, port: &Port) -> (usize, usize) {
        if let Some(messages) = &self.messages {
            return messages.sizes();
        }
        let sizes = self.stations().map(|station| port.sizes(station));
        sizes.fold((0, 0), |all, one| (all.0 + one.0, all.1 + one.1))
    }

    /// A connection begins: nothing has been sent or received on it.
    pub(super) fn begin(&mut self) {
        if let Some(messages) = &mut self.messages {
            messages.begin();
        }
    }

    /// Passes on a record that arrived at `now`.
    ///
    /// # Errors
    ///
    /// The record contains a part that does not exist; the text says so.
    pub(super) fn received(
        &mut self,
        now: Nanos,
        mut record: &[u8],
        port: &mut Port,
    ) -> Result<(), String> {
        if let Some(messages) = &mut self.messages {
            let (frame, sent) = messages.received(record)?;
            port.received_with(self.stations.start, now, frame, sent);
            return Ok(());
        }
        port.together(|port| {
            for station in self.stations() {
                let (frame, rest) = record.split_at(port.sizes(station).1);
                port.received(station, now, frame);
                record = rest;
            }
        });
        Ok(())
    }

    /// Fills in the record from the stations' frames.
    pub(super) fn fill(&mut self, mut space: &mut [u8], frames: &mut Frames<'_>) {
        if let Some(messages) = &mut self.messages {
            messages.fill(frames.frame(self.stations.start), space);
            return;
        }
        for station in self.stations() {
            let frame = frames.frame(station);
            let (place, rest) = space.split_at_mut(frame.len());
            place.copy_from_slice(frame);
            space = rest;
        }
    }

    /// True if the last filled record differs enough from the one sent `before` to be sent.
    pub(super) fn differ(&mut self, mut before: &[u8], mut now: &[u8]) -> bool {
        if let Some(messages) = &self.messages {
            return messages.is_news();
        }
        for (size, bands) in &mut self.sent {
            let (frames, rests) = (before.split_at(*size), now.split_at(*size));
            if bands.differ(frames.0, rests.0) {
                return true;
            }
            (before, now) = (frames.1, rests.1);
        }
        false
    }

    /// The peer has the record, or will have it.
    pub(super) fn sent(&mut self, receipt: &Receipt, port: &mut Port) {
        let Some(messages) = &mut self.messages else {
            port.sent(receipt);
            return;
        };
        for bytes in messages.sent() {
            let bits = bytes.start * 8..bytes.end * 8;
            port.sent(&receipt.bits(self.stations.start, bits));
        }
    }
}
