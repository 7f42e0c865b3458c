//! The connections of a client with the other clients of its run.

use std::io::{self, ErrorKind, Write as _};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU32, Ordering};

#[cfg(unix)]
use tickbus_base::net::LocalListener;
use tickbus_base::net::{BlockingStream, TcpListener, TcpStream};
use tickbus_base::os::{Interest, PollSet};
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_net::{Address, Host, LocalAddress, bind, prepare, reach};

use super::inbox::{Arrived, Inbox};
use super::is_later;
use super::line::{LOOK, PATIENCE};
use crate::{MemberList, wire};

/// How long the other clients may take to connect.
const MEETING: Nanos = Nanos::from_secs(5);

/// The bytes that are read at once.
const BUFFER: usize = 1 << 15;

/// The socket where other clients connect.
#[derive(Debug)]
pub(super) struct Door {
    listener: TcpListener,
    /// As the other clients write it.
    pub(super) address: String,
}

impl Door {
    /// Listens in the way in which `server` was reached.
    pub(super) fn open(server: &TcpStream) -> io::Result<Self> {
        match server {
            TcpStream::Os(stream) => {
                let host = Host::Ip(stream.local_addr()?.ip());
                let (listener, address) = bind(&Address { host, port: 0 }, None)?;
                Ok(Self {
                    listener,
                    address: address.to_string(),
                })
            }
            #[cfg(unix)]
            TcpStream::Local(_) => {
                // The clients of a run can be threads of one process.
                static NEXT: AtomicU32 = AtomicU32::new(0);
                let next = NEXT.fetch_add(1, Ordering::Relaxed);
                let name = format!("unix:sync-{}-{next}", std::process::id());
                let address: LocalAddress = name.parse().map_err(io::Error::other)?;
                Ok(Self {
                    listener: TcpListener::Local(LocalListener::bind(address.path())?),
                    address: address.to_string(),
                })
            }
            TcpStream::Simulated(_) => Err(ErrorKind::Unsupported.into()),
        }
    }
}

/// The connections with the other clients, by their places in the list.
#[derive(Debug)]
pub(super) struct Peers(Vec<Option<Peer>>);

#[derive(Debug)]
struct Peer {
    stream: BlockingStream,
    inbox: Inbox,
}

impl Peers {
    /// Connects with the clients in front of this one in the list, and lets the others connect. The error says which
    /// client cannot be reached, as the continuation of "the client …".
    pub(super) fn meet(door: &Door, list: &MemberList, clock: &dyn Clock) -> Result<Self, String> {
        let cannot = |error: io::Error| format!("cannot wait for other clients: {error}");
        let mut peers: Vec<Option<Peer>> = list.members.iter().map(|_| None).collect();
        let mut greeting = Vec::new();
        wire::hello(&mut greeting, list.token, list.own);
        for (at, (address, declaration)) in list.members[..list.own].iter().enumerate() {
            let peer = dial(address).and_then(Peer::new).and_then(|peer| {
                (&peer.stream).write_all(&greeting)?;
                Ok(peer)
            });
            peers[at] = Some(peer.map_err(|error| {
                let name = &declaration.name;
                format!("cannot reach \"{name}\" at {address}: {error}")
            })?);
        }
        let until = clock.now() + MEETING;
        let mut set = PollSet::new(&Stop::new());
        set.add(0, &door.listener, Interest::Read).map_err(cannot)?;
        let mut missing = list.members.len() - list.own - 1;
        while missing > 0 {
            match door.listener.accept() {
                Ok((stream, _)) => {
                    let mut peer = Peer::new(stream).map_err(cannot)?;
                    // Anybody can connect; whoever does not greet like a client of this run is sent away.
                    if let Some(at) = peer.greeting(list, clock, until)
                        && at > list.own
                        && peers[at].is_none()
                    {
                        peers[at] = Some(peer);
                        missing -= 1;
                    }
                }
                Err(error) if is_later(&error) => set.wait(clock, until).map_err(cannot)?,
                Err(error) => return Err(cannot(error)),
            }
            if missing > 0 && clock.now() >= until {
                let others = peers.iter().enumerate().skip(list.own + 1);
                let at = others.into_iter().find(|(_, peer)| peer.is_none());
                let name = at.map_or("", |(at, _)| &list.members[at].1.name);
                return Err(format!("has heard nothing of \"{name}\" for {MEETING}"));
            }
        }
        Ok(Self(peers))
    }

    /// The places of the other clients.
    pub(super) fn places(&self) -> impl Iterator<Item = usize> + use<> {
        let others = self.0.iter().enumerate();
        let places: Vec<usize> = others
            .filter_map(|(at, peer)| peer.as_ref().map(|_| at))
            .collect();
        places.into_iter()
    }

    /// The socket of the client at this place, for waiting.
    pub(super) fn stream(&self, at: usize) -> &TcpStream {
        self.peer(at).stream.stream()
    }

    /// Takes the next complete frame of the client at this place, without its header.
    pub(super) fn frame(&mut self, at: usize) -> Result<Option<&[u8]>, String> {
        let peer = self.0[at].as_mut().expect("it was reached");
        peer.inbox.frame()
    }

    /// Reads once, and blocks for a moment if nothing has come.
    pub(super) fn read(&mut self, at: usize) -> Arrived {
        self.0[at].as_mut().expect("it was reached").read()
    }

    /// Sends a part of `bytes` to the client at this place, and blocks for a moment; returns the number of bytes.
    pub(super) fn send(&self, at: usize, bytes: &[u8]) -> io::Result<usize> {
        match (&self.peer(at).stream).write(bytes) {
            Err(error) if is_later(&error) => Ok(0),
            sent => sent,
        }
    }

    fn peer(&self, at: usize) -> &Peer {
        self.0[at].as_ref().expect("it was reached")
    }
}

impl Peer {
    fn new(stream: TcpStream) -> io::Result<Self> {
        prepare(stream.os(), PATIENCE)?;
        Ok(Self {
            stream: stream.block(LOOK, Some(LOOK))?,
            inbox: Inbox::new(BUFFER),
        })
    }

    /// Waits for the greeting of a client that has connected; its place in the list.
    fn greeting(&mut self, list: &MemberList, clock: &dyn Clock, until: Nanos) -> Option<usize> {
        loop {
            if let Some(frame) = self.inbox.frame().ok()? {
                let (token, at) = wire::read_hello(frame).ok()?;
                return (token == list.token && at < list.members.len()).then_some(at);
            }
            let read = self.read();
            // Whoever sends on and on must not keep this client here.
            if matches!(read, Arrived::Gone(_)) || clock.now() >= until {
                return None;
            }
        }
    }

    fn read(&mut self) -> Arrived {
        self.inbox.read(&self.stream)
    }
}

/// Connects with the client that listens at `address`.
fn dial(address: &str) -> io::Result<TcpStream> {
    if address.starts_with(LocalAddress::PREFIX) {
        #[cfg(unix)]
        {
            let address: LocalAddress = address.parse().map_err(io::Error::other)?;
            return TcpStream::connect_local(address.path());
        }
        #[cfg(not(unix))]
        return Err(super::no_unix_sockets());
    }
    // Only numbers: a name would be looked up, which can take long.
    let address: SocketAddr = address.parse().map_err(io::Error::other)?;
    let (host, port) = (Host::Ip(address.ip()), address.port());
    reach(&Address { host, port }).map(TcpStream::from)
}
