//! Serial ports before they are opened: which exist, who may use them, and who does.

use std::path::{Path, PathBuf};

/// Where systems keep the names of serial ports, and the beginnings of those names.
const PLACES: [(&str, &str); 4] = [
    ("/dev/serial/by-id", ""),
    ("/dev", "ttyUSB"),
    ("/dev", "ttyACM"),
    ("/dev", "cu."),
];

/// The serial ports that are plugged in, as far as the system lists them by name.
pub fn ports() -> Vec<PathBuf> {
    let mut found = Vec::new();
    for (folder, beginning) in PLACES {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let names = entries.filter(|entry| {
            let name = entry.file_name();
            name.to_string_lossy().starts_with(beginning)
        });
        found.extend(names.map(|entry| entry.path()));
    }
    found.sort();
    found
}

/// The programs that have this device open, such as `minicom (process 4711)`, as far as the system tells: of other users'
/// programs it tells root alone.
#[cfg(target_os = "linux")]
pub fn users(device: &Path) -> Vec<String> {
    let Ok(device) = device.canonicalize() else {
        return Vec::new();
    };
    let mut found = Vec::new();
    for process in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
        let number = process.file_name();
        let Some(number) = number.to_str().filter(|text| text.parse::<u32>().is_ok()) else {
            continue;
        };
        let files = std::fs::read_dir(process.path().join("fd"));
        let mut files = files.into_iter().flatten().flatten();
        if files.any(|file| std::fs::read_link(file.path()).is_ok_and(|open| open == device)) {
            let name = std::fs::read_to_string(process.path().join("comm")).unwrap_or_default();
            found.push(format!("{} (process {number})", name.trim()));
        }
    }
    found.sort();
    found
}

/// The programs that have this device open; this system does not tell.
#[cfg(not(target_os = "linux"))]
pub fn users(device: &Path) -> Vec<String> {
    let _ = device;
    Vec::new()
}

/// Returns true if the port is a pseudo-terminal, which the program at its far end has open, too.
#[cfg(unix)]
pub fn is_pseudo_terminal(device: &Path) -> bool {
    let path = device.canonicalize();
    path.is_ok_and(|path| tickbus_base::os::names_pseudo_terminal(&path))
}

/// Returns false: this system has no pseudo-terminals.
#[cfg(not(unix))]
pub fn is_pseudo_terminal(device: &Path) -> bool {
    let _ = device;
    false
}

/// The group that a device belongs to, by its name or else by its number; `None` if the system has no groups.
#[cfg(unix)]
pub fn group(device: &Path) -> Option<String> {
    use std::os::unix::fs::MetadataExt;

    let number = std::fs::metadata(device).ok()?.gid().to_string();
    let groups = std::fs::read_to_string("/etc/group").unwrap_or_default();
    let name = groups.lines().find_map(|line| {
        let mut parts = line.split(':');
        let name = parts.next()?;
        (parts.nth(1) == Some(&number)).then(|| name.to_owned())
    });
    Some(name.unwrap_or(number))
}

/// The group that a device belongs to; this system has no such groups.
#[cfg(not(unix))]
pub fn group(device: &Path) -> Option<String> {
    let _ = device;
    None
}

/// Returns true if the file is there, and is something else than a device: a serial port cannot be an ordinary file.
#[cfg(unix)]
pub fn is_no_device(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;

    std::fs::metadata(path).is_ok_and(|file| !file.file_type().is_char_device())
}

/// Returns false: this system's ports are no files.
#[cfg(not(unix))]
pub fn is_no_device(path: &Path) -> bool {
    let _ = path;
    false
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_device_that_this_program_has_open_is_in_use_by_it() {
        let (_far, near) = tickbus_base::os::PseudoTerminal::open().expect("a pseudo-terminal");
        let own = format!("(process {})", std::process::id());
        let is_own = |users: Vec<String>| users.iter().any(|user| user.ends_with(&own));
        let open = std::fs::File::open(&near).expect("it is there");
        assert!(is_own(users(&near)));
        assert!(group(&near).is_some());
        assert!(!is_no_device(&near));
        drop(open);
        assert!(users(Path::new("/no/such/device")).is_empty());
        assert!(is_no_device(Path::new("/proc")));
    }
}
