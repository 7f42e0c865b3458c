//! Clients over TCP: one message each way per client and step.

mod client;
mod connection;
mod server;

use std::io::{self, ErrorKind};

use tickbus_fieldbus::tcp::is_for_later;

pub use client::{connect, join};
pub use server::Listener;

/// Whether a call that blocks for some time at most has done so. Windows calls that a time-out, which elsewhere is the end
/// of a connection whose peer does not acknowledge anything.
fn is_later(error: &io::Error) -> bool {
    is_for_later(error) || (cfg!(windows) && error.kind() == ErrorKind::TimedOut)
}
