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
#[cfg(unix)]
#[path = "peers/pty.rs"]
mod pty;

#[cfg(unix)]
use modbus::Rtu;
use modbus::Tcp;

conformance!(device_serves, crate::Tcp::device_serves());
conformance!(controller_serves, crate::Tcp::controller_serves());
#[cfg(unix)]
conformance!(device_serves_on_a_serial_line, crate::Rtu::new("device"));
#[cfg(unix)]
conformance!(
    controller_serves_on_a_serial_line,
    crate::Rtu::new("controller")
);
