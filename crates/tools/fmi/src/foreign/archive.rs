//! The archive of an FMU, unpacked to a folder that is deleted when it is no longer needed.
//!
//! The contents are checked before a byte is written: no file leaves the folder, no file is a link, and the total size
//! is limited.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::{Component, Path, PathBuf};

use tempfile::TempDir;
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Mistakes, shown};
use zip::ZipArchive;
use zip::read::ZipFile;

use super::model::Model;
use crate::made::Platform;
use crate::value::Version;

/// The most bytes that an unpacked FMU can have.
const MOST_BYTES: u64 = 1 << 30;

/// The most bytes of a model description.
const MOST_DESCRIPTION: u64 = 64 << 20;

/// The most files in an FMU.
const MOST_FILES: usize = 20_000;

/// The name of the model description.
const DESCRIPTION: &str = "modelDescription.xml";

/// A checked FMU with the library for this platform.
#[derive(Debug)]
pub struct Unpacked {
    /// The FMU's path, as messages name it.
    pub file: String,
    /// The contents of the model description.
    pub model: Model,
    folder: TempDir,
    library: PathBuf,
}

impl Unpacked {
    /// Opens the FMU at `path`: reads its model description and unpacks the files needed to run it.
    ///
    /// # Errors
    ///
    /// Returns the problem with the archive, every mistake in the model description with its line and column, or that
    /// the FMU is not for this platform.
    pub fn open(path: &Path) -> Result<Self, Mistakes> {
        let file = path.display().to_string();
        let refused = |mistake: Mistake| Mistakes::of(&file, mistake);
        let mut archive = open(path).map_err(refused)?;
        check_twins(path, &archive).map_err(refused)?;
        let entries = check(&mut archive).map_err(refused)?;
        let text = description(&mut archive, &entries).map_err(refused)?;
        let model = Model::parse(&format!("{file}/{DESCRIPTION}"), &text)?;
        let library = library(&entries, &model).map_err(refused)?;
        let folder = tempfile::Builder::new().prefix("tickbus-fmu-").tempdir();
        let folder = folder.map_err(|error| {
            refused(Mistake::new(
                format!("it cannot be unpacked: {error}"),
                "make room in the folder for temporary files, which TMPDIR names",
            ))
        })?;
        unpack(&mut archive, &entries, folder.path()).map_err(refused)?;
        let library = folder.path().join(library);
        Ok(Self {
            file,
            model,
            folder,
            library,
        })
    }

    /// Returns the folder with the unpacked files, which is deleted when this is dropped.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Returns the library that contains the FMU's functions.
    pub fn library(&self) -> &Path {
        &self.library
    }

    /// Returns the folder of the FMU's resources, which may be empty.
    pub fn resources(&self) -> PathBuf {
        self.folder.path().join("resources")
    }
}

fn damaged(error: impl std::fmt::Display) -> Mistake {
    Mistake::new(
        format!("this is no whole archive: {error}"),
        "get the FMU anew; it may be cut",
    )
}

fn open(path: &Path) -> Result<ZipArchive<File>, Mistake> {
    let file = File::open(path).map_err(|error| {
        let what = format!("it cannot be opened: {error}");
        Mistake::new(what, "name an FMU, a file ending in .fmu")
    })?;
    ZipArchive::new(file).map_err(damaged)
}

/// Marks the beginning of a file's entry in the directory of an archive.
const ENTRY: &[u8] = b"PK\x01\x02";

/// The files and folders that a run depends on.
const VITAL: [&str; 3] = [DESCRIPTION, "binaries", "resources"];

/// Refuses an archive with two files of the same name: `zip` shows only the last of them, other programs the first.
/// Some tools pack the same file twice, which is harmless if a run does not depend on it.
fn check_twins(path: &Path, archive: &ZipArchive<File>) -> Result<(), Mistake> {
    let mut files = BTreeMap::new();
    for (name, content) in listed(path, archive.central_directory_start()).map_err(damaged)? {
        let text = String::from_utf8_lossy(&name).into_owned();
        let top = plain(&text);
        let is_vital = VITAL.contains(&top.split('/').next().unwrap_or_default());
        if files
            .insert(name, content)
            .is_some_and(|other| is_vital || other != content)
        {
            return Err(hostile(format!("it has \"{}\" twice", shown(&text))));
        }
    }
    if files.len() == archive.len() {
        return Ok(());
    }
    let what = format!(
        "its directory has {} names, of which {} differ when they are read",
        files.len(),
        archive.len()
    );
    Err(hostile(what))
}

/// Returns the entries in the directory of an archive, which begins at `start`: for each its name, and a fingerprint of
/// its content, which is checksum and lengths.
fn listed(path: &Path, start: u64) -> io::Result<Vec<(Vec<u8>, [u8; 12])>> {
    let mut directory = BufReader::new(File::open(path)?);
    directory.seek(SeekFrom::Start(start))?;
    let mut all = Vec::new();
    loop {
        let mut entry = [0; 46];
        match directory.read_exact(&mut entry) {
            Ok(()) if entry.starts_with(ENTRY) => {}
            // After the last entry.
            Ok(()) => return Ok(all),
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(all),
            Err(error) => return Err(error),
        }
        // The lengths of the name, the extra field and the comment.
        let [name, beside, comment] =
            [28, 30, 32].map(|at| u16::from_le_bytes([entry[at], entry[at + 1]]));
        let mut own = vec![0; name.into()];
        directory.read_exact(&mut own)?;
        directory.seek_relative(i64::from(beside) + i64::from(comment))?;
        // The CRC-32, the packed length and the unpacked length.
        all.push((own, *entry[16..].first_chunk().expect("46 bytes")));
    }
}

fn hostile(what: String) -> Mistake {
    Mistake::new(what, "do not use this FMU; ask whoever made it")
}

/// The entries of an archive: each name with its index.
type Entries = BTreeMap<String, usize>;

/// Refuses a harmful archive.
fn check(archive: &mut ZipArchive<File>) -> Result<Entries, Mistake> {
    if archive.len() > MOST_FILES {
        return Err(hostile(format!(
            "it has {} files, and the most is {MOST_FILES}",
            archive.len()
        )));
    }
    let mut bytes = 0_u64;
    let mut entries = Entries::new();
    for index in 0..archive.len() {
        let entry = archive.by_index_raw(index).map_err(damaged)?;
        if !is_inside(entry.name()) {
            return Err(hostile(format!(
                "\"{}\" would be unpacked outside of its folder",
                shown(entry.name())
            )));
        }
        if entry.is_symlink() {
            return Err(hostile(format!("\"{}\" is a link", shown(entry.name()))));
        }
        bytes = bytes.saturating_add(entry.size());
        let name = plain(entry.name());
        if !entry.is_dir() && entries.insert(name.clone(), index).is_some() {
            return Err(hostile(format!("it has \"{}\" twice", shown(&name))));
        }
    }
    if bytes > MOST_BYTES {
        return Err(hostile(format!(
            "it has {} MB when it is unpacked, and the most is {} MB",
            bytes >> 20,
            MOST_BYTES >> 20
        )));
    }
    Ok(entries)
}

/// Removes from a name inside the folder the "." that some programs add.
fn plain(name: &str) -> String {
    let parts = name.split('/').filter(|part| !matches!(*part, "" | "."));
    parts.collect::<Vec<_>>().join("/")
}

/// Returns true if a name stays inside the folder on every system.
fn is_inside(name: &str) -> bool {
    let parts = Path::new(name).components();
    let plain = |part| matches!(part, Component::Normal(_) | Component::CurDir);
    // "C:" is a drive on Windows, where a backslash is a separator as well.
    !name.is_empty() && !name.contains(['\\', ':', '\0']) && parts.into_iter().all(plain)
}

fn description(archive: &mut ZipArchive<File>, entries: &Entries) -> Result<String, Mistake> {
    let index = entries.get(DESCRIPTION).ok_or_else(|| {
        Mistake::new(
            format!("there is no {DESCRIPTION} at the top of the archive"),
            "name an FMU; if it was packed by hand, pack its contents and not its folder",
        )
    })?;
    let entry = archive.by_index(*index).map_err(damaged)?;
    let mut bytes = Vec::new();
    let read = entry.take(MOST_DESCRIPTION + 1).read_to_end(&mut bytes);
    read.map_err(damaged)?;
    if bytes.len() as u64 > MOST_DESCRIPTION {
        return Err(Mistake::new(
            format!("{DESCRIPTION} is larger than {} MB", MOST_DESCRIPTION >> 20),
            "export an FMU with fewer variables",
        ));
    }
    String::from_utf8(bytes).map_err(|error| {
        Mistake::new(
            format!("{DESCRIPTION} is not UTF-8: {error}"),
            "save it as UTF-8, as the standard says",
        )
    })
}

/// Returns the path of the library for this platform.
fn library(entries: &Entries, model: &Model) -> Result<PathBuf, Mistake> {
    let own = Platform::own();
    let folder = own.and_then(|own| own.folder(model.version));
    let ending = own.map_or("so", |own| own.ending);
    if let Some(folder) = folder {
        let name = format!("binaries/{folder}/{}.{ending}", model.identifier);
        if entries.contains_key(&name) {
            return Ok(name.into());
        }
    }
    let of_libraries = |name: &'_ String| {
        let (folder, _) = name.strip_prefix("binaries/")?.split_once('/')?;
        Some(folder.to_owned())
    };
    let mut there: Vec<String> = entries.keys().filter_map(of_libraries).collect();
    there.dedup();
    let wanted = folder.unwrap_or("this platform, which FMI 2.0 has no name for");
    let has_sources = entries.keys().any(|name| name.starts_with("sources/"));
    let what = match &there[..] {
        [] if has_sources => format!("it has sources, and no library for {wanted}"),
        [] => format!("it has no library at all, and needs one for {wanted}"),
        all if folder.is_some_and(|folder| all.iter().any(|one| one == folder)) => {
            format!("it has no binaries/{wanted}/{}.{ending}", model.identifier)
        }
        all => format!(
            "it has libraries for {}, and none for {wanted}",
            all.join(", ")
        ),
    };
    let right = match model.version {
        Version::Two | Version::Three if has_sources => {
            "compile it (fmpy compile), or export it with a library for this platform"
        }
        _ => "export it for this platform, or run it where it is for",
    };
    Err(Mistake::new(what, right))
}

/// Unpacks everything except documentation and sources. By the standards an FMU is only given its resources, but some
/// FMUs find their model description from there. The sizes stated in the archive were checked before; the real sizes
/// are checked here.
fn unpack(archive: &mut ZipArchive<File>, entries: &Entries, folder: &Path) -> Result<(), Mistake> {
    let mut room = MOST_BYTES;
    let unwritable = |name: &str, error: &io::Error| {
        Mistake::new(
            format!("\"{}\" cannot be unpacked: {error}", shown(name)),
            "make room in the folder for temporary files, which TMPDIR names; or get the FMU anew, it may be cut",
        )
    };
    // Some FMUs start their search in this folder, even if they have no resources.
    let resources = folder.join("resources");
    fs::create_dir_all(&resources).map_err(|error| unwritable("resources", &error))?;
    let idle = |name: &str| name.starts_with("documentation/") || name.starts_with("sources/");
    for (name, index) in entries.iter().filter(|(name, _)| !idle(name)) {
        let mut entry = archive.by_index(*index).map_err(damaged)?;
        let to = folder.join(name);
        let written = write(&mut entry, &to, room).map_err(|error| unwritable(name, &error))?;
        room -= written;
    }
    Ok(())
}

fn write(entry: &mut ZipFile<'_, File>, to: &Path, room: u64) -> io::Result<u64> {
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder)?;
    }
    let mut file = File::create_new(to)?;
    let written = io::copy(&mut entry.take(room + 1), &mut file)?;
    if written > room {
        return Err(io::Error::other("it is larger than the archive says"));
    }
    Ok(written)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_leave_the_folder_are_told_apart() {
        for (name, inside) in [
            ("modelDescription.xml", true),
            ("resources/./a", true),
            ("resources/a b/ä.txt", true),
            ("/etc/passwd", false),
            ("../x", false),
            ("resources/../../x", false),
            ("C:/x", false),
            ("resources\\..\\x", false),
            ("", false),
        ] {
            assert_eq!(is_inside(name), inside, "{name}");
        }
    }
}
