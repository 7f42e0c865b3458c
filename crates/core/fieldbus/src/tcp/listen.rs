//! Listening, as the state of the line shows it.

use std::net::SocketAddr;

use tickbus_base::net::TcpListener;
use tickbus_base::time::Stop;
use tickbus_net::{Address, Error};

use crate::{BusError, Port};

/// Listens on `address`, without blocking; returns the listener and its bound address, or `None` if `stop` came first.
///
/// # Errors
///
/// The host is unknown, or the address cannot be listened on.
pub fn listen(
    address: &Address,
    port: &mut Port,
    stop: &Stop,
) -> Result<Option<(TcpListener, SocketAddr)>, BusError> {
    port.opening(&format!("beginning to listen on {address}"));
    let Some((listener, bound)) = tickbus_net::listen(address, &**port.clock(), stop)? else {
        return Ok(None);
    };
    port.tell("address", &bound.to_string());
    if !bound.ip().is_loopback() {
        log::info!("listening on {bound}: any computer that reaches this port can act as the peer");
    }
    Ok(Some((listener, bound)))
}

/// Counts and logs a client for which the system had no socket.
pub fn not_accepted(error: &Error, port: &Port) {
    port.count("clients.not_accepted");
    port.log(log::Level::Warn, "not accepted", format_args!("{error}"));
}
