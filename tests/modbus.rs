//! The Modbus buses: the conformance suite, each end by ours, and clients by hand that do not behave.
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

mod conformance;
#[path = "peers/modbus.rs"]
mod modbus;
#[allow(dead_code, reason = "some are for the socket bus")]
mod peers;

use modbus::Tcp;

conformance!(device_serves, crate::Tcp::device_serves());
conformance!(controller_serves, crate::Tcp::controller_serves());
