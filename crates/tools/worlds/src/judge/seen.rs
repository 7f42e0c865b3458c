//! The data that a tick shows.

use crate::delivery::Delivery;

/// The values that a station shows in one tick.
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

/// A tick as its end received it.
#[derive(Debug)]
pub(crate) struct Seen<'a> {
    pub(crate) began: i64,
    /// The number of the tick at the end that reads.
    pub(crate) tick: u64,
    pub(crate) is_stale: bool,
    pub(crate) is_fresh: bool,
    pub(crate) age: i64,
    pub(crate) sequence: u64,
    pub(crate) stations: &'a [Shown],
    pub(crate) deliveries: &'a [Delivery],
    /// The dispatcher's knowledge of the writer, behind a dispatcher.
    pub(crate) known: Option<Known>,
}

/// The dispatcher's knowledge of a writer at the time when it sent what a reader has heard.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Known {
    /// The oldest tick that may be seen, with its life; `None` if any may.
    pub(crate) least: Option<(u64, u64)>,
    /// The time for which nothing had come from the writer, in ns.
    pub(crate) silent: i64,
}
