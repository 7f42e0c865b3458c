//! The clients that feed the image, and whether they are still there.

use std::time::Instant;

use super::manager::Visitor;

/// Sessions of clients that have written, or, where nothing is written, read.
///
/// Every request of a session counts as a sign of life, a Publish too: a client that writes on change only has
/// a subscription or a heartbeat besides.
#[derive(Default)]
pub(super) struct Peers(Vec<(Visitor, Option<Instant>)>);

/// What was seen of the peers.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Seen {
    /// One has sent a request since the last look.
    Alive,
    /// Nothing.
    Silent,
    /// The last one has closed its session, or let it expire.
    Gone,
}

impl Peers {
    /// A client has done something that feeds the image; gives its name if it is new.
    pub(super) fn add(&mut self, visitor: Visitor) -> Option<&str> {
        if self.0.iter().any(|(peer, _)| peer.id == visitor.id) {
            return None;
        }
        let deadline = (visitor.deadline)();
        self.0.push((visitor, deadline));
        self.0.last().map(|(peer, _)| &*peer.name)
    }

    /// Looks at all of them.
    pub(super) fn look(&mut self) -> Seen {
        if self.0.is_empty() {
            return Seen::Silent;
        }
        let mut alive = false;
        self.0.retain_mut(|(peer, before)| {
            let deadline = (peer.deadline)();
            alive |= deadline != std::mem::replace(before, deadline);
            deadline.is_some()
        });
        match (self.0.is_empty(), alive) {
            (true, _) => Seen::Gone,
            (false, true) => Seen::Alive,
            (false, false) => Seen::Silent,
        }
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.0.len()
    }
}
