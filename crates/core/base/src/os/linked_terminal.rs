//! A serial port for another program on this computer.

use std::fs::File;
use std::io::{self, Read, Write};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use rustix::fd::{AsFd, BorrowedFd};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};

use super::PseudoTerminal;
use super::pseudo_terminal::names_pseudo_terminal;

/// The far end of a pseudo-terminal whose near end has a stable name: a symbolic link that is removed with this value.
/// Reading and writing never block; a [`PollSet`](super::PollSet) can wait for it.
#[derive(Debug)]
pub struct LinkedTerminal {
    terminal: PseudoTerminal,
    near: PathBuf,
    link: PathBuf,
}

impl LinkedTerminal {
    /// Opens a pseudo-terminal that other programs can open as the serial port `link`. An existing link to a
    /// pseudo-terminal is replaced, even one in use.
    ///
    /// # Errors
    ///
    /// The path is occupied by something else, the folder is not writable, or the system has no free pseudo-terminals.
    pub fn open(link: &Path) -> io::Result<Self> {
        let (terminal, near) = PseudoTerminal::open()?;
        let far = terminal.far();
        fcntl_setfl(far, fcntl_getfl(far)? | OFlags::NONBLOCK)?;
        match link.symlink_metadata() {
            // Another program may have ended without removing the link.
            Ok(_) if std::fs::read_link(link).is_ok_and(|old| names_pseudo_terminal(&old)) => {
                std::fs::remove_file(link)?;
            }
            Ok(_) => return Err(io::ErrorKind::AlreadyExists.into()),
            Err(_) => {}
        }
        symlink(&near, link)?;
        Ok(Self {
            terminal,
            near,
            link: link.to_owned(),
        })
    }

    fn far(&self) -> &File {
        self.terminal.far()
    }
}

impl Drop for LinkedTerminal {
    fn drop(&mut self) {
        // Another program may have replaced the link.
        if std::fs::read_link(&self.link).is_ok_and(|near| near == self.near) {
            let _ = std::fs::remove_file(&self.link);
        }
    }
}

impl Read for LinkedTerminal {
    /// Reads the bytes that have arrived; without any, fails with [`WouldBlock`](io::ErrorKind::WouldBlock).
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.far().read(bytes)
    }
}

impl Write for LinkedTerminal {
    /// Writes as much as the other program has room for.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.far().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl AsFd for LinkedTerminal {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.far().as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::os::{Parity, SerialPort, SerialSettings};

    const SETTINGS: SerialSettings = SerialSettings {
        baud: 9600,
        parity: Parity::None,
        two_stop_bits: false,
        seven_bits: false,
        rs485: false,
    };

    #[test]
    fn it_is_a_serial_port_by_its_name_as_long_as_it_lives() {
        let folder = std::env::temp_dir().join(format!("linked-terminal-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let link = folder.join("reader");
        std::fs::write(&link, "").expect("a file");
        let refused = LinkedTerminal::open(&link).expect_err("a file is there");
        assert_eq!(refused.kind(), io::ErrorKind::AlreadyExists);
        std::fs::remove_file(&link).expect("it is there");
        for other in ["/dev/null", "/dev/shm/reader"] {
            symlink(other, &link).expect("a link");
            LinkedTerminal::open(&link).expect_err("it is no link to a pseudo-terminal");
            assert_eq!(std::fs::read_link(&link).ok(), Some(other.into()));
            std::fs::remove_file(&link).expect("it is there");
        }
        let first = LinkedTerminal::open(&link).expect("a terminal");
        let mut second = LinkedTerminal::open(&link).expect("it takes the other one's place");
        drop(first);
        let mut port = SerialPort::open(&link, SETTINGS).expect("the second one's");
        let mut bytes = [0; 8];
        let nothing = second.read(&mut bytes).expect_err("nothing is there");
        assert_eq!(nothing.kind(), io::ErrorKind::WouldBlock);
        second.write_all(&[3, 0x0D, 0x11]).expect("room");
        assert_eq!(port.read(&mut bytes).ok(), Some(3));
        assert_eq!(bytes[..3], [3, 0x0D, 0x11], "as they were");
        port.write_all(&[4]).expect("room");
        assert_eq!(second.read(&mut bytes).ok(), Some(1));
        drop(second);
        assert!(!link.is_symlink());
        assert!(
            !matches!(port.read(&mut bytes), Ok(1..)),
            "the line is unplugged"
        );
        std::fs::remove_dir(&folder).expect("it is empty");
    }
}
