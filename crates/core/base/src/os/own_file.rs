//! The file that this code was loaded from.

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
    Err(io::Error::other("this system does not tell where that is"))
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

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_test_is_loaded_from_its_own_program() {
        let program = std::env::current_exe().expect("a path");
        assert_eq!(own_file().expect("found"), program);
    }

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
