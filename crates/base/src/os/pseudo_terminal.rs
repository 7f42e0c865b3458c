//! A serial port without hardware.

use std::fs::File;
use std::io::{self, Read as _, Write};
use std::path::PathBuf;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

/// The far end of a pseudo-terminal, whose near end can be opened as a serial port.
#[derive(Debug)]
pub struct PseudoTerminal(File);

impl PseudoTerminal {
    /// A new one, and the system's name of its near end.
    ///
    /// # Errors
    ///
    /// The system has no more.
    pub fn open() -> io::Result<(Self, PathBuf)> {
        let far = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&far)?;
        unlockpt(&far)?;
        let name = ptsname(&far, Vec::new())?.into_string();
        let name = name.map_err(|_| io::ErrorKind::InvalidData)?;
        Ok((Self(far.into()), name.into()))
    }

    /// Reads what arrives within `patience`; 0 bytes if nothing does, or while the near end is not open.
    ///
    /// # Errors
    ///
    /// The system cannot read.
    pub fn read_within(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let timeout = Timespec {
            tv_sec: i64::try_from(patience.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: patience.subsec_nanos().into(),
        };
        let mut fds = [PollFd::new(&self.0, PollFlags::IN)];
        poll(&mut fds, Some(&timeout))?;
        if fds[0].revents().contains(PollFlags::IN) {
            return self.0.read(bytes);
        }
        if fds[0].revents().contains(PollFlags::HUP) {
            // It does not wait by itself then.
            std::thread::sleep(patience);
        }
        Ok(0)
    }
}

impl Write for PseudoTerminal {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}
