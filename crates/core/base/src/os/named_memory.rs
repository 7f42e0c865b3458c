//! Shared memory that processes find by its name.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

use rustix::fs::OFlags;

use super::{Lock, SharedMemory, lock_file, unlock_file};
use crate::time::{Clock as _, Monotonic, Nanos, Stop};

/// How many times to retry if the file disappears during its creation.
const ATTEMPTS: usize = 8;

/// [Shared memory](SharedMemory) in a file, which one process serves and others open.
///
/// While the memory is served, its file is locked; the system releases the lock when the process ends, however that
/// happens. So a second server is refused, a crashed server's file is replaced, and peers learn that their server is
/// gone.
#[derive(Debug)]
pub struct NamedMemory {
    memory: SharedMemory,
    file: File,
    /// The path to remove, if this process is the server.
    served: Option<PathBuf>,
}

impl NamedMemory {
    /// The file for a name, in the system's folder for memory if there is one.
    pub fn path(name: &str) -> PathBuf {
        let shared = Path::new("/dev/shm");
        let folder = if shared.is_dir() {
            shared.to_owned()
        } else {
            std::env::temp_dir()
        };
        folder.join(name)
    }

    /// Creates zeroed memory of at least `bytes` bytes in the file at `path`, for processes of the same user.
    ///
    /// # Errors
    ///
    /// [`ErrorKind::AddrInUse`] if another process serves it; or the file cannot be created.
    pub fn serve(path: &Path, bytes: usize) -> io::Result<Self> {
        let in_use = || io::Error::new(ErrorKind::AddrInUse, "another process serves it");
        for _ in 0..ATTEMPTS {
            match opened(path) {
                Ok(left) => {
                    // A process that only checks for a server locks the file for a moment.
                    if !lock_soon(&left)? {
                        return Err(in_use());
                    }
                    // There is no server. Processes that still have the file keep the old memory.
                    if is_at(&left, path) {
                        fs::remove_file(path)?;
                    }
                }
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
            let made = OpenOptions::new()
                .read(true)
                .write(true)
                .create_new(true)
                .mode(0o600)
                .open(path);
            let file = match made {
                Ok(file) => file,
                Err(error) if error.kind() == ErrorKind::AlreadyExists => continue,
                Err(error) => return Err(error),
            };
            // Until it is locked, the file looks like a leftover.
            if !lock_file(&file, Lock::Exclusive)? || !is_at(&file, path) {
                continue;
            }
            let words = SharedMemory::words_for(bytes).max(1) * size_of::<u64>();
            file.set_len(words as u64)?;
            let memory = SharedMemory::open(&file, bytes)?;
            let served = Some(path.to_owned());
            return Ok(Self {
                memory,
                file,
                served,
            });
        }
        Err(in_use())
    }

    /// Opens the memory that another process serves at `path`, all of it.
    ///
    /// # Errors
    ///
    /// [`ErrorKind::NotFound`] if no such file exists; or it cannot be opened.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = opened(path)?;
        let length = file.metadata()?.len();
        if length == 0 {
            // The server is still creating it.
            return Err(ErrorKind::NotFound.into());
        }
        let bytes = usize::try_from(length).map_err(|_| ErrorKind::OutOfMemory)?;
        let memory = SharedMemory::open(&file, bytes)?;
        let opened = Self {
            memory,
            file,
            served: None,
        };
        if !opened.is_served() {
            return Err(ErrorKind::NotFound.into());
        }
        Ok(opened)
    }

    /// The memory.
    pub const fn memory(&self) -> &SharedMemory {
        &self.memory
    }

    /// True if the serving process is alive.
    pub fn is_served(&self) -> bool {
        if self.served.is_some() {
            return true;
        }
        let is_free = lock_file(&self.file, Lock::Shared).is_ok_and(|is_free| is_free);
        if is_free {
            unlock_file(&self.file);
        }
        !is_free
    }
}

impl Drop for NamedMemory {
    fn drop(&mut self) {
        if let Some(path) = &self.served
            && is_at(&self.file, path)
        {
            // Otherwise the next server replaces it.
            let _ = fs::remove_file(path);
        }
    }
}

/// Opens the file at `path`, which must not be a link to another file.
fn opened(path: &Path) -> io::Result<File> {
    let no_link = OFlags::NOFOLLOW.bits().cast_signed();
    OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(no_link)
        .open(path)
}

/// Locks a file as its server, trying for some 50 ms; false if another process holds the lock.
fn lock_soon(file: &File) -> io::Result<bool> {
    let clock = Monotonic::shared();
    for _ in 0..50 {
        if lock_file(file, Lock::Exclusive)? {
            return Ok(true);
        }
        clock.wait_until(clock.now() + Nanos::from_millis(1), &Stop::new());
    }
    Ok(false)
}

/// True if `path` still leads to this file.
fn is_at(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(own), Ok(found)) => (own.dev(), own.ino()) == (found.dev(), found.ino()),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// A path for one test.
    fn fresh() -> PathBuf {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        NamedMemory::path(&format!("tickbus-test-{}-{number}", std::process::id()))
    }

    #[test]
    fn those_who_know_the_name_see_the_same_words() {
        let path = fresh();
        let server = NamedMemory::serve(&path, 100).expect("memory");
        let client = NamedMemory::open(&path).expect("it is served");
        server.memory().word(12).store(7, Ordering::Release);
        assert_eq!(client.memory().word(12).load(Ordering::Acquire), 7);
        drop(server);
        assert!(!client.is_served());
        assert!(!path.exists());
    }

    #[test]
    fn a_second_server_is_refused_and_a_stale_file_replaced() {
        let path = fresh();
        let server = NamedMemory::serve(&path, 8).expect("memory");
        let client = NamedMemory::open(&path).expect("it is served");
        assert!(client.is_served());
        let error = NamedMemory::serve(&path, 8).expect_err("it is served");
        assert_eq!(error.kind(), ErrorKind::AddrInUse);
        assert!(client.is_served(), "asking changes nothing");
        drop(server);
        // The leftover of a crash.
        fs::write(&path, [1; 64]).expect("it can be written");
        let error = NamedMemory::open(&path).expect_err("nobody serves it");
        assert_eq!(error.kind(), ErrorKind::NotFound);
        let server = NamedMemory::serve(&path, 8).expect("it replaces it");
        assert_eq!(server.memory().word(0).load(Ordering::Acquire), 0);
    }

    #[test]
    fn a_link_is_not_followed() {
        let (path, target) = (fresh(), fresh());
        fs::write(&target, [0; 64]).expect("it can be written");
        std::os::unix::fs::symlink(&target, &path).expect("a link");
        assert!(NamedMemory::serve(&path, 8).is_err());
        assert!(NamedMemory::open(&path).is_err());
        assert_eq!(fs::read(&target).expect("it is there"), [0; 64]);
        for file in [path, target] {
            fs::remove_file(file).expect("it is there");
        }
    }
}
