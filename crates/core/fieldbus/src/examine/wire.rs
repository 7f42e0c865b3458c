//! A connection that blocks, for questions that are asked one after another.

use std::fmt;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::Arc;

use tickbus_base::time::{Clock, Nanos};
use tickbus_net::{Unreachable, try_connect};

/// A peer to which further connections can be made.
#[derive(Clone, Debug)]
pub struct Peer {
    /// The peer's address.
    pub address: SocketAddr,
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
    /// The same socket, for its time-outs.
    socket: TcpStream,
    patience: Nanos,
    clock: Arc<dyn Clock>,
}

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
            connect,
            patience,
            clock: Arc::clone(clock),
        }
    }

    /// Connects once more.
    ///
    /// # Errors
    ///
    /// Why there is no connection.
    pub fn dial(&self) -> Result<Wire, Unreachable> {
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
            socket: stream.try_clone().map_err(failed)?,
            stream: Box::new(stream),
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
            .field("socket", &self.socket)
            .finish_non_exhaustive()
    }
}

impl WireEnd {
    fn of(error: &io::Error) -> Self {
        match error.kind() {
            ErrorKind::TimedOut | ErrorKind::WouldBlock => Self::Silent,
            ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::BrokenPipe => {
                Self::Closed
            }
            ErrorKind::UnexpectedEof => Self::Closed,
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
    /// The socket, for TLS around it; [`within`](Self::within) follows.
    ///
    /// # Errors
    ///
    /// The system has no more files.
    pub fn socket(&self) -> io::Result<TcpStream> {
        self.socket
            .set_read_timeout(Some(self.patience.to_duration()))?;
        self.socket.try_clone()
    }

    /// The same connection within TLS.
    #[must_use]
    pub fn within(self, stream: Box<dyn Plain>) -> Self {
        Self { stream, ..self }
    }

    /// Ends the connection: some peers serve one at a time.
    pub fn hang_up(&self) {
        // If this fails, the connection has ended already.
        let _ = self.socket.shutdown(Shutdown::Both);
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
        let rest = deadline - self.clock.now();
        if rest <= Nanos::ZERO {
            return Err(WireEnd::Silent);
        }
        let rest = rest.max(Nanos::from_millis(1));
        let set = self.socket.set_read_timeout(Some(rest.to_duration()));
        set.map_err(|error| WireEnd::of(&error))?;
        let mut bytes = [0; 4096];
        match self.stream.read(&mut bytes) {
            Ok(0) => Err(WireEnd::Closed),
            Ok(count) => {
                inbox.extend_from_slice(&bytes[..count]);
                Ok(())
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => Ok(()),
            Err(error) => Err(WireEnd::of(&error)),
        }
    }
}
