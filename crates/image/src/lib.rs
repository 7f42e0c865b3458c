//! The process image: wait-free hand-over, edge counters, age, event ring.
//!
//! Two clocks meet here: the simulation's tick and the bus's cycle. Each station has two streams of
//! frames, one per direction, each through a [triple buffer](triple_buffer), so that neither side
//! ever waits for the other and no frame is ever torn. The two sides are [`TickEnd`] and [`BusEnd`].
//!
//! ```text
//!   tick thread                                          bus thread
//!   TickStation::write ──── tx frames, edge counters ───▶ BusStation::outgoing … sent
//!   TickStation::read  ◀─── rx frames, edge counters ──── BusStation::received, touch
//!   TickEnd::events    ◀────────── event ring ─────────── BusEnd::event
//! ```
//!
//! "tx" and "rx" are as seen from the tick. In a Device tx is `%I` and rx is `%Q`; in a Controller it
//! is the other way round. Where both sides are on one thread, a [`DirectStream`] does for each of them.

mod direct;
mod edges;
mod event_ring;
mod row_ring;
mod station;
mod sync;
mod triple;

pub mod signal;

pub use direct::DirectStream;
pub use edges::{EdgeCounter, LatchedBit, PulseShaper, latched_bits};
pub use event_ring::{Consumer, Event, Producer, event_ring};
pub use row_ring::{RowReader, RowWriter, row_ring};
pub use station::{Arrival, BusStation, Receiver, StationStreams, TickStation, station};
pub use triple::{Reader, Writer, triple_buffer};

/// One frame of the process image: its bytes and what belongs to them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// The station's `%I` or `%Q`.
    pub bytes: Box<[u8]>,
    /// Cumulative, wrapping edge counters of the latched signals, in the order of [`latched_bits`].
    pub edges: Box<[u32]>,
    /// Counts the frames of this stream, from 1; 0 is the frame before the first.
    pub sequence: u64,
}

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

/// The tick's end of a driver's image.
#[derive(Debug)]
pub struct TickEnd {
    /// In the order of the signal table.
    pub stations: Vec<TickStation>,
    /// The peer's writes, for applications to which every write matters.
    pub events: Consumer,
}

/// The bus's end of a driver's image.
#[derive(Debug)]
pub struct BusEnd {
    /// In the order of the signal table.
    pub stations: Vec<BusStation>,
    /// Where a bus reports the peer's writes.
    pub events: Producer,
}

/// Creates the image of a driver, given the directions of each station.
pub fn image(stations: Vec<StationStreams>) -> (TickEnd, BusEnd) {
    let (producer, consumer) = event_ring(EVENT_CAPACITY);
    let (tick, bus) = stations.into_iter().map(station).unzip();
    (
        TickEnd {
            stations: tick,
            events: consumer,
        },
        BusEnd {
            stations: bus,
            events: producer,
        },
    )
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
