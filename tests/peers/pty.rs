//! A serial line without hardware: pseudo-terminals, and a thread that copies the data written to one of them to all
//! others, damaged if requested.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::fs::{Mode, OFlags, fcntl_setfl, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// The line; dropping it ends it.
pub(crate) struct Line {
    /// The names of its ends.
    ends: Vec<PathBuf>,
    over: Arc<AtomicBool>,
    harm: Arc<Harm>,
    /// The octets that came from each end.
    octets: Arc<[AtomicUsize]>,
    thread: Option<JoinHandle<()>>,
    /// Kept open, so that the line does not hang up between two programs.
    _kept: Vec<OwnedFd>,
}

/// The damage that the line does to its bytes.
#[derive(Default)]
struct Harm {
    /// One piece out of this many is damaged; 0 for none.
    each: AtomicUsize,
    pieces: AtomicUsize,
}

impl Harm {
    /// Flips a bit, cuts off the last byte, or inserts noise in front.
    fn befall(&self, piece: &mut Vec<u8>) {
        let each = self.each.load(Ordering::Relaxed);
        let number = self.pieces.fetch_add(1, Ordering::Relaxed);
        if each == 0 || !number.is_multiple_of(each) || piece.len() < 3 {
            return;
        }
        let which = number / each;
        match which % 4 {
            0 => drop(piece.pop()),
            1 => drop(piece.splice(0..0, [0x00, 0x68, 0xFF])),
            _ => {
                let bit = which % (8 * piece.len());
                piece[bit / 8] ^= 1 << (bit % 8);
            }
        }
    }
}

impl Line {
    /// A line with two ends.
    pub(crate) fn new() -> Self {
        Self::with_ends(2)
    }

    pub(crate) fn with_ends(count: usize) -> Self {
        let all: Vec<End> = std::iter::repeat_with(end).take(count).collect();
        let over = Arc::new(AtomicBool::new(false));
        let harm = Arc::new(Harm::default());
        let octets: Arc<[AtomicUsize]> = all.iter().map(|_| AtomicUsize::new(0)).collect();
        let (mut ends, mut masters, mut kept) = (Vec::new(), Vec::new(), Vec::new());
        for end in all {
            ends.push(end.name);
            masters.push(end.master);
            kept.push(end.kept);
        }
        let thread = std::thread::spawn({
            let (over, harm, octets) = (Arc::clone(&over), Arc::clone(&harm), Arc::clone(&octets));
            move || {
                while !over.load(Ordering::Relaxed) {
                    carry(&mut masters, &harm, &octets);
                }
            }
        });
        Self {
            ends,
            over,
            harm,
            octets,
            thread: Some(thread),
            _kept: kept,
        }
    }

    /// From now on damages one piece out of `count`; 0 for none.
    pub(crate) fn damage_each(&self, count: usize) {
        self.harm.each.store(count, Ordering::Relaxed);
    }

    pub(crate) fn end(&self, index: usize) -> &Path {
        &self.ends[index]
    }

    /// How many octets this end has sent.
    pub(crate) fn octets(&self, index: usize) -> usize {
        self.octets[index].load(Ordering::Relaxed)
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

fn carry(masters: &mut [File], harm: &Harm, octets: &[AtomicUsize]) {
    let patience = Timespec {
        tv_sec: 0,
        tv_nsec: 20_000_000,
    };
    let ready: Vec<bool> = {
        let watch = |master| PollFd::new(master, PollFlags::IN);
        let mut fds: Vec<PollFd<'_>> = masters.iter().map(watch).collect();
        let _ = poll(&mut fds, Some(&patience));
        let is_ready = |fd: &PollFd<'_>| fd.revents().contains(PollFlags::IN);
        fds.iter().map(is_ready).collect()
    };
    for (from, _) in ready.iter().enumerate().filter(|(_, ready)| **ready) {
        let mut bytes = [0; 1024];
        let Ok(count) = masters[from].read(&mut bytes) else {
            continue;
        };
        octets[from].fetch_add(count, Ordering::Relaxed);
        let mut piece = bytes[..count].to_vec();
        harm.befall(&mut piece);
        for (to, master) in masters.iter_mut().enumerate() {
            if to != from {
                // When the line is full, data are lost, as on a real one.
                let _ = master.write_all(&piece);
            }
        }
    }
}
