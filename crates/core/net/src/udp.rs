//! Datagrams over UDP.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

use tickbus_base::os::{Pollable, Source};
use tickbus_base::time::{Clock, Stop};

use crate::listen::cannot_listen;
use crate::resolve::resolve;
use crate::{Address, Error, Stream};

/// Receives datagrams at `address`, without blocking. Returns the socket and its bound address, or `None` if `stop` came
/// first.
///
/// # Errors
///
/// The host is unknown, the address cannot be listened on, or the clock's simulation has no UDP.
pub fn bind_udp(
    address: &Address,
    clock: &dyn Clock,
    stop: &Stop,
) -> Result<Option<(UdpSocket, SocketAddr)>, Error> {
    not_simulated(clock)?;
    let Some(addresses) = resolve(address, clock, stop)? else {
        return Ok(None);
    };
    let bind = || {
        let socket = UdpSocket::bind(&addresses[..])?;
        socket.set_nonblocking(true)?;
        let bound = socket.local_addr()?;
        Ok((socket, bound))
    };
    bind()
        .map(Some)
        .map_err(|error| cannot_listen(address, &error))
}

fn not_simulated(clock: &dyn Clock) -> Result<(), Error> {
    match clock.simulation() {
        None => Ok(()),
        Some(_) => Err(Error(
            "a simulated network has no UDP; use TCP there".to_owned(),
        )),
    }
}

/// A stream of datagrams to one peer and from it: each read returns one datagram, and each write sends one.
#[derive(Debug)]
pub struct Datagrams(UdpSocket);

impl Datagrams {
    /// Opens a socket for the first address of a host, and returns it with that address; `None` if `stop` came first. No
    /// datagram is sent, so the peer need not exist.
    ///
    /// # Errors
    ///
    /// The host is unknown, no way leads there, or the clock's simulation has no UDP.
    pub fn connect(
        address: &Address,
        clock: &dyn Clock,
        stop: &Stop,
    ) -> Result<Option<(Self, SocketAddr)>, Error> {
        not_simulated(clock)?;
        let Some(addresses) = resolve(address, clock, stop)? else {
            return Ok(None);
        };
        let peer = *addresses.first().expect("a host has an address");
        let own: SocketAddr = match peer {
            SocketAddr::V4(_) => (Ipv4Addr::UNSPECIFIED, 0).into(),
            SocketAddr::V6(_) => (Ipv6Addr::UNSPECIFIED, 0).into(),
        };
        let open = || {
            let socket = UdpSocket::bind(own)?;
            socket.set_nonblocking(true)?;
            socket.connect(peer)?;
            Ok(Self(socket))
        };
        let opened = open().map_err(|error: io::Error| {
            Error(format!(
                "no datagram can be sent to {peer} ({error}); check \"address\", and the networks of this computer"
            ))
        })?;
        Ok(Some((opened, peer)))
    }
}

impl Pollable for Datagrams {
    fn source(&self) -> Source<'_> {
        self.0.source()
    }
}

impl Read for Datagrams {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self.0.recv(bytes) {
            // An empty datagram is not the end of a stream.
            Ok(0) => Err(ErrorKind::Interrupted.into()),
            other => other,
        }
    }
}

impl Write for Datagrams {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.send(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Stream for Datagrams {}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_base::time::Monotonic;

    #[test]
    fn each_read_is_one_datagram() {
        let (clock, stop) = (Monotonic::shared(), Stop::new());
        let any = Address::local(0);
        let (server, bound) = bind_udp(&any, &*clock, &stop)
            .expect("it is free")
            .expect("no stop");
        let to = bound.to_string().parse().expect("an address");
        let (mut client, peer) = Datagrams::connect(&to, &*clock, &stop)
            .expect("this computer")
            .expect("no stop");
        assert_eq!(peer, bound);
        let mut bytes = [0; 16];
        let nothing = client.read(&mut bytes).expect_err("nothing came");
        assert!(crate::is_for_later(&nothing));
        client.write_all(b"one").expect("it is sent");
        server.set_nonblocking(false).expect("a socket");
        let (count, from) = server.recv_from(&mut bytes).expect("it comes");
        assert_eq!(&bytes[..count], b"one");
        client.0.set_nonblocking(false).expect("a socket");
        for text in ["", "two", "three"] {
            server.send_to(text.as_bytes(), from).expect("it is sent");
        }
        let empty = client.read(&mut bytes).expect_err("it is no end");
        assert!(crate::is_for_later(&empty));
        for text in ["two", "three"] {
            assert_eq!(client.read(&mut bytes).expect("a datagram"), text.len());
            assert_eq!(&bytes[..text.len()], text.as_bytes());
        }
    }
}
