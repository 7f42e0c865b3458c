//! Connecting, as the state of the line shows it.

use std::net::SocketAddr;

use tickbus_base::net::TcpStream;
use tickbus_base::time::{Nanos, Stop};
use tickbus_net::{Address, prepare};

use super::no_wait;
use crate::{BusError, Port};

/// Connects without blocking, within a few seconds; `None` if `stop` came first.
///
/// The stream is [prepared](prepare); the peer may leave sent data unacknowledged for `patience`.
///
/// # Errors
///
/// The host is unknown, or does not answer.
pub fn connect(
    address: &Address,
    patience: Nanos,
    port: &mut Port,
    stop: &Stop,
) -> Result<Option<(TcpStream, SocketAddr)>, BusError> {
    port.opening(&format!("connecting to {address}"));
    let Some(stream) = tickbus_net::connect(address, &**port.clock(), stop)? else {
        return Ok(None);
    };
    let peer = stream.peer_addr().map_err(|error| no_wait(&error))?;
    port.tell("address", &peer.to_string());
    prepare(stream.os(), patience).map_err(|error| {
        BusError::Link(format!("the connection with {peer} broke at once: {error}"))
    })?;
    Ok(Some((stream, peer)))
}
