//! The clients that feed the image, and whether they are still there.

use std::time::Instant;

use super::manager::Visitor;

/// Sessions of clients that have written, or, at stations that have nothing to write, read. Each counts for the
/// stations that it has dealt with, and for no other.
///
/// Every request of a session is a sign of life, a Publish too: a client that writes on change only has a
/// subscription or a heartbeat besides.
#[derive(Default)]
pub(super) struct Peers(Vec<Peer>);

struct Peer {
    visitor: Visitor,
    /// When its session was to expire, as seen at the last look.
    deadline: Option<Instant>,
    /// The stations that it feeds.
    stations: Vec<usize>,
}

/// What was seen of the peers since the last look.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Seen {
    /// Nobody has left.
    Same,
    /// Some have closed their sessions, or let them expire; others are there.
    Fewer,
    /// The last one has left.
    Gone,
}

impl Peers {
    /// A client has fed these stations; gives its name if it is new.
    pub(super) fn add(
        &mut self,
        visitor: Visitor,
        stations: impl IntoIterator<Item = usize>,
    ) -> Option<&str> {
        let known = self.0.iter().position(|peer| peer.visitor.id == visitor.id);
        let at = known.unwrap_or_else(|| {
            let deadline = (visitor.deadline)();
            self.0.push(Peer {
                visitor,
                deadline,
                stations: Vec::new(),
            });
            self.0.len() - 1
        });
        let peer = &mut self.0[at];
        for station in stations {
            if !peer.stations.contains(&station) {
                peer.stations.push(station);
            }
        }
        known.is_none().then_some(&*peer.visitor.name)
    }

    /// Looks at all of them; `alive` is told each station of a peer that has sent a request since the last look.
    pub(super) fn look(&mut self, mut alive: impl FnMut(usize)) -> Seen {
        let before = self.0.len();
        self.0.retain_mut(|peer| {
            let deadline = (peer.visitor.deadline)();
            if deadline.is_some() && deadline != std::mem::replace(&mut peer.deadline, deadline) {
                peer.stations.iter().for_each(|station| alive(*station));
            }
            deadline.is_some()
        });
        match self.0.len() {
            now if now == before => Seen::Same,
            0 => Seen::Gone,
            _ => Seen::Fewer,
        }
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.0.len()
    }
}
