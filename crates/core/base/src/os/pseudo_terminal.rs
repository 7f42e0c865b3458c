//! A serial port without hardware.

use std::fs::File;
use std::io::{self, Read as _, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fd::OwnedFd;
use rustix::fs::{Mode, OFlags, open};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// The far end of a pseudo-terminal, whose near end can be opened as a serial port.
#[derive(Debug)]
pub struct PseudoTerminal {
    far: File,
    /// Kept open, so that the line does not hang up before another program opens it.
    _near: OwnedFd,
}

impl PseudoTerminal {
    /// Opens a pseudo-terminal; also returns the system's name of its near end.
    ///
    /// # Errors
    ///
    /// The system has no free pseudo-terminals.
    pub fn open() -> io::Result<(Self, PathBuf)> {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY;
        // A child process that inherits the end would keep the line from hanging up.
        #[cfg(target_os = "linux")]
        let flags = flags | OpenptFlags::CLOEXEC;
        let far = openpt(flags)?;
        grantpt(&far)?;
        unlockpt(&far)?;
        let name = ptsname(&far, Vec::new())?.into_string();
        let name = name.map_err(|_| io::ErrorKind::InvalidData)?;
        let near = open(
            &*name,
            OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC,
            Mode::empty(),
        )?;
        // By default a terminal echoes its input.
        let mut attributes = tcgetattr(&near)?;
        attributes.make_raw();
        tcsetattr(&near, OptionalActions::Now, &attributes)?;
        let far = File::from(far);
        Ok((Self { far, _near: near }, name.into()))
    }

    /// The far end itself.
    pub(super) fn far(&self) -> &File {
        &self.far
    }

    /// Reads the bytes that arrive within `patience`; 0 if nothing arrives.
    ///
    /// # Errors
    ///
    /// The system cannot read.
    pub fn read_within(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let timeout = Timespec {
            tv_sec: i64::try_from(patience.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: patience.subsec_nanos().into(),
        };
        let mut fds = [PollFd::new(&self.far, PollFlags::IN)];
        if poll(&mut fds, Some(&timeout))? == 0 {
            return Ok(0);
        }
        self.far.read(bytes)
    }
}

/// True if the path is a name that the system gives to pseudo-terminals.
pub fn names_pseudo_terminal(path: &Path) -> bool {
    if cfg!(target_os = "macos") {
        let name = path
            .to_str()
            .and_then(|path| path.strip_prefix("/dev/ttys"));
        name.is_some_and(|number| number.bytes().all(|digit| digit.is_ascii_digit()))
    } else {
        path.starts_with("/dev/pts")
    }
}

impl Write for PseudoTerminal {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.far.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.far.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_go_both_ways_and_nothing_is_echoed() {
        let (mut far, near) = PseudoTerminal::open().expect("a pseudo-terminal");
        let mut options = std::fs::OpenOptions::new();
        let mut near = options.read(true).write(true).open(near).expect("a port");
        let mut bytes = [0; 8];
        far.write_all(&[1, 0x0D, 3]).expect("a line");
        assert_eq!(near.read(&mut bytes).ok(), Some(3));
        assert_eq!(bytes[..3], [1, 0x0D, 3]);
        assert_eq!(
            far.read_within(&mut bytes, Duration::from_millis(1)).ok(),
            Some(0)
        );
        near.write_all(&[4]).expect("a line");
        assert_eq!(
            far.read_within(&mut bytes, Duration::from_secs(20)).ok(),
            Some(1)
        );
    }
}
