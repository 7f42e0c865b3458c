//! Locks on files, respected by processes that use them.

use std::fs::File;
use std::io;

/// How a file is locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lock {
    /// Several readers.
    Shared,
    /// One writer.
    Exclusive,
}

/// Locks a file, in all of its clones, until it is unlocked or closed; false if that would have to wait. The other lock
/// may be held by another process, or by this process through another handle.
///
/// # Errors
///
/// The system has no locks for this file.
#[cfg(unix)]
pub fn lock_file(file: &File, lock: Lock) -> io::Result<bool> {
    use rustix::fs::{FlockOperation, flock};

    let operation = match lock {
        Lock::Shared => FlockOperation::NonBlockingLockShared,
        Lock::Exclusive => FlockOperation::NonBlockingLockExclusive,
    };
    match flock(file, operation).map_err(io::Error::from) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(false),
        Err(error) => Err(error),
    }
}

/// Unlocks a file, also for processes that inherited it.
#[cfg(unix)]
pub fn unlock_file(file: &File) {
    // If this fails, closing does it.
    let _ = rustix::fs::flock(file, rustix::fs::FlockOperation::Unlock);
}

/// This system has no locks.
#[cfg(not(unix))]
pub fn lock_file(_file: &File, _lock: Lock) -> io::Result<bool> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Nothing is locked on this system.
#[cfg(not(unix))]
pub fn unlock_file(_file: &File) {}

/// The process that holds a lock on this file, if the system reports it.
pub fn lock_holder(file: &File) -> Option<u32> {
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::fs::MetadataExt as _;

        let metadata = file.metadata().ok()?;
        let device = metadata.dev();
        let (major, minor) = (rustix::fs::major(device), rustix::fs::minor(device));
        let place = format!("{major:02x}:{minor:02x}:{}", metadata.ino());
        holder(&std::fs::read_to_string("/proc/locks").ok()?, &place)
    }
    #[cfg(not(target_os = "linux"))]
    {
        let _ = file;
        None
    }
}

/// The process with a lock at `place`, as `/proc/locks` lists it: `1: FLOCK ADVISORY WRITE 4119 08:01:1234 0 EOF`.
#[cfg(target_os = "linux")]
fn holder(locks: &str, place: &str) -> Option<u32> {
    locks.lines().find_map(|line| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        match fields[..] {
            [_, "FLOCK", _, _, process, at, ..] if at == place => process.parse().ok(),
            _ => None,
        }
    })
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn the_holder_of_a_lock_is_the_one_at_its_place() {
        let locks = "1: POSIX  ADVISORY  WRITE 7 08:01:12 0 EOF\n\
                     2: FLOCK  ADVISORY  WRITE 4119 08:01:12 0 EOF\n\
                     2: -> FLOCK  ADVISORY  READ 8 08:01:13 0 EOF\n";
        assert_eq!(holder(locks, "08:01:12"), Some(4119));
        assert_eq!(holder(locks, "08:01:13"), None, "it only waits");
    }
}
