//! Waiting by a look at every socket, through the set's own handles.

use rustix::event::{PollFd, PollFlags};

use super::{AsFd, Duration, Interest, Ready, io};
use crate::os::poll::poll_once;
use crate::time::{Clock, Nanos};

#[cfg(unix)]
type Owned = std::os::fd::OwnedFd;
#[cfg(not(unix))]
type Owned = std::os::windows::io::OwnedSocket;

pub(super) struct Watch {
    sockets: Vec<(usize, Owned, Interest)>,
    /// The list for the system, empty between waits: its memory is kept.
    polled: Vec<PollFd<'static>>,
}

const fn flags(interest: Interest) -> PollFlags {
    match interest {
        Interest::Read => PollFlags::IN,
        Interest::Write => PollFlags::OUT,
        Interest::ReadWrite => PollFlags::IN.union(PollFlags::OUT),
    }
}

impl Watch {
    #[expect(clippy::unnecessary_wraps, reason = "as on Linux")]
    pub(super) fn new() -> io::Result<Self> {
        Ok(Self {
            sockets: Vec::new(),
            polled: Vec::new(),
        })
    }

    pub(super) fn add(
        &mut self,
        key: usize,
        socket: &impl AsFd,
        interest: Interest,
    ) -> io::Result<()> {
        self.sockets
            .push((key, socket.as_fd().try_clone_to_owned()?, interest));
        Ok(())
    }

    #[expect(clippy::unnecessary_wraps, reason = "as on Linux")]
    pub(super) fn change(
        &mut self,
        key: usize,
        _socket: &impl AsFd,
        interest: Interest,
    ) -> io::Result<()> {
        for entry in &mut self.sockets {
            if entry.0 == key {
                entry.2 = interest;
            }
        }
        Ok(())
    }

    pub(super) fn remove(&mut self, key: usize, _socket: &impl AsFd) {
        self.sockets.retain(|entry| entry.0 != key);
    }

    pub(super) fn wait_far(
        &mut self,
        (_, now): (&dyn Clock, Nanos),
        deadline: Nanos,
        ready: &mut Vec<Ready>,
    ) -> io::Result<()> {
        let patience = (deadline != Nanos::MAX).then(|| (deadline - now).to_duration());
        self.wait(patience, ready)
    }

    pub(super) fn wait(
        &mut self,
        patience: Option<Duration>,
        ready: &mut Vec<Ready>,
    ) -> io::Result<()> {
        let mut all = emptied(std::mem::take(&mut self.polled));
        let sockets = self.sockets.iter();
        all.extend(sockets.map(|(_, socket, interest)| PollFd::new(socket, flags(*interest))));
        poll_once(&mut all, patience)?;
        let broken = PollFlags::HUP | PollFlags::ERR;
        for ((key, ..), fd) in self.sockets.iter().zip(&all) {
            let found = Ready {
                key: *key,
                is_readable: fd.revents().intersects(PollFlags::IN | broken),
                is_writable: fd.revents().intersects(PollFlags::OUT | broken),
            };
            if found.is_readable || found.is_writable {
                ready.push(found);
            }
        }
        self.polled = emptied(all);
        Ok(())
    }
}

/// An empty list in the memory of `list`, for entries of another lifetime: collecting a list's own entries keeps its
/// memory.
fn emptied<'a>(mut list: Vec<PollFd<'_>>) -> Vec<PollFd<'a>> {
    list.clear();
    list.into_iter()
        .map(|_| unreachable!("it is empty"))
        .collect()
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;

    use super::*;
    use crate::time::Manual;

    #[test]
    fn those_that_are_ready_are_reported_without_a_new_list() {
        let socket = || UdpSocket::bind("127.0.0.1:0").expect("a free port");
        let (silent, heard) = (socket(), socket());
        let mut watch = Watch::new().expect("it needs nothing");
        watch.add(3, &silent, Interest::Read).expect("it is open");
        watch.add(4, &heard, Interest::Read).expect("it is open");
        let mut ready = Vec::new();
        watch
            .wait(Some(Duration::ZERO), &mut ready)
            .expect("it waits");
        assert!(ready.is_empty(), "nothing was sent");
        let list = watch.polled.as_ptr();
        let address = heard.local_addr().expect("it is bound");
        silent.send_to(&[1], address).expect("it is local");
        for deadline in [Nanos(1), Nanos::from_secs(9), Nanos::MAX] {
            ready.clear();
            let waited = watch.wait_far((&*Manual::new(), Nanos::ZERO), deadline, &mut ready);
            waited.expect("it waits");
            assert_eq!(ready.iter().map(|ready| ready.key).collect::<Vec<_>>(), [4]);
        }
        watch
            .change(4, &heard, Interest::ReadWrite)
            .expect("it is open");
        watch.remove(3, &silent);
        ready.clear();
        watch.wait(None, &mut ready).expect("it waits");
        assert!(ready[0].is_readable && ready[0].is_writable);
        assert_eq!(watch.polled.as_ptr(), list, "in the same memory");
    }
}
