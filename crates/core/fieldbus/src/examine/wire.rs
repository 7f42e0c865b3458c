//! A connection that blocks, for questions that are asked one after another.

use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream, UdpSocket};
use std::sync::Arc;

use tickbus_base::os::SerialPort;
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_net::{Unreachable, try_connect};

/// A peer to which further connections can be made.
#[derive(Clone, Debug)]
pub struct Peer {
    /// The peer's address.
    pub address: SocketAddr,
    /// True if the peer is reached by datagrams: then nothing shows that it is there but an answer.
    pub is_udp: bool,
    connect: Nanos,
    patience: Nanos,
    clock: Arc<dyn Clock>,
}

/// The bytes of a connection, in TLS or not.
pub trait Plain: Read + Write + Send {}

impl<T: Read + Write + Send> Plain for T {}

/// One connection.
pub struct Wire {
    stream: Box<dyn Plain>,
    end: End,
    patience: Nanos,
    clock: Arc<dyn Clock>,
}

/// The same connection, for its time-outs.
#[derive(Debug)]
enum End {
    Tcp(TcpStream),
    Udp(Arc<UdpSocket>),
    /// Reading never blocks.
    Serial,
}

/// The datagrams with one peer, as a stream: each is read or written as a whole.
struct Datagrams(Arc<UdpSocket>);

impl Read for Datagrams {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.0.recv(bytes)
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

/// How often a serial port is read while nothing comes.
const POLLED: Nanos = Nanos::from_millis(1);

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WireEnd {
    /// The peer sends nothing.
    Silent,
    /// The peer has closed the connection.
    Closed,
    /// The connection broke.
    Broken(String),
}

impl Peer {
    /// A peer that must accept a connection within `connect`, and answer within `patience`.
    pub fn new(
        address: SocketAddr,
        connect: Nanos,
        patience: Nanos,
        clock: &Arc<dyn Clock>,
    ) -> Self {
        Self {
            address,
            is_udp: false,
            connect,
            patience,
            clock: Arc::clone(clock),
        }
    }

    /// The same peer, reached by datagrams.
    #[must_use]
    pub fn by_datagrams(self) -> Self {
        Self {
            is_udp: true,
            ..self
        }
    }

    /// Connects once more.
    ///
    /// # Errors
    ///
    /// Why there is no connection.
    pub fn dial(&self) -> Result<Wire, Unreachable> {
        if self.is_udp {
            return self
                .datagrams()
                .map_err(|error| Unreachable::NoRoute(error.to_string()));
        }
        self.over(try_connect(self.address, self.connect)?)
    }

    /// An existing connection with the peer.
    ///
    /// # Errors
    ///
    /// The system refuses its settings.
    pub fn over(&self, stream: TcpStream) -> Result<Wire, Unreachable> {
        let failed = |error: io::Error| Unreachable::Failed(error.to_string());
        stream.set_nonblocking(false).map_err(failed)?;
        stream.set_nodelay(true).map_err(failed)?;
        stream
            .set_write_timeout(Some(self.patience.to_duration()))
            .map_err(failed)?;
        Ok(Wire {
            end: End::Tcp(stream.try_clone().map_err(failed)?),
            stream: Box::new(stream),
            patience: self.patience,
            clock: Arc::clone(&self.clock),
        })
    }

    /// Datagrams to this peer and from it, each as a whole.
    fn datagrams(&self) -> io::Result<Wire> {
        let any: SocketAddr = match self.address {
            SocketAddr::V4(_) => (std::net::Ipv4Addr::UNSPECIFIED, 0).into(),
            SocketAddr::V6(_) => (std::net::Ipv6Addr::UNSPECIFIED, 0).into(),
        };
        let socket = UdpSocket::bind(any)?;
        socket.connect(self.address)?;
        let socket = Arc::new(socket);
        Ok(Wire {
            stream: Box::new(Datagrams(Arc::clone(&socket))),
            end: End::Udp(socket),
            patience: self.patience,
            clock: Arc::clone(&self.clock),
        })
    }

    /// The time-out of an answer.
    pub const fn patience(&self) -> Nanos {
        self.patience
    }

    /// The current time.
    pub fn now(&self) -> Nanos {
        self.clock.now()
    }

    /// The clock that counts the time-outs.
    pub fn clock(&self) -> &dyn Clock {
        &*self.clock
    }
}

impl fmt::Debug for Wire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Wire")
            .field("end", &self.end)
            .finish_non_exhaustive()
    }
}

impl WireEnd {
    fn of(error: &io::Error) -> Self {
        match error.kind() {
            ErrorKind::TimedOut | ErrorKind::WouldBlock => Self::Silent,
            ErrorKind::ConnectionReset
            | ErrorKind::ConnectionAborted
            | ErrorKind::ConnectionRefused
            | ErrorKind::BrokenPipe
            | ErrorKind::UnexpectedEof => Self::Closed,
            _ => Self::Broken(error.to_string()),
        }
    }
}

impl fmt::Display for WireEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silent => f.write_str("does not answer"),
            Self::Closed => f.write_str("closes the connection"),
            Self::Broken(why) => write!(f, "breaks the connection ({why})"),
        }
    }
}

impl Wire {
    /// A serial line, whose answers take at most `patience`.
    pub fn serial(port: SerialPort, patience: Nanos, clock: &Arc<dyn Clock>) -> Self {
        Self {
            stream: Box::new(port),
            end: End::Serial,
            patience,
            clock: Arc::clone(clock),
        }
    }

    /// The socket, for TLS around it; [`within`](Self::within) follows.
    ///
    /// # Errors
    ///
    /// The system has no more files, or this is no TCP connection.
    pub fn socket(&self) -> io::Result<TcpStream> {
        let End::Tcp(socket) = &self.end else {
            return Err(ErrorKind::Unsupported.into());
        };
        socket.set_read_timeout(Some(self.patience.to_duration()))?;
        socket.try_clone()
    }

    /// The same connection within TLS.
    #[must_use]
    pub fn within(self, stream: Box<dyn Plain>) -> Self {
        Self { stream, ..self }
    }

    /// Ends the connection: some peers serve one at a time.
    pub fn hang_up(&self) {
        if let End::Tcp(socket) = &self.end {
            // If this fails, the connection has ended already.
            let _ = socket.shutdown(Shutdown::Both);
        }
    }

    /// Sends all of `bytes`.
    ///
    /// # Errors
    ///
    /// The connection has ended.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), WireEnd> {
        let sent = self
            .stream
            .write_all(bytes)
            .and_then(|()| self.stream.flush());
        sent.map_err(|error| WireEnd::of(&error))
    }

    /// The time in which a peer must answer.
    pub const fn patience(&self) -> Nanos {
        self.patience
    }

    /// The end of the time for an answer to a question that is asked now.
    pub fn deadline(&self) -> Nanos {
        self.clock.now() + self.patience
    }

    /// Appends received bytes to `inbox`; waits for them until `deadline`.
    ///
    /// # Errors
    ///
    /// No bytes have come, or the connection has ended.
    pub fn receive(&mut self, inbox: &mut Vec<u8>, deadline: Nanos) -> Result<(), WireEnd> {
        loop {
            let rest = deadline - self.clock.now();
            let timeout = Some(rest.max(Nanos::from_millis(1)).to_duration());
            let set = match &self.end {
                // Bytes that have arrived are read without waiting.
                End::Serial => Ok(()),
                _ if rest <= Nanos::ZERO => return Err(WireEnd::Silent),
                End::Tcp(socket) => socket.set_read_timeout(timeout),
                End::Udp(socket) => socket.set_read_timeout(timeout),
            };
            set.map_err(|error| WireEnd::of(&error))?;
            let mut bytes = [0; 4096];
            match self.stream.read(&mut bytes) {
                Ok(0) => return Err(WireEnd::Closed),
                Ok(count) => {
                    inbox.extend_from_slice(&bytes[..count]);
                    return Ok(());
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => return Ok(()),
                Err(error)
                    if error.kind() == ErrorKind::WouldBlock
                        && matches!(self.end, End::Serial)
                        && rest > Nanos::ZERO =>
                {
                    self.pause(rest.min(POLLED));
                }
                Err(error) => return Err(WireEnd::of(&error)),
            }
        }
    }

    /// Waits for this time.
    pub fn pause(&self, span: Nanos) {
        let now = self.clock.now();
        self.clock.wait_until(now + span, &Stop::new());
    }

    /// The current time.
    pub fn now(&self) -> Nanos {
        self.clock.now()
    }
}
