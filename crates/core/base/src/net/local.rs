//! Listening on a local socket: a Unix socket with a path in the file system.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{FileTypeExt as _, MetadataExt as _, PermissionsExt as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};
use rustix::io::{Errno, FdFlags, fcntl_setfd};
use rustix::net::{AddressFamily, SocketAddrUnix, SocketType};

use super::BACKLOG;
use crate::time::{Clock as _, Monotonic, Nanos, Stop};

/// How long to wait for another server that is about to listen in the same folder.
const PATIENCE: Nanos = Nanos::from_secs(1);

/// A listening Unix socket, for programs of the same user. Its file is removed when the listener is dropped.
#[derive(Debug)]
pub struct LocalListener {
    listener: UnixListener,
    path: PathBuf,
    /// The device and the number of the file, which another server may have replaced.
    file: (u64, u64),
}

impl LocalListener {
    /// Listens at `path`, without blocking. The file of a server that has ended without removing it is replaced.
    ///
    /// # Errors
    ///
    /// [`ErrorKind::AddrInUse`] if a server listens there; [`ErrorKind::AlreadyExists`] if the file there is no socket;
    /// or the system refuses the path.
    pub fn bind(path: &Path) -> io::Result<Self> {
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        // Two servers that find the same leftover would otherwise remove each other's file. The system unlocks the
        // folder when this handle is dropped.
        let lock = File::open(folder.unwrap_or_else(|| Path::new(".")))?;
        lock_soon(&lock)?;
        remove_leftover(path)?;
        let socket = rustix::net::socket(AddressFamily::UNIX, SocketType::STREAM, None)?;
        fcntl_setfd(&socket, FdFlags::CLOEXEC)?;
        rustix::net::bind(&socket, &SocketAddrUnix::new(path)?)?;
        let found = fs::symlink_metadata(path)?;
        let listener = Self {
            listener: socket.into(),
            path: path.to_owned(),
            file: (found.dev(), found.ino()),
        };
        // Nobody can connect before `listen`.
        fs::set_permissions(path, fs::Permissions::from_mode(0o600))?;
        rustix::net::listen(&listener.listener, BACKLOG)?;
        listener.listener.set_nonblocking(true)?;
        Ok(listener)
    }

    /// The path of the socket.
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub(super) fn accept(&self) -> io::Result<UnixStream> {
        self.listener.accept().map(|(stream, _)| stream)
    }

    /// The socket, for waiting.
    pub(crate) const fn socket(&self) -> &UnixListener {
        &self.listener
    }
}

impl Drop for LocalListener {
    fn drop(&mut self) {
        let is_own = |found: fs::Metadata| (found.dev(), found.ino()) == self.file;
        if fs::symlink_metadata(&self.path).is_ok_and(is_own) {
            // If this fails, the next server removes the file.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Locks a folder; gives up after a moment.
fn lock_soon(folder: &File) -> io::Result<()> {
    let clock = Monotonic::shared();
    let limit = clock.now() + PATIENCE;
    loop {
        match flock(folder, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => return Ok(()),
            Err(Errno::WOULDBLOCK) if clock.now() >= limit => {
                let what = "another program has locked the folder";
                return Err(io::Error::new(ErrorKind::ResourceBusy, what));
            }
            Err(Errno::WOULDBLOCK) => {
                clock.wait_until(clock.now() + Nanos::from_millis(1), &Stop::new());
            }
            Err(error) => return Err(error.into()),
        }
    }
}

/// Removes the socket of a server that has ended.
fn remove_leftover(path: &Path) -> io::Result<()> {
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error),
        Ok(found) if !found.file_type().is_socket() => {
            return Err(io::Error::new(
                ErrorKind::AlreadyExists,
                "a file that is no socket is there",
            ));
        }
        Ok(_) => {}
    }
    match UnixStream::connect(path) {
        Ok(_) => Err(io::Error::new(
            ErrorKind::AddrInUse,
            "another server listens there",
        )),
        Err(error) if error.kind() == ErrorKind::ConnectionRefused => fs::remove_file(path),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bind(path: &Path) -> Result<LocalListener, ErrorKind> {
        LocalListener::bind(path).map_err(|error| error.kind())
    }

    #[test]
    fn a_leftover_is_replaced_a_live_server_and_another_file_are_not() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("cell");
        let first = bind(&path).expect("it is free");
        let mode = fs::metadata(&path).expect("it is there").permissions();
        assert_eq!(mode.mode() & 0o777, 0o600);
        assert_eq!(bind(&path).expect_err("live"), ErrorKind::AddrInUse);
        drop(first);
        assert!(!path.exists(), "it is removed");
        // A server that was killed leaves its file.
        drop(UnixListener::bind(&path).expect("it is free"));
        assert!(path.exists());
        let second = bind(&path).expect("the leftover is replaced");
        // Its file was removed by hand, and another server took the place.
        fs::remove_file(&path).expect("it is there");
        let third = bind(&path).expect("it is free");
        drop(second);
        UnixStream::connect(&path).expect("the third still listens");
        drop(third);
        fs::write(&path, "precious").expect("a file");
        assert_eq!(bind(&path).expect_err("a file"), ErrorKind::AlreadyExists);
        assert_eq!(fs::read(&path).expect("it is there"), b"precious");
    }
}
