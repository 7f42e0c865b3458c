//! A serial line without hardware: two pseudo-terminals, and a thread that copies what is written to one of
//! them to the other.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::fs::{Mode, OFlags, fcntl_setfl, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// The line; dropping it ends it.
pub(crate) struct Line {
    /// The names of its two ends.
    pub ends: [PathBuf; 2],
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Kept open, so that it does not hang up between two programs.
    _kept: [OwnedFd; 2],
}

impl Line {
    pub(crate) fn new() -> Self {
        let [one, other] = [end(), end()];
        let over = Arc::new(AtomicBool::new(false));
        let thread = std::thread::spawn({
            let over = Arc::clone(&over);
            let mut masters = [one.master, other.master];
            move || {
                while !over.load(Ordering::Relaxed) {
                    carry(&mut masters);
                }
            }
        });
        Self {
            ends: [one.name, other.name],
            over,
            thread: Some(thread),
            _kept: [one.kept, other.kept],
        }
    }

    pub(crate) fn end(&self, index: usize) -> &Path {
        &self.ends[index]
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("the line did not panic");
        }
    }
}

struct End {
    master: File,
    name: PathBuf,
    kept: OwnedFd,
}

fn end() -> End {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY;
    let master = openpt(flags).expect("a pseudo-terminal");
    grantpt(&master).expect("it is ours");
    unlockpt(&master).expect("it is ours");
    fcntl_setfl(&master, OFlags::NONBLOCK).expect("an option");
    let name = ptsname(&master, Vec::new()).expect("it has a name");
    let name = PathBuf::from(name.into_string().expect("ASCII"));
    let kept = open(&name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).expect("its other end");
    // By default a terminal echoes its input.
    let mut attributes = tcgetattr(&kept).expect("it is a terminal");
    attributes.make_raw();
    tcsetattr(&kept, OptionalActions::Now, &attributes).expect("it is a terminal");
    End {
        master: master.into(),
        name,
        kept,
    }
}

fn carry(masters: &mut [File; 2]) {
    let patience = Timespec {
        tv_sec: 0,
        tv_nsec: 20_000_000,
    };
    let ready = {
        let mut fds = [
            PollFd::new(&masters[0], PollFlags::IN),
            PollFd::new(&masters[1], PollFlags::IN),
        ];
        let _ = poll(&mut fds, Some(&patience));
        fds.map(|fd| fd.revents().contains(PollFlags::IN))
    };
    for (from, ready) in ready.into_iter().enumerate() {
        let mut bytes = [0; 1024];
        if ready && let Ok(count) = masters[from].read(&mut bytes) {
            // When the line is full, data are lost, as on a real one.
            let _ = masters[1 - from].write_all(&bytes[..count]);
        }
    }
}
