//! Why an address cannot be reached, told apart, and connecting to many addresses at a bounded rate.

use std::collections::{HashMap, VecDeque};
use std::io::{self, ErrorKind};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};

use tickbus_base::net::TcpStream;
use tickbus_base::os::{Interest, PollSet, is_out_of_files, raise_open_files};
use tickbus_base::time::{Clock, Nanos, Stop};

use crate::connect::{begin, not_itself};
use crate::resolve::resolve;
use crate::{Address, Error};

/// Why there is no connection with an address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unreachable {
    /// This computer has no route to the address, or a router refuses to forward.
    NoRoute(String),
    /// The computer is there, and nothing listens on the port.
    Refused,
    /// Nothing answers: the address is not in use, or a firewall drops the packets.
    Silent,
    /// This computer cannot connect for another reason.
    Failed(String),
}

impl Unreachable {
    fn of(error: &io::Error) -> Self {
        match error.kind() {
            ErrorKind::ConnectionRefused => Self::Refused,
            ErrorKind::TimedOut | ErrorKind::WouldBlock => Self::Silent,
            ErrorKind::NetworkUnreachable
            | ErrorKind::HostUnreachable
            | ErrorKind::NetworkDown
            | ErrorKind::AddrNotAvailable => Self::NoRoute(error.to_string()),
            _ => Self::Failed(error.to_string()),
        }
    }
}

/// Looks up the addresses of a host; never empty, unless `stop` came first.
///
/// # Errors
///
/// The name is unknown, or cannot be looked up.
pub fn look_up(
    address: &Address,
    clock: &dyn Clock,
    stop: &Stop,
) -> Result<Vec<SocketAddr>, Error> {
    resolve(address, clock, stop).map(Option::unwrap_or_default)
}

/// Returns the address of this computer from which packets to `address` are sent. Sends nothing.
///
/// # Errors
///
/// This computer has no route there.
pub fn route(address: SocketAddr) -> Result<IpAddr, Unreachable> {
    let own: IpAddr = match address {
        SocketAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
        SocketAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
    };
    let socket = UdpSocket::bind((own, 0)).and_then(|socket| {
        socket.connect(address)?;
        socket.local_addr()
    });
    let own = socket.map_err(|error| Unreachable::of(&error))?;
    Ok(own.ip())
}

/// Connects to one address, within `patience`; blocks.
///
/// # Errors
///
/// Why there is no connection.
pub fn try_connect(
    address: SocketAddr,
    patience: Nanos,
) -> Result<std::net::TcpStream, Unreachable> {
    let stream = std::net::TcpStream::connect_timeout(&address, patience.to_duration());
    let stream = stream.and_then(|stream| {
        not_itself(stream.local_addr()?, stream.peer_addr()?)?;
        Ok(stream)
    });
    stream.map_err(|error| Unreachable::of(&error))
}

/// The most connections of a sweep that are under way at the same time, unless the process may have fewer than four times
/// as many files open. With 0.9 s for each, 500 a second are possible where nobody answers.
const UNDER_WAY: usize = 450;

/// The limits of a [`sweep`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Attempts per second; at least 1.
    pub rate: u32,
    /// The time in which an address must answer. Below one second each attempt is a single packet, as systems repeat
    /// it after one second (RFC 6298, 2.1).
    pub patience: Nanos,
}

/// The result of a [`sweep`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Swept {
    /// The attempts.
    pub attempts: usize,
    /// Those that were refused.
    pub refused: usize,
    /// Those without an answer.
    pub silent: usize,
    /// Those to which this computer has no route, or that it could not make.
    pub failed: usize,
}

impl Swept {
    /// Adds the counts of another sweep.
    pub fn add(&mut self, other: Self) {
        self.attempts += other.attempts;
        self.refused += other.refused;
        self.silent += other.silent;
        self.failed += other.failed;
    }
}

/// How often a sweep looks for room while there is none.
const AGAIN: Nanos = Nanos::from_millis(10);

/// Connects to each of `addresses` once, and hands each connection to `found`. Ends early at `stop`. Begins no further
/// attempt while `has_room` returns false, so that connections do not pile up behind `found`.
///
/// # Errors
///
/// The system cannot wait for sockets, or has no more files.
pub fn sweep(
    addresses: impl Iterator<Item = SocketAddr>,
    limits: Limits,
    clock: &dyn Clock,
    stop: &Stop,
    has_room: impl Fn() -> bool,
    mut found: impl FnMut(SocketAddr, std::net::TcpStream),
) -> io::Result<Swept> {
    let interval = Nanos(Nanos::from_secs(1).0 / i64::from(limits.rate.max(1)));
    let mut addresses = addresses.peekable();
    let most = UNDER_WAY.min(raise_open_files() / 4).max(1);
    let mut set = PollSet::new(stop);
    let mut swept = Swept::default();
    let mut under_way: HashMap<usize, (SocketAddr, TcpStream)> = HashMap::new();
    // In the order of their begin, and so of their ends.
    let mut ends: VecDeque<(Nanos, usize)> = VecDeque::new();
    let mut due = clock.now();
    while !stop.is_stopped() && (addresses.peek().is_some() || !under_way.is_empty()) {
        let now = clock.now();
        while due <= now
            && under_way.len() < most
            && has_room()
            && let Some(address) = addresses.next()
        {
            // A pause of this process must not become a burst.
            due = (due + interval).max(now - interval.times(20));
            let key = swept.attempts;
            swept.attempts += 1;
            match begin(address) {
                Ok(stream) => {
                    let stream = TcpStream::from(stream);
                    set.add(key, &stream, Interest::Write)?;
                    under_way.insert(key, (address, stream));
                    ends.push_back((now + limits.patience, key));
                }
                Err(error) if is_out_of_files(&error) => return Err(error),
                Err(error) => swept.judge(&error),
            }
        }
        while let Some((end, key)) = ends.front().copied()
            && (end <= now || !under_way.contains_key(&key))
        {
            ends.pop_front();
            if let Some((_, stream)) = under_way.remove(&key) {
                set.remove(key, &stream);
                swept.silent += 1;
            }
        }
        let mut deadline = ends.front().map_or(Nanos::MAX, |(end, _)| *end);
        if addresses.peek().is_some() && under_way.len() < most {
            let next = if has_room() { due } else { now + AGAIN };
            deadline = deadline.min(next);
        }
        if deadline == Nanos::MAX {
            continue;
        }
        set.wait(clock, deadline)?;
        let ready: Vec<usize> = set.ready().iter().map(|ready| ready.key).collect();
        for key in ready {
            let Some((address, stream)) = under_way.remove(&key) else {
                continue;
            };
            set.remove(key, &stream);
            let error = stream.take_error()?;
            let checked = error.map_or(Ok(()), Err);
            let checked =
                checked.and_then(|()| not_itself(stream.local_addr()?, stream.peer_addr()?));
            match checked.and_then(|()| stream.into_os()) {
                Ok(stream) => found(address, stream),
                Err(error) => swept.judge(&error),
            }
        }
    }
    Ok(swept)
}

impl Swept {
    fn judge(&mut self, error: &io::Error) {
        match Unreachable::of(error) {
            Unreachable::Refused => self.refused += 1,
            Unreachable::Silent => self.silent += 1,
            Unreachable::NoRoute(_) | Unreachable::Failed(_) => self.failed += 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;
    use tickbus_base::time::Monotonic;

    const LIMITS: Limits = Limits {
        rate: 1000,
        patience: Nanos::from_millis(300),
    };

    /// A listener that answers no packet: its queue of connections is full.
    fn silent() -> (TcpListener, Vec<std::net::TcpStream>) {
        use socket2::{Domain, Socket, Type};
        let socket = Socket::new(Domain::IPV4, Type::STREAM, None).expect("a socket");
        let any = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        socket.bind(&any.into()).expect("a port");
        socket.listen(0).expect("a listener");
        let listener = TcpListener::from(socket);
        let address = listener.local_addr().expect("an address");
        let mut held = Vec::new();
        for _ in 0..8 {
            match try_connect(address, Nanos::from_millis(200)) {
                Ok(stream) => held.push(stream),
                Err(_) => return (listener, held),
            }
        }
        panic!("the queue never fills");
    }

    #[test]
    fn a_refusal_a_silence_and_a_connection_are_told_apart() {
        let open = TcpListener::bind("127.0.0.1:0").expect("a port");
        let open = open.local_addr().expect("an address");
        let gone = TcpListener::bind("127.0.0.1:0").expect("a port");
        let closed = gone.local_addr().expect("an address");
        drop(gone);
        assert_eq!(
            try_connect(closed, LIMITS.patience).err(),
            Some(Unreachable::Refused)
        );
        assert_eq!(route(open), Ok(Ipv4Addr::LOCALHOST.into()));
        #[cfg(target_os = "linux")]
        {
            let (listener, _held) = silent();
            let address = listener.local_addr().expect("an address");
            assert_eq!(
                try_connect(address, LIMITS.patience).err(),
                Some(Unreachable::Silent)
            );
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_sweep_meets_each_address_once_and_counts_what_it_met() {
        let open = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = open.local_addr().expect("an address");
        let (dead, _held) = silent();
        let dead = dead.local_addr().expect("an address");
        let port = address.port();
        let others = (2..200_u8).map(|last| SocketAddr::from(([127, 0, 77, last], port)));
        let mut found = Vec::new();
        let swept = sweep(
            [dead, address].into_iter().chain(others),
            LIMITS,
            &*Monotonic::shared(),
            &Stop::new(),
            || true,
            |address, _| found.push(address),
        );
        let swept = swept.expect("the system can");
        assert_eq!(found, [address]);
        let expected = Swept {
            attempts: 200,
            refused: 198,
            silent: 1,
            failed: 0,
        };
        assert_eq!(swept, expected);
    }
}
