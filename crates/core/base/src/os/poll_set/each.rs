//! Waiting by a look at every socket, through the set's own handles.

use rustix::event::{PollFd, PollFlags};

use super::{AsFd, Duration, Interest, Ready, io};
use crate::os::poll::poll_once;

#[cfg(unix)]
type Owned = std::os::fd::OwnedFd;
#[cfg(not(unix))]
type Owned = std::os::windows::io::OwnedSocket;

pub(super) struct Watch {
    sockets: Vec<(usize, Owned, Interest)>,
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

    pub(super) fn wait(
        &mut self,
        patience: Option<Duration>,
        ready: &mut Vec<Ready>,
    ) -> io::Result<()> {
        let mut all: Vec<PollFd<'_>> = self
            .sockets
            .iter()
            .map(|(_, socket, interest)| PollFd::new(socket, flags(*interest)))
            .collect();
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
        Ok(())
    }
}
