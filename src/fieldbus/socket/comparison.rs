//! Whether a record differs enough from another one to be sent.

use crate::fieldbus::{DeadBands, Role};
use crate::signal::SignalTable;

/// Compares the records that one end sends, station by station.
#[derive(Debug)]
pub(super) struct Comparison {
    /// Sizes of the stations' frames, and how each of them is compared.
    stations: Box<[(usize, DeadBands)]>,
}

impl Comparison {
    pub(super) fn new(table: &SignalTable, role: Role) -> Self {
        let (area, _) = role.areas();
        let stations = table.stations.iter().enumerate().map(|(index, station)| {
            let bands = DeadBands::new(table, index, area);
            (station.bytes(area), bands)
        });
        Self {
            stations: stations.collect(),
        }
    }

    pub(super) fn differ(&mut self, mut before: &[u8], mut now: &[u8]) -> bool {
        for (size, bands) in &mut self.stations {
            let (frames, rests) = (before.split_at(*size), now.split_at(*size));
            if bands.differ(frames.0, rests.0) {
                return true;
            }
            (before, now) = (frames.1, rests.1);
        }
        false
    }
}
