//! One station, as it is polled.

use crate::table::Span;
use tickbus_base::time::Nanos;

use super::super::Piece;
use super::super::plan::{Abilities, queries};
use super::super::query::{Query, Region};
use super::Identity;
use super::trouble::Trouble;

/// A station, as it is polled.
#[derive(Debug)]
pub(in super::super) struct Station {
    pub(super) unit: u8,
    reads: Vec<Piece>,
    writes: Vec<Piece>,
    pub(super) able: Abilities,
    /// Whether the queries are those of what is known now, and whether they may write.
    prepared: Option<bool>,
    pub(super) queries: Vec<Query>,
    pub(super) sends: Vec<u8>,
    pub(super) receives: Vec<u8>,
    pub(super) identity: Identity,
    /// How many connections in a row ended when the device was asked who it is.
    pub(super) hang_ups: u8,
    pub(super) trouble: Trouble,
}

impl Station {
    /// A station that reads and writes these pieces, into a frame of so many bytes.
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
            able: Abilities::new(true, 0),
            prepared: None,
            queries: Vec::new(),
            sends: Vec::new(),
            receives: vec![0; receives],
            identity: Identity::default(),
            hang_ups: 0,
            trouble: Trouble::default(),
        }
    }

    /// A connection begins: nothing is known of the device.
    pub(super) fn connect(&mut self, able: Abilities) {
        self.able = able;
        self.prepared = None;
        self.identity = Identity::default();
        self.trouble = Trouble::default();
    }

    /// Whether it is left alone in this cycle.
    pub(super) fn rests(&self, now: Nanos) -> bool {
        now < self.trouble.rests_until
    }

    /// Whether its device is to be asked now who it is: before anything is written, and never if nothing is.
    pub(super) fn wants_identity(&self, now: Nanos) -> bool {
        !self.writes.is_empty() && self.identity.is_due(now)
    }

    /// The queries are to be made anew before the next one goes out.
    pub(super) fn forget_queries(&mut self) {
        self.prepared = None;
    }

    pub(super) fn is_to_be_prepared(&self) -> bool {
        self.prepared.is_none()
    }

    /// Makes the queries anew if they are not those of what is known.
    pub(super) fn prepare(&mut self, may_write: bool) {
        if self.prepared.replace(may_write) == Some(may_write) {
            return;
        }
        let writes: &[Piece] = if may_write { &self.writes } else { &[] };
        self.queries = queries(&self.reads, writes, &self.able);
        if self.queries.is_empty() {
            // Whether it lives is to be known all the same.
            let look = |piece: &Piece| {
                let Span { first, .. } = piece.span();
                Query::Read(Region::new(piece.table, Span { first, count: 1 }))
            };
            self.queries.extend(self.writes.first().map(look));
        }
    }
}
