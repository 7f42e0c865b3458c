//! The bus's notes about its peers, beside the frames.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};

use super::frame::Head;
use super::stale::{NEVER, age};
use tickbus_base::time::Nanos;

/// The state of each station's peer, for statistics: readable at any time and from any thread.
#[derive(Clone, Debug)]
pub struct Peers(Arc<[Peer]>);

#[derive(Debug)]
struct Peer {
    heard: AtomicI64,
    sequence: AtomicU64,
    is_valid: AtomicBool,
    takes: AtomicBool,
}

impl Peers {
    pub(super) fn new(stations: usize) -> Self {
        let peers = (0..stations).map(|_| Peer {
            heard: NEVER.into(),
            sequence: 0.into(),
            is_valid: true.into(),
            takes: false.into(),
        });
        Self(peers.collect())
    }

    /// Notes the heads of a frame that was handed over.
    pub(super) fn note(&self, heads: &[Head]) {
        for (peer, head) in self.0.iter().zip(heads) {
            let Head {
                heard,
                sequence,
                is_valid,
            } = *head;
            peer.heard.store(heard, Ordering::Relaxed);
            peer.sequence.store(sequence, Ordering::Relaxed);
            peer.is_valid.store(is_valid, Ordering::Relaxed);
        }
    }

    /// Notes whether the peer of a station has taken frames since it was connected.
    pub(super) fn note_takes(&self, station: usize, takes: bool) {
        self.0[station].takes.store(takes, Ordering::Relaxed);
    }

    /// Returns true if the peer of a station has taken frames since it was connected.
    pub(super) fn takes(&self, station: usize) -> bool {
        self.0[station].takes.load(Ordering::Relaxed)
    }

    /// Returns the time since the peer of a station was last heard; [`Nanos::MAX`] if it never was. The age of the data
    /// that a tick shows is in its [`Arrival`](super::Arrival).
    pub fn age(&self, station: usize, now: Nanos) -> Nanos {
        age(now, self.0[station].heard.load(Ordering::Relaxed))
    }

    /// Returns the [age](Self::age) of each station.
    pub fn ages(&self, now: Nanos) -> impl Iterator<Item = Nanos> + Clone {
        (0..self.0.len()).map(move |station| self.age(station, now))
    }

    /// Returns true if the data of a station's peer are valid.
    pub fn is_valid(&self, station: usize) -> bool {
        self.0[station].is_valid.load(Ordering::Relaxed)
    }

    /// Returns the number of frames received for a station so far.
    pub fn received(&self, station: usize) -> u64 {
        self.0[station].sequence.load(Ordering::Relaxed)
    }
}
