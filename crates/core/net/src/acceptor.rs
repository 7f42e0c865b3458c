//! Accepting clients, for all servers that wait for their sockets in a poll set.

use std::io;
use std::net::SocketAddr;

use tickbus_base::net::{TcpListener, TcpStream};
use tickbus_base::os::{Interest, PollSet};
use tickbus_base::time::Nanos;

use crate::{Error, is_for_later};

/// At most this many clients are accepted per turn of a server, before others are served.
const ACCEPTS: usize = 32;

/// The pause in accepting after the system had no free socket.
const PAUSE: Nanos = Nanos::from_secs(1);

/// A listener and its place in the poll set of a server.
///
/// A server calls [`watch`](Self::watch) in every turn. When the set reports the key of the acceptor, the server calls
/// [`accept`](Self::accept) until that returns `None`.
#[derive(Debug)]
pub struct Acceptor {
    listener: TcpListener,
    key: usize,
    /// At most this many attempts per turn, and the attempts of the current turn that are left.
    most: usize,
    left: usize,
    /// When the set waits for the listener again; `None` while it does.
    paused_until: Option<Nanos>,
}

impl Acceptor {
    /// The usual key of an acceptor, which leaves the small numbers to clients.
    pub const KEY: usize = usize::MAX - 1;

    /// An acceptor for a server whose set knows the listener as `key`. The first [`watch`](Self::watch) adds it there,
    /// whatever the time.
    pub const fn new(listener: TcpListener, key: usize) -> Self {
        Self {
            listener,
            key,
            most: ACCEPTS,
            left: ACCEPTS,
            paused_until: Some(Nanos(i64::MIN)),
        }
    }

    /// For a server with a place for one client, which decides about each client in a turn of its own.
    #[must_use]
    pub const fn one_per_turn(mut self) -> Self {
        (self.most, self.left) = (1, 1);
        self
    }

    /// The time at which [`watch`](Self::watch) has something to do.
    pub fn deadline(&self) -> Nanos {
        self.paused_until.unwrap_or(Nanos::MAX)
    }

    /// Makes `set` wait for the listener, except during a pause.
    ///
    /// # Errors
    ///
    /// The system cannot wait for it.
    pub fn watch(&mut self, now: Nanos, set: &mut PollSet) -> io::Result<()> {
        if self.paused_until.is_some_and(|until| now >= until) {
            self.paused_until = None;
            set.add(self.key, &self.listener, Interest::Read)?;
        }
        Ok(())
    }

    /// The next client; `None` at the end of this turn, because no other client waits or enough were accepted.
    ///
    /// An error ends the turn: the system has no free socket. Then accepting pauses, and the set does not wait for the
    /// listener, because the waiting clients would keep the thread awake.
    pub fn accept(
        &mut self,
        now: Nanos,
        set: &mut PollSet,
    ) -> Option<Result<(TcpStream, SocketAddr), Error>> {
        while self.left > 0 && self.paused_until.is_none() {
            self.left -= 1;
            match self.listener.accept() {
                Ok(accepted) => return Some(Ok(accepted)),
                Err(error) if is_for_later(&error) => break,
                Err(error) if is_of_the_client(&error) => {}
                Err(error) => {
                    set.remove(self.key, &self.listener);
                    self.paused_until = Some(now + PAUSE);
                    return Some(Err(Error(format!(
                        "a client could not be accepted ({error}); close other programs or raise the limit of open \
                         files"
                    ))));
                }
            }
        }
        self.left = self.most;
        None
    }
}

/// Returns true if accepting failed for a reason that concerns only this client.
fn is_of_the_client(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::ConnectionAborted | io::ErrorKind::ConnectionReset
    )
}

#[cfg(test)]
mod tests {
    use std::io::ErrorKind;
    use std::net;
    use std::sync::Mutex;

    use tickbus_base::time::{SimulatedListener, SimulatedSocket, SimulatedStream, Stop};

    use super::*;

    /// A listener that fails, each time with the next of these errors.
    #[derive(Debug)]
    struct Failing(Mutex<Vec<ErrorKind>>);

    impl SimulatedSocket for Failing {
        fn identity(&self) -> u64 {
            0
        }

        fn local_addr(&self) -> io::Result<SocketAddr> {
            Err(ErrorKind::Unsupported.into())
        }
    }

    impl SimulatedListener for Failing {
        fn accept(&self) -> io::Result<(Box<dyn SimulatedStream>, SocketAddr)> {
            let mut errors = self.0.lock().expect("no panic");
            Err(errors.pop().unwrap_or(ErrorKind::WouldBlock).into())
        }
    }

    #[test]
    fn a_turn_accepts_no_more_than_its_limit() {
        for (is_one, most) in [(false, ACCEPTS), (true, 1)] {
            let (listener, address) =
                crate::bind(&crate::Address::local(0), None).expect("a free port");
            let mut acceptor = Acceptor::new(listener, Acceptor::KEY);
            if is_one {
                acceptor = acceptor.one_per_turn();
            }
            let mut set = PollSet::new(&Stop::new());
            acceptor.watch(Nanos::ZERO, &mut set).expect("it waits");
            let connect = || net::TcpStream::connect(address).expect("it listens");
            let clients: Vec<_> = (0..=most).map(|_| connect()).collect();
            for accepted in [most, 1, 0] {
                let turn = std::iter::from_fn(|| acceptor.accept(Nanos::ZERO, &mut set));
                assert_eq!(turn.flatten().count(), accepted);
            }
            drop(clients);
        }
    }

    #[test]
    fn a_client_that_broke_off_is_skipped_and_a_lack_of_sockets_begins_a_pause() {
        let errors = vec![ErrorKind::OutOfMemory, ErrorKind::ConnectionAborted];
        let listener = TcpListener::Simulated(Box::new(Failing(Mutex::new(errors))));
        let mut acceptor = Acceptor::new(listener, Acceptor::KEY);
        let mut set = PollSet::new(&Stop::new());
        let now = Nanos::from_secs(5);
        assert!(acceptor.accept(now, &mut set).is_none(), "nobody watches");
        acceptor.watch(now, &mut set).expect("it waits");
        assert_eq!(acceptor.deadline(), Nanos::MAX);
        let failed = acceptor.accept(now, &mut set).expect("an attempt");
        let told = failed.expect_err("no socket").to_string();
        assert!(told.contains("a client could not be accepted"), "{told}");
        assert!(acceptor.accept(now, &mut set).is_none());
        assert_eq!(acceptor.deadline(), now + PAUSE);
        acceptor.watch(now, &mut set).expect("it waits");
        assert_eq!(acceptor.deadline(), now + PAUSE, "the pause lasts");
        acceptor.watch(now + PAUSE, &mut set).expect("it waits");
        assert_eq!(acceptor.deadline(), Nanos::MAX);
        assert!(acceptor.accept(now + PAUSE, &mut set).is_none());
    }
}
