//! The frames of one bus cycle, and the receipt for them.

use std::ops::Range;

use tickbus_base::time::Nanos;

use super::Port;

/// Frames to send, from [`Port::take`] or [`Port::look`].
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
    /// If the station was not taken.
    #[inline]
    pub fn frame(&mut self, station: usize) -> &[u8] {
        assert!(self.stations.contains(&station), "it was not taken");
        self.port.outgoing(station, self.now)
    }

    /// Returns true if the line can carry anything to this station.
    pub fn is_station_up(&self, station: usize) -> bool {
        !self.port.faults.is_cut(station)
    }

    /// Returns true if these are the last frames: a station that refused earlier may still take these values.
    pub fn is_ending(&self) -> bool {
        self.port.is_ending()
    }

    /// The stations that were taken.
    #[inline]
    pub fn stations(&self) -> Range<usize> {
        self.stations.clone()
    }

    /// The receipt for all frames.
    #[inline]
    pub fn receipt(&self) -> Receipt {
        Receipt {
            stations: self.stations.clone(),
            bits: None,
            is_last: self.port.is_ending(),
        }
    }
}

/// The part of a cycle's frames that the peer gets. Hand the receipt to [`Port::sent`] once the peer has this part: its
/// pulses count as seen from then on. If the part never arrives, drop the receipt, and the pulses are shown again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Receipt {
    pub(super) stations: Range<usize>,
    pub(super) bits: Option<Range<usize>>,
    /// True if the frames have the fail-safe values of a closing driver.
    pub(super) is_last: bool,
}

impl Receipt {
    /// The receipt for one station's frame.
    ///
    /// # Panics
    ///
    /// If the station is not part of the receipt.
    #[must_use]
    pub fn of(&self, station: usize) -> Self {
        assert!(self.stations.contains(&station), "it was not taken");
        Self {
            stations: station..station + 1,
            bits: self.bits.clone(),
            is_last: self.is_last,
        }
    }

    /// The receipt of a bus that tells itself when a peer [has the last values](Port::has_last): this one only confirms
    /// pulses.
    #[must_use]
    pub fn of_pulses(self) -> Self {
        Self {
            is_last: false,
            ..self
        }
    }

    /// The receipt for these bits of a station's frame (bit n of byte k is 8k + n), for a peer that gets no others:
    /// pulses elsewhere do not count as seen.
    ///
    /// # Panics
    ///
    /// If the station is not part of the receipt.
    #[must_use]
    pub fn bits(&self, station: usize, bits: Range<usize>) -> Self {
        Self {
            bits: Some(bits),
            ..self.of(station)
        }
    }
}
