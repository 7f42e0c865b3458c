//! The frames of one bus cycle, and what the peer has of them.

use std::ops::Range;

use tickbus_base::time::Nanos;

use super::Port;

/// The frames to send in one bus cycle, from [`Port::take`].
#[derive(Debug)]
pub struct Frames<'a> {
    pub(super) port: &'a mut Port,
    pub(super) stations: Range<usize>,
    pub(super) now: Nanos,
}

impl Frames<'_> {
    /// The bytes that a station sends: the latest values, with every edge, or the fail-safe values if the simulation
    /// has stopped.
    ///
    /// # Panics
    ///
    /// When the station was not taken.
    pub fn frame(&mut self, station: usize) -> &[u8] {
        assert!(self.stations.contains(&station), "it was not taken");
        self.port.outgoing(station, self.now)
    }

    /// The stations that were taken.
    pub fn stations(&self) -> Range<usize> {
        self.stations.clone()
    }

    /// They go out now. `None`: they are lost on the way, so nothing is to be transmitted in this cycle.
    pub fn send(self) -> Option<Receipt> {
        let is_lost = self.port.loses_cycle();
        self.end(is_lost)
    }

    /// As [`send`](Self::send), and hands each station's frame to `deliver` if it arrives: for a line within this
    /// process.
    pub fn send_to(mut self, mut deliver: impl FnMut(usize, &[u8])) -> Option<Receipt> {
        let is_lost = self.port.loses_cycle();
        for station in self.stations() {
            let frame = self.frame(station);
            if !is_lost {
                deliver(station, frame);
            }
        }
        self.end(is_lost)
    }

    fn end(self, is_lost: bool) -> Option<Receipt> {
        let receipt = Receipt {
            stations: self.stations,
            bits: None,
        };
        if is_lost {
            // This end believes that it has sent them.
            self.port.sent(&receipt);
            return None;
        }
        Some(receipt)
    }
}

/// What the peer gets of the frames of a cycle. Hand it to [`Port::sent`] once the peer has it: pulses count as seen
/// from then on. If it never arrives, drop the receipt, and its pulses are shown again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Receipt {
    pub(super) stations: Range<usize>,
    pub(super) bits: Option<Range<usize>>,
}

impl Receipt {
    /// The part that is one station's frame.
    ///
    /// # Panics
    ///
    /// When the station is not part of it.
    #[must_use]
    pub fn of(&self, station: usize) -> Self {
        assert!(self.stations.contains(&station), "it was not taken");
        Self {
            stations: station..station + 1,
            bits: self.bits.clone(),
        }
    }

    /// The part that is these bits of a station's frame (bit n of byte k is 8k + n), for a peer that gets no others:
    /// pulses elsewhere do not count as seen.
    ///
    /// # Panics
    ///
    /// When the station is not part of it.
    #[must_use]
    pub fn bits(&self, station: usize, bits: Range<usize>) -> Self {
        Self {
            bits: Some(bits),
            ..self.of(station)
        }
    }
}
