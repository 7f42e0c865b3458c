//! The common parts of all ways to wait for sockets.

use std::io::{self, ErrorKind};
use std::time::Duration;

use rustix::event::{PollFd, Timespec, poll};
use rustix::fd::{AsFd, BorrowedFd};

/// A time-out within the range that the system accepts.
pub(super) fn timespec(patience: Duration) -> Timespec {
    // Within every system's range, and rare enough to cost nothing.
    const LONGEST: Duration = Duration::from_secs(3600);
    Timespec::try_from(patience.min(LONGEST)).expect("an hour fits into every system's time")
}

pub(super) fn poll_once(fds: &mut [PollFd<'_>], patience: Option<Duration>) -> io::Result<()> {
    let patience = patience.map(timespec);
    match poll(fds, patience.as_ref()) {
        Ok(_) => Ok(()),
        // A signal interrupted the wait: nothing is ready, and the caller checks again.
        Err(error) if io::Error::from(error).kind() == ErrorKind::Interrupted => {
            fds.iter_mut().for_each(PollFd::clear_revents);
            Ok(())
        }
        Err(error) => Err(error.into()),
    }
}

/// The socket pair by which other threads wake a thread that polls.
pub(super) mod wake {
    use super::{AsFd, BorrowedFd, io};

    #[cfg(unix)]
    type Socket = std::os::unix::net::UnixDatagram;
    #[cfg(not(unix))]
    type Socket = std::net::UdpSocket;

    #[derive(Debug)]
    pub(crate) struct Sender(Socket);

    #[derive(Debug)]
    pub(crate) struct Receiver(Socket);

    #[cfg(unix)]
    fn sockets() -> io::Result<(Socket, Socket)> {
        Socket::pair()
    }

    #[cfg(not(unix))]
    fn sockets() -> io::Result<(Socket, Socket)> {
        let receiver = Socket::bind(("127.0.0.1", 0))?;
        let sender = Socket::bind(("127.0.0.1", 0))?;
        sender.connect(receiver.local_addr()?)?;
        receiver.connect(sender.local_addr()?)?;
        Ok((sender, receiver))
    }

    pub(crate) fn pair() -> io::Result<(Sender, Receiver)> {
        let (sender, receiver) = sockets()?;
        sender.set_nonblocking(true)?;
        receiver.set_nonblocking(true)?;
        Ok((Sender(sender), Receiver(receiver)))
    }

    impl Sender {
        pub(crate) fn send(&self) -> io::Result<usize> {
            self.0.send(&[1])
        }
    }

    impl Receiver {
        pub(crate) fn drain(&self) {
            let mut one = [0];
            while self.0.recv(&mut one).is_ok() {}
        }
    }

    impl AsFd for Receiver {
        fn as_fd(&self) -> BorrowedFd<'_> {
            self.0.as_fd()
        }
    }
}
