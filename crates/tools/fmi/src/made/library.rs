//! The native libraries that are packed into an FMU, one for each platform.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::io::Read as _;
use std::path::{Path, PathBuf};

use tickbus_base::Mistake;
use zip::ZipArchive;

use crate::value::Version;

/// The name of a function that an FMU's library must have and that libraries of earlier versions do not. In two parts,
/// so that programs searching for the name do not contain it themselves.
const FUNCTION: [&str; 2] = ["fmi3Activate", "ModelPartition"];

/// The folder with the libraries in a jar.
const IN_JAR: &str = "tickbus/native/";

/// An operating system with a processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Platform {
    /// The platform's name in FMI 3.0.
    pub tuple: &'static str,
    /// The platform's name in FMI 2.0, if it has one.
    pub two: Option<&'static str>,
    /// The file name extension of libraries.
    pub ending: &'static str,
}

/// The supported platforms.
const PLATFORMS: [Platform; 6] = [
    platform("x86_64-linux", Some("linux64"), "so"),
    platform("aarch64-linux", None, "so"),
    platform("x86_64-windows", Some("win64"), "dll"),
    platform("aarch64-windows", None, "dll"),
    platform("x86_64-darwin", Some("darwin64"), "dylib"),
    platform("aarch64-darwin", None, "dylib"),
];

const fn platform(
    tuple: &'static str,
    two: Option<&'static str>,
    ending: &'static str,
) -> Platform {
    Platform { tuple, two, ending }
}

impl Platform {
    /// Returns the platform of a library, found in the library's own header.
    pub fn of(library: &[u8]) -> Option<Self> {
        let word = |at: usize| {
            let bytes = library.get(at..at + 2)?;
            Some(u16::from_le_bytes([bytes[0], bytes[1]]))
        };
        let tuple = if library.starts_with(b"\x7fELF") {
            match word(18)? {
                62 => "x86_64-linux",
                183 => "aarch64-linux",
                _ => return None,
            }
        } else if library.starts_with(b"MZ") {
            let head = usize::from(word(60)?);
            match word(head + 4)? {
                0x8664 => "x86_64-windows",
                0xAA64 => "aarch64-windows",
                _ => return None,
            }
        } else if library.starts_with(&[0xCF, 0xFA, 0xED, 0xFE]) {
            match word(4)? {
                7 => "x86_64-darwin",
                12 => "aarch64-darwin",
                _ => return None,
            }
        } else {
            return None;
        };
        PLATFORMS.into_iter().find(|one| one.tuple == tuple)
    }

    /// Returns the platform that this program was built for.
    pub fn own() -> Option<Self> {
        let system = match std::env::consts::OS {
            "macos" => "darwin",
            other => other,
        };
        let tuple = format!("{}-{system}", std::env::consts::ARCH);
        PLATFORMS.into_iter().find(|one| one.tuple == tuple)
    }

    /// Returns the platform's folder in an FMU of this version.
    pub const fn folder(self, version: Version) -> Option<&'static str> {
        match version {
            Version::Two => self.two,
            Version::Three => Some(self.tuple),
        }
    }
}

/// A native library of tickbus for one platform.
#[derive(Clone, Debug)]
pub struct NativeLibrary {
    /// The platform that the library runs on.
    pub platform: Platform,
    /// The library's bytes.
    pub bytes: Vec<u8>,
    /// The library's source, for people.
    pub origin: String,
}

impl NativeLibrary {
    fn of(bytes: Vec<u8>, origin: String) -> Result<Self, Mistake> {
        let right = "name the libtickbus.so, tickbus.dll or libtickbus.dylib of this version";
        let Some(platform) = Platform::of(&bytes) else {
            return Err(Mistake::new(
                format!("{origin} is no library for Linux, Windows or macOS on x86-64 or arm64"),
                right,
            ));
        };
        let function = FUNCTION.concat();
        let mut names = bytes.windows(function.len());
        if !names.any(|name| name == function.as_bytes()) {
            return Err(Mistake::new(
                format!("{origin} has no functions of FMI"),
                right,
            ));
        }
        Ok(Self {
            platform,
            bytes,
            origin,
        })
    }
}

/// Finds the libraries for an FMU: those in `named`; if there are none, the library in the folder `beside` the command,
/// or all libraries in a jar there.
///
/// # Errors
///
/// No library was found: returns every place searched, and what to do.
pub fn find_libraries(
    named: &[PathBuf],
    beside: Option<&Path>,
) -> Result<Vec<NativeLibrary>, Mistake> {
    let mut found: Vec<NativeLibrary> = Vec::new();
    for file in named {
        let library = read(file)?;
        if let Some(twin) = found
            .iter()
            .find(|other| other.platform == library.platform)
        {
            return Err(Mistake::new(
                format!(
                    "{} and {} are both for {}",
                    twin.origin, library.origin, library.platform.tuple
                ),
                "name one --library for each platform",
            ));
        }
        found.push(library);
    }
    if !found.is_empty() {
        return Ok(found);
    }
    let mut tried = Vec::new();
    if let Some(folder) = beside {
        let file = folder.join(format!("{DLL_PREFIX}tickbus{DLL_SUFFIX}"));
        if file.is_file() {
            return Ok(vec![read(&file)?]);
        }
        tried.push(format!("no {}", file.display()));
        for jar in jars(folder) {
            let found = in_jar(&jar)?;
            if !found.is_empty() {
                return Ok(found);
            }
            tried.push(format!("none in {}", jar.display()));
        }
    }
    Err(Mistake::new(
        format!(
            "the native library that goes into the FMU was not found beside this command: {}",
            tried.join(", ")
        ),
        "name it: --library libtickbus.so",
    ))
}

fn read(file: &Path) -> Result<NativeLibrary, Mistake> {
    let origin = file.display().to_string();
    let bytes = std::fs::read(file).map_err(|error| {
        Mistake::new(
            format!("{origin} cannot be read: {error}"),
            "name the native library of tickbus",
        )
    })?;
    NativeLibrary::of(bytes, origin)
}

/// Returns the jars in a folder, sorted by name.
fn jars(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let files = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let mut jars: Vec<PathBuf> = files
        .filter(|path| path.extension().is_some_and(|ending| ending == "jar"))
        .collect();
    jars.sort();
    jars
}

/// Returns the libraries in a jar, which need not be a jar of tickbus.
fn in_jar(jar: &Path) -> Result<Vec<NativeLibrary>, Mistake> {
    let unreadable = |error: String| {
        Mistake::new(
            format!("{} cannot be read: {error}", jar.display()),
            "name the native library: --library libtickbus.so",
        )
    };
    let file = std::fs::File::open(jar).map_err(|error| unreadable(error.to_string()))?;
    let mut archive = ZipArchive::new(file).map_err(|error| unreadable(error.to_string()))?;
    let names: Vec<String> = archive.file_names().map(str::to_owned).collect();
    let mut found = Vec::new();
    for name in names {
        if !name.starts_with(IN_JAR) || name.ends_with('/') {
            continue;
        }
        let mut bytes = Vec::new();
        let entry = archive.by_name(&name);
        let mut entry = entry.map_err(|error| unreadable(error.to_string()))?;
        entry
            .read_to_end(&mut bytes)
            .map_err(|error| unreadable(error.to_string()))?;
        let origin = format!("{} in {}", name, jar.display());
        found.push(NativeLibrary::of(bytes, origin)?);
    }
    found.sort_by_key(|library| library.platform);
    Ok(found)
}

#[cfg(test)]
mod tests {
    use std::fs::{self, File};
    use std::io::Write as _;

    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    use super::*;

    /// Builds the header of an ELF library for this processor, with the name of an FMI function.
    fn elf(machine: u8, function: &str) -> Vec<u8> {
        let mut bytes = b"\x7fELF\x02\x01\x01".to_vec();
        bytes.resize(18, 0);
        bytes.extend([machine, 0]);
        bytes.extend(function.as_bytes());
        bytes
    }

    fn jar(path: &Path, entries: &[(&str, &[u8])]) {
        let mut zip = ZipWriter::new(File::create(path).expect("a file"));
        for (name, bytes) in entries {
            let options = SimpleFileOptions::default();
            zip.start_file(*name, options).expect("a name");
            zip.write_all(bytes).expect("room");
        }
        zip.finish().expect("room");
    }

    /// Returns the libraries found in a folder: their platforms and their sources.
    fn found(folder: &Path) -> Result<Vec<(&'static str, String)>, String> {
        let found = find_libraries(&[], Some(folder)).map_err(|mistake| mistake.to_string())?;
        let place = format!("{}{}", folder.display(), std::path::MAIN_SEPARATOR);
        let tell = |one: NativeLibrary| (one.platform.tuple, one.origin.replace(&place, ""));
        Ok(found.into_iter().map(tell).collect())
    }

    #[test]
    fn the_libraries_are_those_in_a_jar_where_none_is_beside_the_command() {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        let file = format!("{DLL_PREFIX}tickbus{DLL_SUFFIX}");
        let why = found(folder).expect_err("there is nothing");
        let missing = format!("no {}", folder.join(&file).display());
        assert!(why.contains(&missing) && why.contains("--library"), "{why}");

        // A foreign jar comes first, and contains no library.
        jar(&folder.join("another.jar"), &[("x/Y.class", b"class")]);
        let why = found(folder).expect_err("there is still nothing");
        assert!(
            why.contains("none in ") && why.contains("another.jar"),
            "{why}"
        );

        let name = FUNCTION.concat();
        let (x86, arm) = (elf(62, &name), elf(183, &name));
        jar(
            &folder.join("tickbus-0.1.0.jar"),
            &[
                ("tickbus/Tickbus.class", b"class"),
                ("tickbus/native/linux-x86_64/libtickbus.so", &x86),
                ("tickbus/native/linux-aarch64/libtickbus.so", &arm),
            ],
        );
        assert_eq!(
            found(folder).expect("two libraries"),
            [
                (
                    "aarch64-linux",
                    "tickbus/native/linux-aarch64/libtickbus.so in tickbus-0.1.0.jar".to_owned()
                ),
                (
                    "x86_64-linux",
                    "tickbus/native/linux-x86_64/libtickbus.so in tickbus-0.1.0.jar".to_owned()
                ),
            ]
        );

        // The library next to the command is the one of this build.
        fs::write(folder.join(&file), &arm).expect("a file");
        assert_eq!(
            found(folder).expect("one library"),
            [("aarch64-linux", file)]
        );
    }

    #[test]
    fn a_jar_of_an_earlier_version_or_a_cut_one_says_so() {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        let old = elf(62, "tb_open");
        let file = folder.join("tickbus.jar");
        jar(
            &file,
            &[("tickbus/native/linux-x86_64/libtickbus.so", &old)],
        );
        let why = found(folder).expect_err("it cannot be used");
        assert!(why.contains("has no functions of FMI"), "{why}");
        let whole = fs::read(&file).expect("a file");
        fs::write(&file, &whole[..whole.len() / 2]).expect("a file");
        let why = found(folder).expect_err("it cannot be read");
        assert!(why.contains("tickbus.jar cannot be read: "), "{why}");
    }
}
