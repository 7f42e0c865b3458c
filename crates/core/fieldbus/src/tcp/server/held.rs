//! Answers that faults hold back.

use tickbus_base::time::Nanos;

use crate::Port;

/// An answer that a fault holds back.
#[derive(Debug)]
pub(super) struct Held {
    pub(super) due: Nanos,
    pub(super) answer: Vec<u8>,
    /// The stations that answer late; empty for an answer that waits behind another one.
    pub(super) stations: Vec<usize>,
}

impl Held {
    /// An answer that was made at `now` and goes out this much later, but not before the one ahead of it.
    pub(super) fn new(
        ahead: Option<&Self>,
        answer: Vec<u8>,
        (now, late): (Nanos, Nanos),
        port: &mut Port,
    ) -> Self {
        let earliest = ahead.map_or(now, |ahead| ahead.due);
        let stations = if late > Nanos::ZERO {
            port.take_late_stations()
        } else {
            Vec::new()
        };
        Self {
            due: earliest.max(now + late),
            answer,
            stations,
        }
    }

    /// The same answer, byte by byte with this time between two of them; in one piece if it is zero.
    pub(super) fn apart(self, pause: Nanos) -> impl Iterator<Item = Self> {
        let size = if pause > Nanos::ZERO {
            1
        } else {
            self.answer.len()
        };
        let mut due = self.due;
        let pieces: Vec<Vec<u8>> = self.answer.chunks(size).map(<[u8]>::to_vec).collect();
        pieces.into_iter().map(move |answer| {
            let piece = Self {
                due,
                answer,
                stations: self.stations.clone(),
            };
            due += pause;
            piece
        })
    }

    /// Returns true if a station of it is dead: that sends nothing, not even the answer that it owes.
    pub(super) fn is_lost(&self, now: Nanos, port: &mut Port) -> bool {
        // A protocol may answer for more stations than its line has.
        let there = self.stations.iter().filter(|at| **at < port.stations());
        let there: Vec<usize> = there.copied().collect();
        there.into_iter().any(|at| !port.is_station_up(at, now))
    }
}
