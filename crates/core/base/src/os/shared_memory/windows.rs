//! Shared memory of Windows: a part of the system's paging file, without a name; the other process gets a handle of it.

use std::io;
use std::os::windows::io::{AsRawHandle as _, FromRawHandle as _, OwnedHandle};
use std::ptr::NonNull;

use windows_sys::Win32::Foundation::{ERROR_ACCESS_DENIED, INVALID_HANDLE_VALUE};
use windows_sys::Win32::System::Memory::{
    CreateFileMappingW, FILE_MAP_ALL_ACCESS, MEMORY_MAPPED_VIEW_ADDRESS, MapViewOfFile,
    PAGE_READWRITE, UnmapViewOfFile,
};

/// The handle by which another process opens the memory.
pub type MemoryFile = OwnedHandle;

pub(super) use std::os::windows::io::AsHandle as Mappable;

/// Why memory was not mapped.
pub(super) enum Unmapped {
    /// The memory is smaller; Windows does not tell by how much.
    TooSmall(&'static str),
    /// The system refused.
    System(io::Error),
}

/// Creates zeroed memory.
pub(super) fn create(bytes: usize) -> io::Result<MemoryFile> {
    let size = bytes as u64;
    #[expect(clippy::cast_possible_truncation, reason = "the two halves are meant")]
    let (high, low) = ((size >> 32) as u32, size as u32);
    // SAFETY: no security attributes and no name are handed in.
    let section = unsafe {
        CreateFileMappingW(
            INVALID_HANDLE_VALUE,
            std::ptr::null(),
            PAGE_READWRITE,
            high,
            low,
            std::ptr::null(),
        )
    };
    if section.is_null() {
        return Err(io::Error::last_os_error());
    }
    // SAFETY: a handle that this process has just been given.
    Ok(unsafe { OwnedHandle::from_raw_handle(section) })
}

/// Maps the first `bytes` bytes.
pub(super) fn map(file: &impl Mappable, bytes: usize) -> Result<NonNull<u8>, Unmapped> {
    // SAFETY: the handle is open, and the system chooses the address.
    let view = unsafe {
        MapViewOfFile(
            file.as_handle().as_raw_handle(),
            FILE_MAP_ALL_ACCESS,
            0,
            0,
            bytes,
        )
    };
    NonNull::new(view.Value.cast()).ok_or_else(|| {
        let error = io::Error::last_os_error();
        // The answer to more bytes than there are.
        if error.raw_os_error().map(i32::cast_unsigned) == Some(ERROR_ACCESS_DENIED) {
            return Unmapped::TooSmall("fewer");
        }
        Unmapped::System(error)
    })
}

/// Ends a mapping.
///
/// # Safety
///
/// The mapping is one that [`map`] made, and has no users.
pub(super) unsafe fn unmap(start: NonNull<u8>, _bytes: usize) {
    let view = MEMORY_MAPPED_VIEW_ADDRESS {
        Value: start.as_ptr().cast(),
    };
    // SAFETY: promised by the caller.
    let unmapped = unsafe { UnmapViewOfFile(view) };
    debug_assert!(unmapped != 0, "{}", io::Error::last_os_error());
}
