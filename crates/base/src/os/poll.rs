//! Waiting for sockets, a deadline and a stop, all at once.

use std::io::{self, ErrorKind};
use std::sync::Arc;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::{AsFd, BorrowedFd};

use crate::time::{Clock, Nanos, Stop};

/// What to wait for on a socket.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interest {
    /// There is something to read, the peer has closed, or an error is pending.
    Read,
    /// There is room to write, or an error is pending.
    Write,
    /// Either.
    ReadWrite,
}

/// A socket to wait for.
#[derive(Clone, Debug)]
pub struct Source<'a> {
    fd: PollFd<'a>,
    ready: PollFlags,
}

impl<'a> Source<'a> {
    /// A source that waits for `interest` on `socket`.
    pub fn new(socket: &'a impl AsFd, interest: Interest) -> Self {
        Self {
            fd: PollFd::new(socket, flags(interest)),
            ready: PollFlags::empty(),
        }
    }

    /// What the system reported about a socket.
    #[cfg(not(any(target_os = "linux", target_os = "android")))]
    pub(super) fn looked_at(fd: PollFd<'a>) -> Self {
        let ready = fd.revents();
        Self { fd, ready }
    }

    /// Whether a read would not block, after [`Poller::wait`].
    pub fn is_readable(&self) -> bool {
        let ready = PollFlags::IN | PollFlags::HUP | PollFlags::ERR;
        self.ready.intersects(ready)
    }

    /// Whether a write would not block, after [`Poller::wait`].
    pub fn is_writable(&self) -> bool {
        let ready = PollFlags::OUT | PollFlags::HUP | PollFlags::ERR;
        self.ready.intersects(ready)
    }
}

/// Lets one thread wait for sockets, for a deadline, and for its [`Stop`], whichever is first.
///
/// While it exists it is the waker of its token.
#[derive(Debug)]
pub struct Poller {
    stop: Stop,
    wake: wake::Receiver,
}

impl Poller {
    /// A poller that `stop` wakes.
    ///
    /// # Errors
    ///
    /// The system refused the socket pair by which other threads wake this one.
    pub fn new(stop: &Stop) -> io::Result<Self> {
        let (sender, receiver) = wake::pair()?;
        // If the buffer is full, a wake-up is already pending; nothing else can fail within one pair.
        stop.set_waker(Some(Arc::new(move || drop(sender.send()))));
        Ok(Self {
            stop: stop.clone(),
            wake: receiver,
        })
    }

    /// Waits until one of `sources` is ready, `deadline` has come on `clock`, or the token is stopped or
    /// woken. It may return early.
    ///
    /// # Errors
    ///
    /// The system cannot wait for these sockets.
    pub fn wait(
        &mut self,
        clock: &dyn Clock,
        deadline: Nanos,
        sources: &mut [Source<'_>],
    ) -> io::Result<()> {
        const MOST: usize = 8;
        assert!(sources.len() < MOST, "a bus waits for a few sockets");
        let wake = PollFd::from_borrowed_fd(self.wake.as_fd(), PollFlags::IN);
        let mut all: [PollFd<'_>; MOST] = std::array::from_fn(|_| wake.clone());
        for (slot, source) in all.iter_mut().zip(&*sources) {
            *slot = source.fd.clone();
        }
        let all = &mut all[..=sources.len()];
        let mut waited = Ok(());
        clock.wait_with(deadline, &self.stop, &mut |patience| {
            // The token may have been woken before the waker was set; no wake-up would follow.
            let patience = if self.stop.is_woken() {
                Some(Duration::ZERO)
            } else {
                patience
            };
            waited = poll_once(all, patience);
        });
        waited?;
        let woken = !all[sources.len()].revents().is_empty();
        for (source, slot) in sources.iter_mut().zip(&*all) {
            source.ready = slot.revents();
        }
        if woken {
            self.wake.drain();
        }
        Ok(())
    }
}

impl Drop for Poller {
    fn drop(&mut self) {
        self.stop.set_waker(None);
    }
}

pub(super) const fn flags(interest: Interest) -> PollFlags {
    match interest {
        Interest::Read => PollFlags::IN,
        Interest::Write => PollFlags::OUT,
        Interest::ReadWrite => PollFlags::IN.union(PollFlags::OUT),
    }
}

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
        // A signal interrupted the wait: nothing is ready, and the caller looks again.
        Err(error) if io::Error::from(error).kind() == ErrorKind::Interrupted => {
            fds.iter_mut().for_each(PollFd::clear_revents);
            Ok(())
        }
        Err(error) => Err(error.into()),
    }
}

/// Owned handles of borrowed sockets.
#[cfg(not(any(target_os = "linux", target_os = "android")))]
pub(super) mod own {
    use super::{BorrowedFd, io};

    #[cfg(unix)]
    pub(crate) type Owned = std::os::fd::OwnedFd;
    #[cfg(not(unix))]
    pub(crate) type Owned = std::os::windows::io::OwnedSocket;

    pub(crate) fn duplicate(socket: BorrowedFd<'_>) -> io::Result<Owned> {
        socket.try_clone_to_owned()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::{Manual, Monotonic};
    use std::io::Write as _;
    use std::net::{TcpListener, TcpStream};
    use std::thread;

    fn connected() -> (TcpStream, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        let client = TcpStream::connect(address).expect("it listens");
        (client, listener.accept().expect("it connected").0)
    }

    #[test]
    fn bytes_end_a_wait_on_a_clock_that_stands_still() {
        let (mut client, server) = connected();
        let (clock, stop) = (Manual::new(), Stop::new());
        let mut poller = Poller::new(&stop).expect("a pair of sockets");
        client.write_all(&[1]).expect("the server is there");
        let mut sources = [Source::new(&server, Interest::Read)];
        poller
            .wait(&*clock, Nanos::MAX, &mut sources)
            .expect("it waits");
        assert!(sources[0].is_readable() && !sources[0].is_writable());
    }

    #[test]
    fn the_manual_clock_ends_a_wait_at_its_deadline() {
        let (_client, server) = connected();
        let (clock, stop) = (Manual::new(), Stop::new());
        let waiting = thread::spawn({
            let clock = Arc::clone(&clock);
            move || {
                let mut poller = Poller::new(&stop).expect("a pair of sockets");
                let mut sources = [Source::new(&server, Interest::Read)];
                while clock.now() < Nanos(10) {
                    poller
                        .wait(&*clock, Nanos(10), &mut sources)
                        .expect("it waits");
                }
                sources[0].is_readable()
            }
        });
        while !clock.is_settled(1) {
            thread::yield_now();
        }
        clock.advance(Nanos(10));
        assert!(!waiting.join().expect("no panic"));
    }

    #[test]
    fn stop_and_wake_end_a_wait_even_when_they_come_first() {
        let clock = Monotonic::shared();
        let stop = Stop::new();
        stop.wake();
        let mut poller = Poller::new(&stop).expect("a pair of sockets");
        poller
            .wait(&*clock, Nanos::MAX, &mut [])
            .expect("woken before");
        let waiting = thread::spawn({
            let clock = Arc::clone(&clock);
            move || poller.wait(&*clock, Nanos::MAX, &mut [])
        });
        stop.stop();
        waiting.join().expect("no panic").expect("stopped");
    }

    #[test]
    fn a_deadline_ends_a_wait() {
        let clock = Monotonic::shared();
        let mut poller = Poller::new(&Stop::new()).expect("a pair of sockets");
        let deadline = clock.now() + Nanos::from_millis(2);
        while clock.now() < deadline {
            poller.wait(&*clock, deadline, &mut []).expect("it waits");
        }
    }
}
