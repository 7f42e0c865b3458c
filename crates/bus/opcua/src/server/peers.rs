//! The clients that supply the image, with a check that they are still connected.

use std::time::Duration;

use super::visitor::Visitor;

/// The sessions of clients that have written or, for stations without writable signals, have read. Each
/// counts only for the stations that it has accessed.
///
/// Every request of a session is a sign of life, Publish included: a client that writes only on change also
/// needs a subscription or a heartbeat.
#[derive(Default)]
pub(super) struct Peers(Vec<Peer>);

struct Peer {
    visitor: Visitor,
    /// The expiry of the session at the last look, as postponed by requests.
    postponed: Option<Duration>,
    /// The stations that the client supplies.
    stations: Vec<usize>,
}

/// The changes among the peers since the last look.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Seen {
    /// No peer has left.
    Same,
    /// Some peers have closed their sessions, or let them expire; others remain.
    Fewer,
    /// The last peer has left.
    Gone,
}

impl Peers {
    /// A client has supplied these stations; returns its name if the client is new.
    pub(super) fn add(
        &mut self,
        visitor: Visitor,
        stations: impl IntoIterator<Item = usize>,
    ) -> Option<&str> {
        let known = self.0.iter().position(|peer| peer.visitor.id == visitor.id);
        let at = known.unwrap_or_else(|| {
            let postponed = (visitor.postponed)();
            self.0.push(Peer {
                visitor,
                postponed,
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

    /// Checks all peers; calls `alive` with each station of a peer that has sent a request since the last look.
    pub(super) fn look(&mut self, mut alive: impl FnMut(usize)) -> Seen {
        let before = self.0.len();
        self.0.retain_mut(|peer| {
            let now = (peer.visitor.postponed)();
            if now.is_some() && now != std::mem::replace(&mut peer.postponed, now) {
                peer.stations.iter().for_each(|station| alive(*station));
            }
            now.is_some()
        });
        match self.0.len() {
            now if now == before => Seen::Same,
            0 => Seen::Gone,
            _ => Seen::Fewer,
        }
    }

    /// The number of peers.
    pub(super) fn count(&self) -> usize {
        self.0.len()
    }
}
