//! What a tick shows.

use crate::delivery::Delivery;

/// What a station shows in one tick.
#[derive(Clone, Debug)]
pub(crate) struct Shown {
    pub(crate) stamp: u64,
    pub(crate) level: bool,
    pub(crate) edges: u64,
    pub(crate) numbers: Option<(f64, f64)>,
    /// The slots of the signals beside the stamp.
    pub(crate) typed: Vec<u64>,
    /// The heartbeat of station 0, if there is one.
    pub(crate) beat: Option<u8>,
}

/// A tick as its end got it.
#[derive(Debug)]
pub(crate) struct Seen<'a> {
    pub(crate) began: i64,
    /// The tick of the end that sees.
    pub(crate) tick: u64,
    pub(crate) is_stale: bool,
    pub(crate) is_fresh: bool,
    pub(crate) age: i64,
    pub(crate) sequence: u64,
    pub(crate) stations: &'a [Shown],
    pub(crate) deliveries: &'a [Delivery],
    /// Through a dispatcher.
    pub(crate) known: Option<Known>,
}

/// What who stands between both ends knew of a writer when it sent what a reader has heard.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Known {
    /// The oldest that may be seen, as life and tick; `None` if anything may.
    pub(crate) least: Option<(u64, u64)>,
    /// For how long nothing had come from the writer, in ns.
    pub(crate) silent: i64,
}
