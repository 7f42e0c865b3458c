//! Shared memory of Unix: a file that is mapped.

use std::io;
use std::ptr::NonNull;
#[cfg(not(target_os = "linux"))]
use std::sync::atomic::Ordering;

pub(super) use rustix::fd::AsFd as Mappable;
use rustix::fd::OwnedFd;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

/// The file by which another process opens the memory.
pub type MemoryFile = OwnedFd;

/// Why a file was not mapped.
pub(super) enum Unmapped {
    /// The file has only this many bytes.
    TooSmall(u64),
    /// The system refused.
    System(io::Error),
}

impl From<rustix::io::Errno> for Unmapped {
    fn from(error: rustix::io::Errno) -> Self {
        Self::System(error.into())
    }
}

/// Maps the first `bytes` bytes of a file.
pub(super) fn map(file: &impl Mappable, bytes: usize) -> Result<NonNull<u8>, Unmapped> {
    let has = u64::try_from(rustix::fs::fstat(file)?.st_size).unwrap_or(0);
    if has < bytes as u64 {
        return Err(Unmapped::TooSmall(has));
    }
    // SAFETY: a new mapping, at an address that the system chooses, so no memory that is in use
    // changes. The file is long enough, as checked; where the system can, it is sealed against being
    // shortened, and elsewhere only processes of this user have it, none of which does that. If one did,
    // the system would end this process at its next access, rather than let it see anything else.
    let start = unsafe {
        mmap(
            std::ptr::null_mut(),
            bytes,
            ProtFlags::READ | ProtFlags::WRITE,
            MapFlags::SHARED,
            file,
            0,
        )?
    };
    Ok(NonNull::new(start.cast()).expect("mappings are not at address 0"))
}

/// Ends a mapping.
///
/// # Safety
///
/// The mapping is one that [`map`] made, with this length, and has no users.
pub(super) unsafe fn unmap(start: NonNull<u8>, bytes: usize) {
    // SAFETY: promised by the caller.
    let unmapped = unsafe { munmap(start.as_ptr().cast(), bytes) };
    debug_assert!(unmapped.is_ok(), "{unmapped:?}");
}

/// A file in memory, sealed against changes of its size.
#[cfg(target_os = "linux")]
pub(super) fn create(bytes: usize) -> io::Result<OwnedFd> {
    use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, ftruncate, memfd_create};

    let flags = MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING;
    let file = memfd_create("tickbus-image", flags)?;
    ftruncate(&file, bytes as u64)?;
    let seals = SealFlags::SHRINK | SealFlags::GROW | SealFlags::SEAL;
    fcntl_add_seals(&file, seals)?;
    Ok(file)
}

/// A file that has already been unlinked.
#[cfg(not(target_os = "linux"))]
pub(super) fn create(bytes: usize) -> io::Result<OwnedFd> {
    use std::os::unix::fs::OpenOptionsExt as _;
    use std::sync::atomic::AtomicU32;

    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let name = format!("tickbus-{}-{number}", std::process::id());
    let path = std::env::temp_dir().join(name);
    let mut options = std::fs::OpenOptions::new();
    let file = options
        .read(true)
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(&path)?;
    std::fs::remove_file(&path)?;
    file.set_len(bytes as u64)?;
    Ok(file.into())
}
