//! The polling state of one station.

use crate::table::Span;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::Receipt;

use super::super::plan::{Capabilities, queries};
use super::super::request::{Region, Request};
use super::Identity;
use super::trouble::Trouble;
use crate::Piece;

/// The polling state of a station.
#[derive(Debug)]
pub(in super::super) struct Station {
    pub(super) unit: u8,
    reads: Vec<Piece>,
    writes: Vec<Piece>,
    pub(super) able: Capabilities,
    /// `Some` if the queries are up to date; true if they may write.
    prepared: Option<bool>,
    pub(super) queries: Vec<Request>,
    pub(super) sends: Vec<u8>,
    /// The receipt for the frame in `sends`.
    pub(super) receipt: Option<Receipt>,
    pub(super) receives: Vec<u8>,
    pub(super) identity: Identity,
    /// How many connections in a row ended while the device was asked for its identity.
    pub(super) hang_ups: u8,
    /// How many times in a row the device seemed to have no identity, though `write_to` names one.
    pub(super) presumed: u32,
    pub(super) trouble: Trouble,
}

impl Station {
    /// A station with these pieces to read and write, and a received frame of this many bytes.
    pub(in super::super) fn new(
        unit: u8,
        reads: Vec<Piece>,
        writes: Vec<Piece>,
        receives: usize,
    ) -> Self {
        Self {
            unit,
            reads,
            writes,
            able: Capabilities::new(true, 0),
            prepared: None,
            queries: Vec::new(),
            sends: Vec::new(),
            receipt: None,
            receives: vec![0; receives],
            identity: Identity::default(),
            hang_ups: 0,
            presumed: 0,
            trouble: Trouble::default(),
        }
    }

    /// A connection begins: the device is unknown.
    pub(super) fn connect(&mut self, able: Capabilities) {
        self.able = able;
        self.prepared = None;
        self.identity = Identity::default();
        self.trouble = Trouble::default();
    }

    /// True if the station is skipped in this cycle.
    pub(super) fn rests(&self, now: Nanos) -> bool {
        now < self.trouble.rests_until
    }

    /// True if its device is to be asked for its identity now: before anything is written, and never if nothing is.
    pub(super) fn wants_identity(&self, now: Nanos) -> bool {
        !self.writes.is_empty() && self.identity.is_due(now)
    }

    /// Makes [`prepare`](Self::prepare) plan the queries again before the next one is sent.
    pub(super) fn forget_queries(&mut self) {
        self.prepared = None;
    }

    pub(super) fn is_to_be_prepared(&self) -> bool {
        self.prepared.is_none()
    }

    /// Plans the queries again if they are outdated.
    pub(super) fn prepare(&mut self, may_write: bool) {
        if self.prepared.replace(may_write) == Some(may_write) {
            return;
        }
        let writes: &[Piece] = if may_write { &self.writes } else { &[] };
        self.queries = queries(&self.reads, writes, &self.able);
        if self.queries.is_empty() {
            // Even so, read something to check that the device is alive.
            let look = |piece: &Piece| {
                let Span { first, .. } = piece.span();
                Request::Read(Region::new(piece.table, Span { first, count: 1 }))
            };
            self.queries.extend(self.writes.first().map(look));
        }
    }
}
