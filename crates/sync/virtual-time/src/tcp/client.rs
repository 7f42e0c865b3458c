//! The client, which blocks while it waits for the server.

use std::io::{self, ErrorKind};
use std::sync::Arc;

use tickbus_base::net::BlockingStream;
#[cfg(unix)]
use tickbus_base::net::TcpStream;
use tickbus_base::time::{Clock, Monotonic, Stop};
use tickbus_net::{Address, LocalAddress, prepare, reach_in};

use super::direct::DirectLine;
use super::line::{LOOK, PATIENCE, TcpLine};
use crate::client::{Client, Connection, client_of};
use crate::{Cause, Ended, Outcome, Participant};

/// Runs `participant` in the run of the server at `address`, until its end.
///
/// # Errors
///
/// There is no server, it refuses this client, or the run was broken off.
pub fn join(address: &Address, participant: &mut dyn Participant) -> Result<Outcome, Ended> {
    let client = client_of(participant)?;
    let clock = Monotonic::shared() as _;
    connect(address, client, &clock, &Stop::new())?.run(participant)
}

/// Connects with the server at `address`, and joins; `clock` provides the times. When `stop` is stopped, the client
/// leaves the run.
///
/// # Errors
///
/// There is no server.
pub fn connect(
    address: &Address,
    client: Client,
    clock: &Arc<dyn Clock>,
    stop: &Stop,
) -> Result<Connection, Ended> {
    let stream = open(address, &**clock).map_err(|error| unreachable(address, &error))?;
    Ok(Connection::join(
        client,
        DirectLine::new(TcpLine::new(stream, clock, stop)),
    ))
}

/// Like [`join`], at a Unix socket.
///
/// # Errors
///
/// The same as for `join`.
pub fn join_local(
    address: &LocalAddress,
    participant: &mut dyn Participant,
) -> Result<Outcome, Ended> {
    let client = client_of(participant)?;
    let clock = Monotonic::shared() as _;
    connect_local(address, client, &clock, &Stop::new())?.run(participant)
}

/// Like [`connect`], at a Unix socket.
///
/// # Errors
///
/// There is no server, or this system has no Unix sockets.
pub fn connect_local(
    address: &LocalAddress,
    client: Client,
    clock: &Arc<dyn Clock>,
    stop: &Stop,
) -> Result<Connection, Ended> {
    let stream = open_local(address).map_err(|error| unreachable(address, &error))?;
    Ok(Connection::join(
        client,
        DirectLine::new(TcpLine::new(stream, clock, stop)),
    ))
}

fn unreachable(address: &dyn std::fmt::Display, error: &io::Error) -> Ended {
    let right = match error.kind() {
        ErrorKind::Unsupported => "use HOST:PORT",
        ErrorKind::PermissionDenied => "the server has to run as the same user",
        _ => "start it first, or correct the address",
    };
    let reason = format!("no server can be reached at {address} ({error}); {right}");
    Ended::before(Cause::Lost, reason)
}

#[cfg(unix)]
fn open_local(address: &LocalAddress) -> io::Result<BlockingStream> {
    TcpStream::connect_local(address.path())?.block(LOOK, None)
}

#[cfg(not(unix))]
fn open_local(_: &LocalAddress) -> io::Result<BlockingStream> {
    Err(super::no_unix_sockets())
}

fn open(address: &Address, clock: &dyn Clock) -> io::Result<BlockingStream> {
    let stream = reach_in(address, clock.simulation())?;
    prepare(stream.os(), PATIENCE)?;
    stream.block(LOOK, None)
}
