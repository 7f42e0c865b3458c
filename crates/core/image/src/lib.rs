//! The process image: wait-free hand-over, edge counters, age, event ring.
//!
//! Two clocks meet here: the simulation's tick and the bus's cycle. Two streams of frames, one per direction, each pass
//! through a [triple buffer](triple_buffer), so that neither side ever waits for the other and no frame is ever torn. A
//! frame carries all data that belong together: the bytes and edge counters of all stations, and for each station when
//! its peer was last heard, and whether its data are valid. The two sides are [`TickEnd`] and [`BusEnd`].
//!
//! ```text
//!   tick thread                                          bus thread
//!   TickEnd::write  ──────── tx frames, edge counters ───────▶ BusEnd::attend, outgoing … sent
//!   TickEnd::update, read ◀─ rx frames, times, validity ────── BusEnd::received, touch … hand_over
//!   TickEnd::events ◀──────────── event ring ───────────────── BusEnd::events
//! ```
//!
//! "tx" and "rx" are as seen from the tick. In a Device tx is `%I` and rx is `%Q`; in a Controller it is the other way
//! round. If both sides are on one thread, one [`DirectStream`] per direction is enough.

mod bus_end;
mod direct;
mod edges;
mod event_ring;
mod frame;
mod peers;
mod row_ring;
mod stale;
mod swallowed;
mod sync;
mod tick_end;
mod triple;
mod word;

#[cfg(all(test, not(loom)))]
mod ends_tests;
#[cfg(all(test, loom))]
mod loom_tests;
#[cfg(all(test, not(loom)))]
mod model_tests;
#[cfg(all(test, not(loom)))]
mod swallowed_tests;

pub mod signal;

use frame::Place;

pub use bus_end::BusEnd;
pub use direct::DirectStream;
pub use edges::{EdgeCounter, LatchedBit, PulseShaper, latched_bits};
pub use event_ring::{Consumer, Event, Producer, event_ring};
pub use frame::StationStreams;
pub use peers::Peers;
pub use row_ring::{RowReader, RowWriter, row_ring};
pub use stale::is_stale;
pub use swallowed::{Counted, Swallowed, counted_signals};
pub use tick_end::{Arrival, Receiver, TickEnd};
pub use triple::{Reader, Writer, triple_buffer};

/// Copies the bytes of a frame: small ones, as many machines have, without a call. The pieces of those may overlap.
///
/// # Panics
///
/// When the two have different lengths.
#[inline]
pub fn copy_frame(to: &mut [u8], from: &[u8]) {
    /// The first and the last bytes.
    fn ends<const N: usize>(to: &mut [u8], from: &[u8]) {
        if let (Some(to), Some(from)) = (to.first_chunk_mut::<N>(), from.first_chunk()) {
            *to = *from;
        }
        if let (Some(to), Some(from)) = (to.last_chunk_mut::<N>(), from.last_chunk()) {
            *to = *from;
        }
    }
    assert_eq!(to.len(), from.len(), "frames of a station have one size");
    match to.len() {
        0 => {}
        1 => to[0] = from[0],
        2..4 => ends::<2>(to, from),
        4..8 => ends::<4>(to, from),
        8..=16 => ends::<8>(to, from),
        _ => to.copy_from_slice(from),
    }
}

/// Capacity of a driver's event ring.
pub const EVENT_CAPACITY: usize = 4096;

/// Creates the two ends of a driver's image, given the streams of each station.
pub fn image(stations: Vec<StationStreams>) -> (TickEnd, BusEnd) {
    image_with_events(stations, EVENT_CAPACITY)
}

/// As [`image`], with room for this many events. A full ring has 100 kB, which a driver without events does not need.
pub fn image_with_events(stations: Vec<StationStreams>, events: usize) -> (TickEnd, BusEnd) {
    let counted = |of: &StationStreams| {
        let counted = of.tx_counted.iter().chain(&of.rx_counted);
        counted.map(|one| one.signal + 1).max()
    };
    let signals = stations.iter().filter_map(counted).max();
    image_counting(stations, events, &Swallowed::new(signals.unwrap_or(0)))
}

/// As [`image_with_events`], with counters that other parts of the line may share.
pub fn image_counting(
    stations: Vec<StationStreams>,
    events: usize,
    swallowed: &Swallowed,
) -> (TickEnd, BusEnd) {
    let (producer, consumer) = event_ring(events);
    let (sent, tx) = Place::all(stations.iter().map(|s| (&*s.tx_fail_safe, &*s.tx_latched)));
    let (received, rx) = Place::all(stations.iter().map(|s| (&*s.rx_fail_safe, &*s.rx_latched)));
    let (tx_writer, tx_reader) = triple_buffer(&tx);
    let (rx_writer, rx_reader) = triple_buffer(&rx);
    let (alive, peers) = (tick_end::never(), Peers::new(stations.len()));
    let tick = TickEnd::new(
        (&stations, swallowed),
        (tx_writer, sent.clone()),
        (rx_reader, received.clone()),
        (sync::Arc::clone(&alive), peers.clone(), consumer),
    );
    let bus = BusEnd::new(
        (stations, swallowed),
        (tx_reader, sent),
        (rx_writer, received, rx),
        (alive, peers, producer),
    );
    (tick, bus)
}

#[cfg(all(test, not(loom)))]
mod tests {
    #[test]
    fn frames_of_every_size_are_copied_whole() {
        for size in 0..40_u8 {
            let from: Vec<u8> = (1..=size).collect();
            let mut to = vec![0; from.len()];
            super::copy_frame(&mut to, &from);
            assert_eq!(to, from);
        }
    }
}
