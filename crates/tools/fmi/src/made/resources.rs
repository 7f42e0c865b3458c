//! The folder of an unpacked FMU's resources, and the token that links the model description to its driver.cfg.

use std::hash::Hasher as _;
use std::path::{Path, PathBuf};

use siphasher::sip128::{Hasher128 as _, SipHasher13};

/// Returns the token of an FMU with this driver.cfg. If the driver.cfg is changed after the export, the token no longer
/// matches the model description, which reveals the change.
pub fn token(driver_cfg: &[u8]) -> String {
    let mut hasher = SipHasher13::new();
    hasher.write(env!("CARGO_PKG_VERSION").as_bytes());
    hasher.write(driver_cfg);
    let hash = hasher.finish128().as_u128();
    format!(
        "{{{:08x}-{:04x}-{:04x}-{:04x}-{:012x}}}",
        hash >> 96,
        hash >> 80 & 0xFFFF,
        hash >> 64 & 0xFFFF,
        hash >> 48 & 0xFFFF,
        hash & 0xFFFF_FFFF_FFFF
    )
}

/// Returns the folder that contains the driver.cfg: the folder named by the importing tool, or the one in the library's
/// own FMU.
pub fn folder_of(named: Option<&Path>, library: Option<&Path>) -> Option<PathBuf> {
    // FMU/binaries/PLATFORM/library
    let own = library.and_then(|file| file.ancestors().nth(3));
    let own = own.map(|fmu| fmu.join("resources"));
    let places = named.map(Path::to_owned).into_iter().chain(own);
    let mut first = None;
    for place in places {
        if place.join("driver.cfg").is_file() {
            return Some(place);
        }
        first.get_or_insert(place);
    }
    first
}

/// Returns the folder that a URI of FMI 2.0 names: `file:///a%20b`, `file:/a`, `file://localhost/a`. A plain path,
/// which some tools pass, is accepted, too.
pub fn folder_of_uri(uri: &str) -> PathBuf {
    let Some(rest) = uri.strip_prefix("file:") else {
        return uri.into();
    };
    let path = match rest.strip_prefix("//") {
        Some(rest) => rest.find('/').map_or(rest, |at| &rest[at..]),
        None => rest,
    };
    let path = decoded(path);
    // file:///C:/a
    let drive = path.as_bytes();
    if drive.first() == Some(&b'/') && drive.get(2) == Some(&b':') {
        return path[1..].into();
    }
    path.into()
}

/// Decodes a text with escapes such as `%20`.
fn decoded(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let digits = after
            .get(..2)
            .and_then(|digits| std::str::from_utf8(digits).ok());
        let byte = digits.and_then(|digits| u8::from_str_radix(digits, 16).ok());
        if let Some(byte) = byte.filter(|_| first == b'%') {
            bytes.push(byte);
            rest = &after[2..];
        } else {
            bytes.push(first);
            rest = after;
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_found_in_every_form_of_uri() {
        for (uri, path) in [
            ("file:///tmp/a%20b/resources", "/tmp/a b/resources"),
            ("file:///tmp/a/resources/", "/tmp/a/resources/"),
            ("file:/tmp/a", "/tmp/a"),
            ("file://localhost/tmp/a", "/tmp/a"),
            ("file:///C:/a%5Cb", "C:/a\\b"),
            ("file:///tmp/100%25", "/tmp/100%"),
            ("file:///tmp/100%", "/tmp/100%"),
            ("file:///tmp/%C3%A4", "/tmp/ä"),
            ("/tmp/a", "/tmp/a"),
            ("", ""),
        ] {
            assert_eq!(folder_of_uri(uri), Path::new(path), "{uri}");
        }
    }

    #[test]
    fn the_library_s_own_fmu_is_the_second_choice() {
        let folder = tempfile::tempdir().expect("a folder");
        let own = folder.path().join("fmu/resources");
        std::fs::create_dir_all(&own).expect("a folder");
        let library = folder.path().join("fmu/binaries/linux64/x.so");
        let other = folder.path().join("other");
        assert_eq!(folder_of(Some(&other), Some(&library)), Some(other.clone()));
        std::fs::write(own.join("driver.cfg"), "").expect("a file");
        assert_eq!(folder_of(Some(&other), Some(&library)), Some(own.clone()));
        assert_eq!(folder_of(None, Some(&library)), Some(own));
        assert_eq!(folder_of(None, None), None);
    }

    #[test]
    fn another_driver_cfg_has_another_token() {
        let one = token(b"[driver]");
        assert_eq!(one.len(), 38, "{one}");
        assert_eq!(one, token(b"[driver]"));
        assert_ne!(one, token(b"[driver] "));
    }
}
