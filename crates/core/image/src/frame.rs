//! One frame of the image: everything that one hand-over carries.

use std::ops::Range;

use super::LatchedBit;
use super::stale::NEVER;
use super::swallowed::Counted;

/// The fail-safe bytes and the latched signals of one station's two streams; tx and rx are as seen from the tick.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StationStreams {
    /// The tx bytes before the first tick, and again after the tick has stopped.
    pub tx_fail_safe: Box<[u8]>,
    /// The latched signals of the tx bytes.
    pub tx_latched: Box<[LatchedBit]>,
    /// The signals of the tx bytes whose swallowed changes are counted.
    pub tx_counted: Box<[Counted]>,
    /// The rx bytes before the first bus cycle.
    pub rx_fail_safe: Box<[u8]>,
    /// The latched signals of the rx bytes.
    pub rx_latched: Box<[LatchedBit]>,
    /// The signals of the rx bytes whose swallowed changes are counted.
    pub rx_counted: Box<[Counted]>,
}

/// The state of one station's bytes: handed over with them, so that no reader takes old bytes for young ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Head {
    /// When the peer was last heard from.
    pub(super) heard: i64,
    /// Whole frames that were received for this station so far.
    pub(super) sequence: u64,
    /// The peer's data are valid: its PLC runs, and signals that should change do.
    pub(super) is_valid: bool,
}

impl Head {
    pub(super) const NONE: Self = Self {
        heard: NEVER,
        sequence: 0,
        is_valid: true,
    };
}

/// One frame of the process image: the bytes of all stations, and everything that belongs to them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Frame {
    /// The `%I` or `%Q` of all stations, one after another.
    pub(super) bytes: Box<[u8]>,
    /// Cumulative, wrapping edge counters of the latched signals of all stations, in the order of
    /// [`latched_bits`](super::latched_bits).
    pub(super) edges: Box<[u32]>,
    /// One per station, in frames that come from the peer.
    pub(super) heads: Box<[Head]>,
    /// Hand-overs of received data so far.
    pub(super) cycles: u64,
}

/// The place of a station in a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) bytes: Range<usize>,
    pub(super) edges: Range<usize>,
}

impl Place {
    /// The places of stations with these fail-safe bytes and latched signals, and the frame before the first one.
    pub(super) fn all<'a>(
        stations: impl Iterator<Item = (&'a [u8], &'a [LatchedBit])>,
    ) -> (Vec<Self>, Frame) {
        let (mut places, mut bytes, mut edges) = (Vec::new(), Vec::new(), 0);
        for (fail_safe, latched) in stations {
            places.push(Self {
                bytes: bytes.len()..bytes.len() + fail_safe.len(),
                edges: edges..edges + latched.len(),
            });
            bytes.extend_from_slice(fail_safe);
            edges += latched.len();
        }
        let frame = Frame {
            bytes: bytes.into(),
            edges: vec![0; edges].into(),
            heads: vec![Head::NONE; places.len()].into(),
            cycles: 0,
        };
        (places, frame)
    }
}
