//! One end of a pseudo-terminal in the form that the DP master profirust needs: it has to pretend that bytes take their
//! time on the wire.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;

use profirust::Baudrate;
use profirust::phy::ProfibusPhy;
use profirust::time::Instant;

#[derive(Debug)]
pub struct Pty {
    file: File,
    baud: Baudrate,
    inbox: Vec<u8>,
    busy_until: Instant,
    /// The line is gone.
    pub broke: Option<io::Error>,
}

impl Pty {
    pub fn open(end: &Path, baud: Baudrate) -> io::Result<Self> {
        let flags = rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOCTTY;
        let flags = i32::try_from(flags.bits()).expect("flags");
        let mut options = OpenOptions::new();
        let file = options.read(true).write(true).custom_flags(flags);
        let file = file.open(end)?;
        // Unread bytes of a predecessor do not concern this one.
        let _ = rustix::termios::tcflush(&file, rustix::termios::QueueSelector::IOFlush);
        Ok(Self {
            file,
            baud,
            inbox: Vec::new(),
            busy_until: Instant::ZERO,
            broke: None,
        })
    }
}

impl ProfibusPhy for Pty {
    fn poll_transmission(&mut self, now: Instant) -> bool {
        now < self.busy_until
    }

    fn transmit_data<F, R>(&mut self, now: Instant, fill: F) -> R
    where
        F: FnOnce(&mut [u8]) -> (usize, R),
    {
        let mut buffer = [0; 256];
        let (length, result) = fill(&mut buffer);
        if length > 0 {
            if let Err(error) = self.file.write_all(&buffer[..length]) {
                self.broke = Some(error);
            }
            let bits = u32::try_from(11 * length).expect("a short telegram");
            self.busy_until = now + self.baud.bits_to_time(bits);
        }
        result
    }

    fn receive_data<F, R>(&mut self, _now: Instant, take: F) -> R
    where
        F: FnOnce(&[u8]) -> (usize, R),
    {
        let mut buffer = [0; 256];
        match self.file.read(&mut buffer) {
            Ok(count) => self.inbox.extend_from_slice(&buffer[..count]),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => self.broke = Some(error),
        }
        let (taken, result) = take(&self.inbox);
        self.inbox.drain(..taken);
        result
    }
}
