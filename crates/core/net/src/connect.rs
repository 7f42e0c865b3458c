//! Connecting.

use std::io::{self, ErrorKind};
use std::net::{self, SocketAddr, ToSocketAddrs as _};

use rustix::io::Errno;
use socket2::{Domain, Protocol, Socket, Type};
use tickbus_base::net::TcpStream;
use tickbus_base::os::{Interest, OUT_OF_FILES, PollSet, is_out_of_files};
use tickbus_base::time::{Clock, Nanos, Simulation, Stop};

use crate::resolve::resolve;
use crate::{Address, Error};

/// The time in which an address must answer. The system itself would try for minutes.
const PATIENCE: Nanos = Nanos::from_secs(5);

/// Connects without blocking, within a few seconds, on the network of the clock's simulation if there is one; `None` if
/// `stop` came first.
///
/// # Errors
///
/// The host is unknown, or does not answer.
pub fn connect(
    address: &Address,
    clock: &dyn Clock,
    stop: &Stop,
) -> Result<Option<TcpStream>, Error> {
    let mut set = PollSet::new(stop);
    let Some(addresses) = resolve(address, clock, stop)? else {
        return Ok(None);
    };
    reach_any(&addresses, &mut set, clock, stop)
}

/// As [`reach`], but on the network of `simulation` if there is one.
///
/// # Errors
///
/// As [`reach`].
pub fn reach_in(address: &Address, simulation: Option<&dyn Simulation>) -> io::Result<TcpStream> {
    let Some(simulation) = simulation else {
        return reach(address).map(TcpStream::from);
    };
    let mut addresses = address.to_string().to_socket_addrs()?;
    let stream = simulation.connect(addresses.next().ok_or(ErrorKind::NotFound)?)?;
    if !stream.wait(Interest::Write, PATIENCE) {
        return Err(ErrorKind::TimedOut.into());
    }
    match stream.take_error()? {
        Some(error) => Err(error),
        None => Ok(TcpStream::Simulated(stream)),
    }
}

/// Connects; blocks for a few seconds per address of the host.
///
/// # Errors
///
/// The host is unknown, or does not answer.
pub fn reach(address: &Address) -> io::Result<net::TcpStream> {
    let mut failed = io::Error::other("the host has no address");
    let mut connect = |address: SocketAddr| {
        let reached = net::TcpStream::connect_timeout(&address, PATIENCE.to_duration());
        let reached = reached.and_then(|stream| {
            not_itself(stream.local_addr()?, stream.peer_addr()?).map(|()| stream)
        });
        reached.map_err(|error| failed = error).ok()
    };
    let reached = address
        .to_string()
        .to_socket_addrs()?
        .find_map(&mut connect);
    reached.ok_or(failed)
}

/// Tries the addresses of a host one after another; `None` if `stop` came first.
fn reach_any(
    addresses: &[SocketAddr],
    set: &mut PollSet,
    clock: &dyn Clock,
    stop: &Stop,
) -> Result<Option<TcpStream>, Error> {
    let mut failed = None;
    for address in addresses {
        match reach_one(*address, set, clock, stop) {
            Ok(reached) => return Ok(reached),
            Err(error) => failed = Some((address, error)),
        }
    }
    let (address, error) = failed.expect("a host has an address");
    Err(Error(match error.kind() {
        ErrorKind::TimedOut => format!(
            "no answer from {address} within {PATIENCE}; check \"address\", the cable, and the firewalls \
             on the way"
        ),
        _ if is_out_of_files(&error) => {
            format!("cannot connect to {address} ({error}): {OUT_OF_FILES}")
        }
        _ => format!(
            "cannot connect to {address} ({error}); start the program that listens there, or correct \
             \"address\""
        ),
    }))
}

fn reach_one(
    address: SocketAddr,
    set: &mut PollSet,
    clock: &dyn Clock,
    stop: &Stop,
) -> io::Result<Option<TcpStream>> {
    let stream = match clock.simulation() {
        Some(simulation) => TcpStream::Simulated(simulation.connect(address)?),
        None => begin(address)?.into(),
    };
    set.add(0, &stream, Interest::Write)?;
    let connected = wait(&stream, set, clock, stop);
    set.remove(0, &stream);
    Ok(connected?.then_some(stream))
}

/// Waits until the only socket of `set` is connected; false if `stop` came first.
fn wait(stream: &TcpStream, set: &mut PollSet, clock: &dyn Clock, stop: &Stop) -> io::Result<bool> {
    let limit = clock.now() + PATIENCE;
    while !stop.is_stopped() {
        set.wait(clock, limit)?;
        if !set.ready().is_empty() {
            if let Some(error) = stream.take_error()? {
                return Err(error);
            }
            not_itself(stream.local_addr()?, stream.peer_addr()?)?;
            return Ok(true);
        }
        if clock.now() >= limit {
            return Err(ErrorKind::TimedOut.into());
        }
    }
    Ok(false)
}

/// Refuses a socket that connected to itself, which happens if the system chooses the destination port for this end.
pub(crate) fn not_itself(own: SocketAddr, peer: SocketAddr) -> io::Result<()> {
    if own == peer {
        return Err(ErrorKind::ConnectionRefused.into());
    }
    Ok(())
}

/// Starts to connect; does not wait.
pub(crate) fn begin(address: SocketAddr) -> io::Result<net::TcpStream> {
    let socket = Socket::new(
        Domain::for_address(address),
        Type::STREAM,
        Some(Protocol::TCP),
    )?;
    socket.set_nonblocking(true)?;
    match socket.connect(&address.into()) {
        Err(error) if !is_under_way(&error) => Err(error),
        _ => Ok(socket.into()),
    }
}

fn is_under_way(error: &io::Error) -> bool {
    error.kind() == ErrorKind::WouldBlock || Errno::from_io_error(error) == Some(Errno::INPROGRESS)
}
