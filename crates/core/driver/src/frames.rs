//! The frames of each end: the areas that it writes and reads, and their fail-safe values.

use tickbus_fieldbus::Role;
use tickbus_image::signal::{Area, SignalTable, fail_safe_frame};
use tickbus_image::{StationStreams, counted_signals, latched_bits};

/// Returns the size of a station's area in bytes.
pub(super) fn area_bytes(table: &SignalTable, station: usize, area: Area) -> usize {
    match area {
        Area::Input => table.stations[station].input_bytes,
        Area::Output => table.stations[station].output_bytes,
    }
}

/// Returns the streams of each station's image at the end with `role`.
pub(super) fn directions(table: &SignalTable, role: Role) -> Vec<StationStreams> {
    let (tx, rx) = role.areas();
    (0..table.stations.len())
        .map(|station| StationStreams {
            tx_fail_safe: fail_safe_frame(table, station, tx),
            tx_latched: latched_bits(table, station, tx),
            tx_counted: counted_signals(table, station, tx),
            rx_fail_safe: fail_safe_frame(table, station, rx),
            rx_latched: latched_bits(table, station, rx),
            rx_counted: counted_signals(table, station, rx),
        })
        .collect()
}
