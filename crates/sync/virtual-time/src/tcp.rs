//! Clients over TCP, or over Unix sockets: one message each way per client and step.

mod client;
mod connection;
mod direct;
mod inbox;
mod line;
mod peers;
mod server;

use std::io::{self, ErrorKind};

use tickbus_net::is_for_later;

pub use client::{connect, connect_local, join, join_local};
pub use server::Listener;

/// True if a call with a time limit has reached it. Windows reports that as a time-out, which elsewhere means that a
/// peer does not acknowledge anything and the connection has ended.
fn is_later(error: &io::Error) -> bool {
    is_for_later(error) || (cfg!(windows) && error.kind() == ErrorKind::TimedOut)
}

/// The error of a system without Unix sockets.
#[cfg(not(unix))]
fn no_unix_sockets() -> io::Error {
    io::Error::new(ErrorKind::Unsupported, "this system has no Unix sockets")
}
