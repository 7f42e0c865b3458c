//! The objects that a [`PollSet`](super::PollSet) can wait for.

use rustix::fd::{AsFd as _, BorrowedFd};

use crate::net::{TcpListener, TcpStream};

/// A socket as a [`PollSet`](super::PollSet) sees it.
#[derive(Debug)]
pub enum Source<'a> {
    /// Of the operating system.
    Os(BorrowedFd<'a>),
    /// Of a simulation, by its identity.
    Simulated(u64),
}

/// An object that a [`PollSet`](super::PollSet) can wait for.
pub trait Pollable {
    /// The socket of the object.
    fn source(&self) -> Source<'_>;
}

impl Pollable for TcpStream {
    fn source(&self) -> Source<'_> {
        match self {
            Self::Os(stream) => Source::Os(stream.as_fd()),
            #[cfg(unix)]
            Self::Local(stream) => Source::Os(stream.as_fd()),
            Self::Simulated(stream) => Source::Simulated(stream.identity()),
        }
    }
}

impl Pollable for TcpListener {
    fn source(&self) -> Source<'_> {
        match self {
            Self::Os(listener) => Source::Os(listener.as_fd()),
            #[cfg(unix)]
            Self::Local(listener) => Source::Os(listener.socket().as_fd()),
            Self::Simulated(listener) => Source::Simulated(listener.identity()),
        }
    }
}

impl Pollable for super::SerialLine {
    fn source(&self) -> Source<'_> {
        match self {
            Self::Os(port) => Source::Os(port.as_fd()),
            Self::Simulated(stream) => Source::Simulated(stream.identity()),
        }
    }
}

impl Pollable for super::SerialEar {
    fn source(&self) -> Source<'_> {
        self.line().source()
    }
}

impl<P: Pollable + ?Sized> Pollable for Box<P> {
    fn source(&self) -> Source<'_> {
        (**self).source()
    }
}

impl<P: Pollable + ?Sized> Pollable for &P {
    fn source(&self) -> Source<'_> {
        (**self).source()
    }
}

macro_rules! of_the_system {
    ($($(#[$when:meta])? $socket:ty),+ $(,)?) => {$(
        $(#[$when])?
        impl Pollable for $socket {
            fn source(&self) -> Source<'_> {
                Source::Os(self.as_fd())
            }
        }
    )+};
}

of_the_system! {
    std::net::TcpStream,
    std::net::TcpListener,
    std::net::UdpSocket,
    #[cfg(unix)]
    std::os::unix::net::UnixStream,
    super::SerialPort,
    #[cfg(unix)]
    super::LinkedTerminal,
}
