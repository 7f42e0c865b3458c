//! Waiting for sockets, a deadline and a stop, all at once.

#[cfg(any(test, not(any(target_os = "linux", target_os = "android"))))]
mod each;
#[cfg(any(target_os = "linux", target_os = "android"))]
mod epoll;

use std::fmt;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use rustix::fd::AsFd;

#[cfg(not(any(target_os = "linux", target_os = "android")))]
use each as watch;
#[cfg(any(target_os = "linux", target_os = "android"))]
use epoll as watch;

use super::poll::wake;
use super::pollable::{Pollable, Source};
use crate::time::{Clock, Interest, Nanos, Ready, Stop};

/// Lets one thread wait for sockets, a deadline, and its [`Stop`], whichever comes first.
///
/// A socket is identified by the key that it was added with. The set is the waker of its token as long as it exists.
pub struct PollSet {
    stop: Stop,
    /// `None` until needed: a simulation has none.
    system: Option<System>,
    /// Sockets of a simulation: key, identity, and what to wait for.
    simulated: Vec<(usize, u64, Interest)>,
    ready: Vec<Ready>,
}

/// The operating system's side of a set.
struct System {
    wake: wake::Receiver,
    watch: watch::Watch,
}

impl fmt::Debug for PollSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PollSet").finish_non_exhaustive()
    }
}

/// The key of the socket by which other threads wake this one.
const WAKE: usize = usize::MAX;

/// From this span on a deadline is far: the work of a turn does not matter for it.
const FAR: Nanos = Nanos::from_millis(4);

impl System {
    fn new(stop: &Stop) -> io::Result<Self> {
        let (sender, wake) = wake::pair()?;
        let mut watch = watch::Watch::new()?;
        watch.add(WAKE, &wake, Interest::Read)?;
        // If the buffer is full, a wake-up is already pending; nothing else can fail between the two ends of a pair.
        stop.set_waker(Some(Arc::new(move || drop(sender.send()))));
        Ok(Self { wake, watch })
    }
}

impl PollSet {
    /// An empty set that `stop` wakes.
    pub fn new(stop: &Stop) -> Self {
        Self {
            stop: stop.clone(),
            system: None,
            simulated: Vec::new(),
            ready: Vec::new(),
        }
    }

    fn system(&mut self) -> io::Result<&mut System> {
        if self.system.is_none() {
            self.system = Some(System::new(&self.stop)?);
        }
        Ok(self.system.as_mut().expect("it was just made"))
    }

    /// Adds a socket. The caller keeps it, and must [remove](Self::remove) it before closing it.
    ///
    /// # Errors
    ///
    /// The system cannot wait for it.
    ///
    /// # Panics
    ///
    /// When `key` is `usize::MAX`, which the set uses itself.
    pub fn add(
        &mut self,
        key: usize,
        socket: &impl Pollable,
        interest: Interest,
    ) -> io::Result<()> {
        assert_ne!(key, WAKE, "a key that is taken");
        match socket.source() {
            Source::Os(socket) => self.system()?.watch.add(key, &socket, interest),
            Source::Simulated(identity) => {
                self.simulated.push((key, identity, interest));
                Ok(())
            }
        }
    }

    /// Changes the interest in a socket.
    ///
    /// # Errors
    ///
    /// The system cannot wait for it.
    pub fn change(
        &mut self,
        key: usize,
        socket: &impl Pollable,
        interest: Interest,
    ) -> io::Result<()> {
        match socket.source() {
            Source::Os(socket) => self.system()?.watch.change(key, &socket, interest),
            Source::Simulated(_) => {
                let places = self.simulated.iter_mut().filter(|place| place.0 == key);
                places.for_each(|place| place.2 = interest);
                Ok(())
            }
        }
    }

    /// Removes a socket.
    pub fn remove(&mut self, key: usize, socket: &impl Pollable) {
        match socket.source() {
            Source::Os(socket) => {
                if let Some(system) = &mut self.system {
                    system.watch.remove(key, &socket);
                }
            }
            Source::Simulated(_) => self.simulated.retain(|place| place.0 != key),
        }
        self.ready.retain(|ready| ready.key != key);
    }

    /// Waits until a socket is ready, `deadline` has come on `clock`, or the token is stopped or woken. It
    /// may return early. [`ready`](Self::ready) then lists the sockets.
    ///
    /// # Errors
    ///
    /// The system cannot wait.
    pub fn wait(&mut self, clock: &dyn Clock, deadline: Nanos) -> io::Result<()> {
        // However far, the deadline is taken for a near one.
        self.wait_after(deadline, clock, deadline)
    }

    /// As [`wait`](Self::wait), for a thread that has looked at `clock` in this turn, at `now`: another look is only
    /// taken where it matters.
    ///
    /// # Errors
    ///
    /// The system cannot wait.
    pub fn wait_after(&mut self, now: Nanos, clock: &dyn Clock, deadline: Nanos) -> io::Result<()> {
        self.ready.clear();
        if let Some(simulation) = clock.simulation() {
            simulation.poll(&self.simulated, deadline, &self.stop, &mut self.ready);
            return Ok(());
        }
        self.system()?;
        let (system, ready, stop) = (&mut self.system, &mut self.ready, &self.stop);
        let System { wake, watch } = system.as_mut().expect("it was just made");
        if deadline - now >= FAR && clock.is_steady() && !stop.is_woken() {
            watch.wait_far((clock, now), deadline, ready)?;
        } else {
            let mut waited = Ok(());
            clock.wait_with(deadline, stop, &mut |patience| {
                // The token may have been woken before the waker was set; no wake-up would follow.
                let patience = if stop.is_woken() {
                    Some(Duration::ZERO)
                } else {
                    patience
                };
                waited = watch.wait(patience, ready);
            });
            waited?;
        }
        if let Some(woken) = ready.iter().position(|ready| ready.key == WAKE) {
            ready.swap_remove(woken);
            wake.drain();
        }
        Ok(())
    }

    /// The sockets that were ready after the last wait, in no particular order.
    pub fn ready(&self) -> &[Ready] {
        &self.ready
    }
}

impl Drop for PollSet {
    fn drop(&mut self) {
        if self.system.is_some() {
            self.stop.set_waker(None);
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

    fn pairs(count: usize) -> Vec<(TcpStream, TcpStream)> {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        (0..count)
            .map(|_| {
                let client = TcpStream::connect(address).expect("it listens");
                (client, listener.accept().expect("it connected").0)
            })
            .collect()
    }

    #[test]
    fn those_that_are_ready_are_told_and_no_others() {
        let mut pairs = pairs(100);
        let (clock, stop) = (Manual::new(), Stop::new());
        let mut set = PollSet::new(&stop);
        for (key, (_, server)) in pairs.iter().enumerate() {
            set.add(key, server, Interest::Read).expect("it is open");
        }
        for key in [3, 77] {
            pairs[key].0.write_all(&[1]).expect("the server is there");
        }
        let mut keys = Vec::new();
        while keys.len() < 2 {
            set.wait(&*clock, Nanos::MAX).expect("it waits");
            keys = set.ready().iter().map(|ready| ready.key).collect();
        }
        keys.sort_unstable();
        assert_eq!(keys, [3, 77]);
        assert!(set.ready().iter().all(|ready| !ready.is_writable));
        set.change(3, &pairs[3].1, Interest::Write)
            .expect("it is open");
        set.remove(77, &pairs[77].1);
        assert_eq!(set.ready().len(), 1, "who was removed is not told any more");
        set.wait(&*clock, Nanos::MAX).expect("it waits");
        let writable = Ready {
            key: 3,
            is_readable: false,
            is_writable: true,
        };
        assert_eq!(set.ready(), [writable]);
    }

    #[test]
    fn bytes_end_a_wait_on_a_clock_that_stands_still() {
        let mut pairs = pairs(1);
        let (client, server) = &mut pairs[0];
        let (clock, stop) = (Manual::new(), Stop::new());
        let mut set = PollSet::new(&stop);
        set.add(0, server, Interest::Read).expect("it is open");
        client.write_all(&[1]).expect("the server is there");
        set.wait(&*clock, Nanos::MAX).expect("it waits");
        let readable = Ready {
            key: 0,
            is_readable: true,
            is_writable: false,
        };
        assert_eq!(set.ready(), [readable]);
    }

    #[test]
    fn the_manual_clock_ends_a_wait_at_its_deadline() {
        let pairs = pairs(1);
        let (clock, stop) = (Manual::new(), Stop::new());
        thread::scope(|scope| {
            let waiting = scope.spawn(|| {
                let mut set = PollSet::new(&stop);
                set.add(0, &pairs[0].1, Interest::Read).expect("it is open");
                while clock.now() < Nanos(10) {
                    set.wait(&*clock, Nanos(10)).expect("it waits");
                }
                set.ready().len()
            });
            while !clock.is_settled(1) {
                thread::yield_now();
            }
            clock.advance(Nanos(10));
            assert_eq!(waiting.join().expect("no panic"), 0);
        });
    }

    #[test]
    fn stop_and_wake_end_a_wait_even_when_they_come_first() {
        let clock = Monotonic::shared();
        let stop = Stop::new();
        stop.wake();
        let mut set = PollSet::new(&stop);
        set.wait(&*clock, Nanos::MAX).expect("woken before");
        drop(set);
        let waiting = thread::spawn({
            let clock = Arc::clone(&clock);
            let stop = stop.clone();
            move || {
                // A set cannot move to another thread.
                let mut set = PollSet::new(&stop);
                set.wait(&*clock, Nanos::MAX)
            }
        });
        stop.stop();
        waiting.join().expect("no panic").expect("stopped");
    }

    #[test]
    fn a_deadline_ends_a_wait() {
        let clock = Monotonic::shared();
        let mut set = PollSet::new(&Stop::new());
        for span in [2, 102] {
            let deadline = clock.now() + Nanos::from_millis(span);
            while clock.now() < deadline {
                set.wait(&*clock, deadline).expect("it waits");
            }
            let deadline = clock.now() + Nanos::from_millis(span);
            let mut waits = 0;
            while clock.now() < deadline {
                let now = clock.now();
                set.wait_after(now, &*clock, deadline).expect("it waits");
                waits += 1;
            }
            assert!(waits < 5, "{waits} waits of {span} ms");
        }
    }
}
