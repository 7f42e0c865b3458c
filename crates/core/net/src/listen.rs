//! Listening for connections.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, ToSocketAddrs as _};

use tickbus_base::net::TcpListener;
use tickbus_base::os::{OUT_OF_FILES, is_out_of_files};
use tickbus_base::time::{Clock, Simulation, Stop};

use crate::resolve::resolve;
use crate::{Address, Error};

/// Listens on `address`, without blocking, on the network of the clock's simulation if there is one. Returns the
/// listener and its bound address, or `None` if `stop` came first.
///
/// # Errors
///
/// The host is unknown, or the address cannot be listened on.
pub fn listen(
    address: &Address,
    clock: &dyn Clock,
    stop: &Stop,
) -> Result<Option<(TcpListener, SocketAddr)>, Error> {
    let Some(addresses) = resolve(address, clock, stop)? else {
        return Ok(None);
    };
    let cannot = |error: io::Error| cannot_listen(address, &error);
    let listener = TcpListener::bind(&addresses, clock.simulation()).map_err(cannot)?;
    let bound = listener.local_addr().map_err(cannot)?;
    Ok(Some((listener, bound)))
}

/// Why `address` cannot be listened on, and what to do.
pub(crate) fn cannot_listen(address: &Address, error: &io::Error) -> Error {
    let right = match error.kind() {
        ErrorKind::AddrNotAvailable => {
            "write an \"address\" that this computer has, or 0.0.0.0 for all of them"
        }
        ErrorKind::PermissionDenied => {
            "write a port above 1023, or get the right to use this one: on Linux by sysctl \
             net.ipv4.ip_unprivileged_port_start, by setcap cap_net_bind_service=+ep, or with a redirect \
             by nft; docs/s7.md has the lines for port 102"
        }
        _ if is_out_of_files(error) => OUT_OF_FILES,
        _ => "end the program that has this port, or write another \"address\"",
    };
    Error(format!("cannot listen on {address} ({error}); {right}"))
}

/// As [`listen`], but on the network of `simulation` if there is one, and a look-up of the host blocks. Port 0 lets the
/// system choose a port.
///
/// # Errors
///
/// The host is unknown, or the address cannot be listened on.
pub fn bind(
    address: &Address,
    simulation: Option<&dyn Simulation>,
) -> io::Result<(TcpListener, SocketAddr)> {
    let addresses: Vec<SocketAddr> = address.to_string().to_socket_addrs()?.collect();
    let listener = TcpListener::bind(&addresses, simulation)?;
    let bound = listener.local_addr()?;
    Ok((listener, bound))
}
