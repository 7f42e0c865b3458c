//! Sockets of the operating system, or of a [simulation](crate::time::Simulation).

use std::io::{self, Read, Write};
use std::net::{self, Ipv4Addr, Shutdown, SocketAddr};
#[cfg(unix)]
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, Ordering};

#[cfg(unix)]
mod local;

use crate::time::{Interest, Nanos, SimulatedListener, SimulatedStream, Simulation};
#[cfg(unix)]
pub use local::LocalListener;

/// A TCP connection, or one that works like it.
#[derive(Debug)]
pub enum TcpStream {
    /// Of the operating system.
    Os(net::TcpStream),
    /// Over a Unix socket, within this computer.
    #[cfg(unix)]
    Local(UnixStream),
    /// Of a simulation.
    Simulated(Box<dyn SimulatedStream>),
}

/// A connection whose calls block, for some time at most.
#[derive(Debug)]
pub struct BlockingStream {
    stream: TcpStream,
    /// The time limits of reads and writes, for a simulated stream.
    limits: (Nanos, Nanos),
    blocks: AtomicBool,
}

/// A listening TCP socket, or one that works like it.
#[derive(Debug)]
pub enum TcpListener {
    /// Of the operating system.
    Os(net::TcpListener),
    /// A Unix socket, for programs of this computer.
    #[cfg(unix)]
    Local(LocalListener),
    /// Of a simulation.
    Simulated(Box<dyn SimulatedListener>),
}

/// Clients that have connected and are not accepted yet. With the 128 of std, others of a thousand that come at once, such
/// as after a power cut, try again a second later.
#[cfg(unix)]
const BACKLOG: i32 = 4096;

/// The address of both ends of a connection over a Unix socket, which have none.
const NO_ADDRESS: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::UNSPECIFIED), 0);

/// Two ends of a connection within this computer, as a system without pairs of local sockets has them.
///
/// # Errors
///
/// The system has no sockets left.
pub fn local_pair() -> io::Result<(net::TcpStream, net::TcpStream)> {
    let listener = net::TcpListener::bind((net::Ipv4Addr::LOCALHOST, 0))?;
    let one = net::TcpStream::connect(listener.local_addr()?)?;
    let own = one.local_addr()?;
    loop {
        let (two, from) = listener.accept()?;
        // Another program may have connected first.
        if from == own {
            one.set_nodelay(true)?;
            two.set_nodelay(true)?;
            return Ok((one, two));
        }
    }
}

impl From<net::TcpStream> for TcpStream {
    fn from(stream: net::TcpStream) -> Self {
        Self::Os(stream)
    }
}

impl TcpStream {
    /// The operating system's TCP socket; `None` in a simulation and for a Unix socket.
    pub fn os(&self) -> Option<&net::TcpStream> {
        match self {
            Self::Os(stream) => Some(stream),
            #[cfg(unix)]
            Self::Local(_) => None,
            Self::Simulated(_) => None,
        }
    }

    /// Connects with the Unix socket at `path`.
    ///
    /// # Errors
    ///
    /// Nobody listens there, or the system refuses the path.
    #[cfg(unix)]
    pub fn connect_local(path: &std::path::Path) -> io::Result<Self> {
        UnixStream::connect(path).map(Self::Local)
    }

    /// The operating system's socket, for code that supports no simulation.
    ///
    /// # Errors
    ///
    /// The socket is simulated, or a Unix socket.
    pub fn into_os(self) -> io::Result<net::TcpStream> {
        match self {
            Self::Os(stream) => Ok(stream),
            #[cfg(unix)]
            Self::Local(_) => Err(io::ErrorKind::Unsupported.into()),
            Self::Simulated(_) => Err(io::ErrorKind::Unsupported.into()),
        }
    }

    /// As [`std::net::TcpStream::local_addr`]; 0.0.0.0:0 for a Unix socket.
    ///
    /// # Errors
    ///
    /// As there.
    pub fn local_addr(&self) -> io::Result<SocketAddr> {
        match self {
            Self::Os(stream) => stream.local_addr(),
            #[cfg(unix)]
            Self::Local(_) => Ok(NO_ADDRESS),
            Self::Simulated(stream) => stream.local_addr(),
        }
    }

    /// As [`std::net::TcpStream::peer_addr`]; 0.0.0.0:0 for a Unix socket.
    ///
    /// # Errors
    ///
    /// As there.
    pub fn peer_addr(&self) -> io::Result<SocketAddr> {
        match self {
            Self::Os(stream) => stream.peer_addr(),
            #[cfg(unix)]
            Self::Local(_) => Ok(NO_ADDRESS),
            Self::Simulated(stream) => stream.peer_addr(),
        }
    }

    /// As [`std::net::TcpStream::take_error`].
    ///
    /// # Errors
    ///
    /// As there.
    pub fn take_error(&self) -> io::Result<Option<io::Error>> {
        match self {
            Self::Os(stream) => stream.take_error(),
            #[cfg(unix)]
            Self::Local(stream) => stream.take_error(),
            Self::Simulated(stream) => stream.take_error(),
        }
    }

    /// Lets reads block for up to `read`, and writes for up to `write`, or without a limit.
    ///
    /// # Errors
    ///
    /// As of [`std::net::TcpStream::set_read_timeout`].
    pub fn block(self, read: Nanos, write: Option<Nanos>) -> io::Result<BlockingStream> {
        let limits = (Some(read.to_duration()), write.map(Nanos::to_duration));
        match &self {
            Self::Os(stream) => {
                stream.set_nonblocking(false)?;
                stream.set_read_timeout(limits.0)?;
                stream.set_write_timeout(limits.1)?;
            }
            #[cfg(unix)]
            Self::Local(stream) => {
                stream.set_nonblocking(false)?;
                stream.set_read_timeout(limits.0)?;
                stream.set_write_timeout(limits.1)?;
            }
            Self::Simulated(_) => {}
        }
        Ok(BlockingStream {
            stream: self,
            limits: (read, write.unwrap_or(Nanos::MAX)),
            blocks: AtomicBool::new(true),
        })
    }

    /// Switches to non-blocking; a simulated stream never blocks.
    ///
    /// # Errors
    ///
    /// As of [`std::net::TcpStream::set_nonblocking`].
    pub fn set_nonblocking(&self) -> io::Result<()> {
        match self {
            Self::Os(stream) => stream.set_nonblocking(true),
            #[cfg(unix)]
            Self::Local(stream) => stream.set_nonblocking(true),
            Self::Simulated(_) => Ok(()),
        }
    }
}

/// A connection whose directions can be closed one by one.
pub trait HalfClose {
    /// Closes the sending direction.
    ///
    /// # Errors
    ///
    /// As of [`std::net::TcpStream::shutdown`].
    fn shutdown_write(&self) -> io::Result<()>;
}

impl HalfClose for net::TcpStream {
    fn shutdown_write(&self) -> io::Result<()> {
        self.shutdown(Shutdown::Write)
    }
}

impl HalfClose for TcpStream {
    fn shutdown_write(&self) -> io::Result<()> {
        match self {
            Self::Os(stream) => HalfClose::shutdown_write(stream),
            #[cfg(unix)]
            Self::Local(stream) => stream.shutdown(Shutdown::Write),
            Self::Simulated(stream) => stream.shutdown_write(),
        }
    }
}

impl Read for &TcpStream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            TcpStream::Os(stream) => (&*stream).read(buffer),
            #[cfg(unix)]
            TcpStream::Local(stream) => (&*stream).read(buffer),
            TcpStream::Simulated(stream) => stream.read(buffer),
        }
    }
}

impl Write for &TcpStream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            TcpStream::Os(stream) => (&*stream).write(bytes),
            #[cfg(unix)]
            TcpStream::Local(stream) => (&*stream).write(bytes),
            TcpStream::Simulated(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Read for TcpStream {
    #[inline]
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        (&*self).read(buffer)
    }
}

impl Write for TcpStream {
    #[inline]
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        (&*self).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl BlockingStream {
    /// The connection itself, for waiting.
    pub const fn stream(&self) -> &TcpStream {
        &self.stream
    }

    /// Makes all further calls non-blocking.
    ///
    /// # Errors
    ///
    /// As of [`std::net::TcpStream::set_nonblocking`].
    pub fn never_block(&self) -> io::Result<()> {
        self.blocks.store(false, Ordering::Relaxed);
        self.stream.set_nonblocking()
    }

    /// The system waits within its calls; a simulation waits before them.
    fn wait(&self, interest: Interest, limit: Nanos) {
        if let TcpStream::Simulated(stream) = &self.stream
            && self.blocks.load(Ordering::Relaxed)
        {
            stream.wait(interest, limit);
        }
    }
}

impl Read for &BlockingStream {
    #[inline]
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.wait(Interest::Read, self.limits.0);
        (&self.stream).read(buffer)
    }
}

impl Write for &BlockingStream {
    #[inline]
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.wait(Interest::Write, self.limits.1);
        (&self.stream).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl HalfClose for BlockingStream {
    fn shutdown_write(&self) -> io::Result<()> {
        self.stream.shutdown_write()
    }
}

impl TcpListener {
    /// Listens on the first of `addresses` that is free, without blocking.
    ///
    /// # Errors
    ///
    /// None of the addresses is free.
    pub fn bind(addresses: &[SocketAddr], simulation: Option<&dyn Simulation>) -> io::Result<Self> {
        if let Some(simulation) = simulation {
            return Ok(Self::Simulated(simulation.listen(addresses)?));
        }
        let listener = net::TcpListener::bind(addresses)?;
        #[cfg(unix)]
        rustix::net::listen(&listener, BACKLOG)?;
        listener.set_nonblocking(true)?;
        Ok(Self::Os(listener))
    }

    /// As [`TcpStream::into_os`].
    ///
    /// # Errors
    ///
    /// The socket is simulated, or a Unix socket.
    pub fn into_os(self) -> io::Result<net::TcpListener> {
        match self {
            Self::Os(listener) => Ok(listener),
            #[cfg(unix)]
            Self::Local(_) => Err(io::ErrorKind::Unsupported.into()),
            Self::Simulated(_) => Err(io::ErrorKind::Unsupported.into()),
        }
    }

    /// As [`std::net::TcpListener::local_addr`]; 0.0.0.0:0 for a Unix socket.
    ///
    /// # Errors
    ///
    /// As there.
    pub fn local_addr(&self) -> io::Result<SocketAddr> {
        match self {
            Self::Os(listener) => listener.local_addr(),
            #[cfg(unix)]
            Self::Local(_) => Ok(NO_ADDRESS),
            Self::Simulated(listener) => listener.local_addr(),
        }
    }

    /// As [`std::net::TcpListener::accept`]; the address of a client over a Unix socket is 0.0.0.0:0.
    ///
    /// # Errors
    ///
    /// As there.
    pub fn accept(&self) -> io::Result<(TcpStream, SocketAddr)> {
        Ok(match self {
            Self::Os(listener) => {
                let (stream, peer) = listener.accept()?;
                (TcpStream::Os(stream), peer)
            }
            #[cfg(unix)]
            Self::Local(listener) => (TcpStream::Local(listener.accept()?), NO_ADDRESS),
            Self::Simulated(listener) => {
                let (stream, peer) = listener.accept()?;
                (TcpStream::Simulated(stream), peer)
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn clients_that_come_at_once_are_all_connected_before_any_is_accepted() {
        let listener =
            TcpListener::bind(&["127.0.0.1:0".parse().expect("an address")], None).expect("a port");
        let address = listener.local_addr().expect("its address");
        // The kernel drops the first attempt of one too many, and the client repeats it after a second.
        let limit = std::time::Duration::from_millis(900);
        let clients: Vec<_> = (0..300)
            .map(|number| {
                net::TcpStream::connect_timeout(&address, limit)
                    .unwrap_or_else(|error| panic!("client {number}: {error}"))
            })
            .collect();
        assert_eq!(clients.len(), 300);
    }
}
