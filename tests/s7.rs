//! The S7 buses: the conformance suite with a server and a client of ours, and what is their own.
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

mod conformance;
mod peers;
#[path = "peers/s7.rs"]
mod s7_peers;

use s7_peers::Pair;

conformance!(device_serves, crate::Pair::new("device", ""));
conformance!(device_dials, crate::Pair::new("controller", ""));
conformance!(
    by_data_blocks_and_small_units,
    crate::Pair::new("device", "pdu = 240").with_blocks()
);
