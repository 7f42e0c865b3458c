//! The file that this code was loaded from.

#![cfg_attr(
    windows,
    allow(unsafe_code, reason = "the system is asked for a module")
)]

use std::io;
use std::path::PathBuf;

/// The file that this code was loaded from: the native library, or the program that it is linked into.
///
/// # Errors
///
/// The system does not provide it, or the file no longer exists.
pub fn own_file() -> io::Result<PathBuf> {
    #[cfg(target_os = "linux")]
    {
        use std::os::unix::ffi::OsStrExt as _;

        let address = own_file as fn() -> io::Result<PathBuf> as usize;
        let maps = std::fs::read("/proc/self/maps")?;
        match mapped_file(&maps, address) {
            // The folder is often world-writable, such as /tmp: files in it cannot be trusted.
            Some(file) if file.ends_with(DELETED) => {
                let text = "its file came out of a jar, and is deleted since";
                return Err(io::Error::other(text));
            }
            Some(file) => return Ok(std::ffi::OsStr::from_bytes(file).into()),
            None => {}
        }
    }
    #[cfg(windows)]
    return windows::own_file();
    #[cfg(not(windows))]
    Err(io::Error::other("this system does not tell where that is"))
}

#[cfg(windows)]
mod windows {
    use std::ffi::OsString;
    use std::io;
    use std::os::windows::ffi::OsStringExt as _;
    use std::path::PathBuf;

    use windows_sys::Win32::System::LibraryLoader::{
        GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS, GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT,
        GetModuleFileNameW, GetModuleHandleExW,
    };

    /// The longest path of the system, in UTF-16 units.
    const LONGEST: usize = 1 << 15;

    pub(super) fn own_file() -> io::Result<PathBuf> {
        let flags =
            GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT;
        let address = own_file as fn() -> io::Result<PathBuf> as *const u16;
        let mut module = std::ptr::null_mut();
        // SAFETY: with these flags the second argument is any address in a module, and the handle is written.
        if unsafe { GetModuleHandleExW(flags, address, &raw mut module) } == 0 {
            return Err(io::Error::last_os_error());
        }
        let mut name = vec![0; LONGEST];
        let room = u32::try_from(name.len()).unwrap_or(0);
        // SAFETY: the buffer has the length given.
        let length = unsafe { GetModuleFileNameW(module, name.as_mut_ptr(), room) };
        match usize::try_from(length) {
            Ok(length) if length > 0 && length < name.len() => {
                let file = PathBuf::from(OsString::from_wide(&name[..length]));
                // tickbus-1234-tickbus.dll in the folder for temporary files, where other users may write.
                let is_copy = file.file_name().is_some_and(|name| {
                    let name = name.to_string_lossy();
                    name.starts_with("tickbus-") && name.ends_with("-tickbus.dll")
                });
                if is_copy {
                    return Err(io::Error::other("its file came out of a jar"));
                }
                Ok(file)
            }
            _ => Err(io::Error::last_os_error()),
        }
    }
}

/// The suffix in the list of mappings for a deleted file.
#[cfg(target_os = "linux")]
const DELETED: &[u8] = b" (deleted)";

/// The file of the mapping around `address`, as `/proc/PID/maps` lists it.
#[cfg(target_os = "linux")]
fn mapped_file(maps: &[u8], address: usize) -> Option<&[u8]> {
    maps.split(|byte| *byte == b'\n').find_map(|line| {
        // 7f12a000-7f12b000 r-xp 00001000 08:01 1234      /usr/lib/libx.so
        let range = line.split(|byte| *byte == b' ').next()?;
        let (start, end) = std::str::from_utf8(range).ok()?.split_once('-')?;
        let number = |text| usize::from_str_radix(text, 16).ok();
        if !(number(start)?..number(end)?).contains(&address) {
            return None;
        }
        Some(&line[line.iter().position(|byte| *byte == b'/')?..])
    })
}

#[cfg(all(test, any(target_os = "linux", windows)))]
mod tests {
    use super::*;

    #[test]
    fn a_test_is_loaded_from_its_own_program() {
        let program = std::env::current_exe().expect("a path");
        assert_eq!(own_file().expect("found"), program);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn files_with_blanks_and_deleted_ones_are_found() {
        let maps = b"1000-2000 r--p 00000000 08:01 77    /a/first\n\
                     2000-3000 r-xp 00001000 08:01 77    /b/with blank.so\n\
                     3000-4000 rw-p 00000000 00:00 0\n\
                     4000-5000 r-xp 00001000 08:01 78    /tmp/x/libtickbus.so (deleted)\n";
        for (address, file) in [
            (0xFFF, None),
            (0x1FFF, Some(&b"/a/first"[..])),
            (0x2000, Some(b"/b/with blank.so")),
            (0x3800, None),
            (0x4FFF, Some(b"/tmp/x/libtickbus.so (deleted)")),
            (0x5000, None),
        ] {
            assert_eq!(mapped_file(maps, address), file, "{address:x}");
        }
    }
}
