//! Locks on files, respected by processes that use them.

#![cfg_attr(windows, allow(unsafe_code, reason = "the system locks a byte"))]

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

/// As on other systems. Windows refuses to read or write a locked part; so the lock is on one byte behind the end of any
/// file, which nobody reads or writes.
#[cfg(windows)]
pub fn lock_file(file: &File, lock: Lock) -> io::Result<bool> {
    use std::os::windows::io::AsRawHandle as _;

    use windows_sys::Win32::Foundation::ERROR_LOCK_VIOLATION;
    use windows_sys::Win32::Storage::FileSystem::{
        LOCKFILE_EXCLUSIVE_LOCK, LOCKFILE_FAIL_IMMEDIATELY, LockFileEx,
    };

    let flags = LOCKFILE_FAIL_IMMEDIATELY
        | match lock {
            Lock::Shared => 0,
            Lock::Exclusive => LOCKFILE_EXCLUSIVE_LOCK,
        };
    let mut place = locked_byte();
    // SAFETY: the handle is open, and the call returns at once, so that `place` outlives it.
    if unsafe { LockFileEx(file.as_raw_handle(), flags, 0, 1, 0, &raw mut place) } != 0 {
        return Ok(true);
    }
    let error = io::Error::last_os_error();
    if error.raw_os_error().map(i32::cast_unsigned) == Some(ERROR_LOCK_VIOLATION) {
        return Ok(false);
    }
    Err(error)
}

/// Unlocks a file.
#[cfg(windows)]
pub fn unlock_file(file: &File) {
    use std::os::windows::io::AsRawHandle as _;

    let mut place = locked_byte();
    // SAFETY: as for locking. If this fails, closing does it.
    let _ = unsafe {
        windows_sys::Win32::Storage::FileSystem::UnlockFileEx(
            file.as_raw_handle(),
            0,
            1,
            0,
            &raw mut place,
        )
    };
}

/// The last byte that a file could have.
#[cfg(windows)]
fn locked_byte() -> windows_sys::Win32::System::IO::OVERLAPPED {
    let mut place = windows_sys::Win32::System::IO::OVERLAPPED::default();
    place.Anonymous.Anonymous.Offset = u32::MAX - 1;
    place.Anonymous.Anonymous.OffsetHigh = i32::MAX.cast_unsigned();
    place
}

/// This system has no locks.
#[cfg(not(any(unix, windows)))]
pub fn lock_file(_file: &File, _lock: Lock) -> io::Result<bool> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Nothing is locked on this system.
#[cfg(not(any(unix, windows)))]
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_locked_file_can_be_read_but_not_locked_again() {
        use std::io::{Read as _, Write as _};

        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("locked");
        let mut one = File::create(&path).expect("a file");
        assert!(lock_file(&one, Lock::Exclusive).expect("locks"));
        one.write_all(b"text").expect("room");
        let mut two = File::open(&path).expect("it is there");
        assert!(!lock_file(&two, Lock::Shared).expect("locks"));
        let mut text = String::new();
        two.read_to_string(&mut text).expect("readable");
        assert_eq!(text, "text");
        unlock_file(&one);
        assert!(lock_file(&two, Lock::Shared).expect("locks"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_holder_of_a_lock_is_the_one_at_its_place() {
        let locks = "1: POSIX  ADVISORY  WRITE 7 08:01:12 0 EOF\n\
                     2: FLOCK  ADVISORY  WRITE 4119 08:01:12 0 EOF\n\
                     2: -> FLOCK  ADVISORY  READ 8 08:01:13 0 EOF\n";
        assert_eq!(holder(locks, "08:01:12"), Some(4119));
        assert_eq!(holder(locks, "08:01:13"), None, "it only waits");
    }
}
