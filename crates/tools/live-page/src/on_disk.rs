//! A text file on the disk: read, written as a whole, and watched for changes by others.

use std::fs::{self, File, Metadata};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use tickbus_base::toml_text::load_text;

/// A text file on the disk.
#[derive(Debug)]
pub struct OnDisk {
    path: PathBuf,
    /// The text of the file when it was last read or written.
    known: String,
    /// The system's data about the file at that time.
    seen: Option<Metadata>,
}

/// Why a text was not written.
#[derive(Debug)]
pub enum Unwritten {
    /// Another program has changed the file; this is its text.
    Changed(String),
    /// The system refused it, for this reason.
    Refused(String),
}

impl OnDisk {
    /// Reads the file; without one, the text is empty and the file is made by the first edit.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is no text.
    pub fn open(path: &Path) -> Result<Self, String> {
        // A link stays, and what it names is written.
        let path = match fs::canonicalize(path) {
            Ok(path) => path,
            Err(_) if path.is_symlink() => {
                let (path, what) = (path.display(), "this link names no file");
                return Err(format!("{path}: {what}; remove it, or make the file"));
            }
            Err(_) => path.to_owned(),
        };
        let known = if path.exists() {
            load_text(&path).map_err(|mistakes| mistakes.to_string())?
        } else {
            String::new()
        };
        let seen = fs::metadata(&path).ok();
        Ok(Self { path, known, seen })
    }

    /// The file that is written.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The text of the file, as far as is known.
    pub fn text(&self) -> &str {
        &self.known
    }

    /// True if the file existed before, and does not exist now.
    pub fn is_missing(&self) -> bool {
        self.seen.is_some() && !self.path.exists()
    }

    /// The new text if another program has changed the file; it is then known. A file that cannot be read at the moment
    /// counts as unchanged, because editors replace files in two steps.
    pub fn look(&mut self) -> Option<String> {
        let now = fs::metadata(&self.path).ok();
        let stamp = |file: &Metadata| (file.modified().ok(), file.len());
        if now.as_ref().map(stamp) == self.seen.as_ref().map(stamp) {
            return None;
        }
        self.read().ok().flatten()
    }

    /// Returns the text if it is not the known one.
    fn read(&mut self) -> Result<Option<String>, String> {
        let now = fs::metadata(&self.path).ok();
        let text = load_text(&self.path).map_err(|mistakes| mistakes.to_string())?;
        self.seen = now;
        if text == self.known {
            return Ok(None);
        }
        self.known.clone_from(&text);
        Ok(Some(text))
    }

    /// Replaces the text of the file, unless another program has changed it.
    ///
    /// # Errors
    ///
    /// The file has another text by now, or the system refused to write it; it is then as it was.
    pub fn write(&mut self, text: &str) -> Result<(), Unwritten> {
        // Two changes can have the same file time: only the text tells them apart.
        match self.read() {
            Ok(Some(theirs)) => return Err(Unwritten::Changed(theirs)),
            // Others may have changed what cannot be read, such as a text in another encoding.
            Err(why) if self.path.exists() => return Err(Unwritten::Refused(why)),
            Ok(None) | Err(_) => {}
        }
        self.replace(text)
            .map_err(|error| Unwritten::Refused(error.to_string()))?;
        text.clone_into(&mut self.known);
        self.seen = fs::metadata(&self.path).ok();
        Ok(())
    }

    /// Writes a new file and puts it into the place of the old one, so that no moment has half of the text.
    fn replace(&self, text: &str) -> io::Result<()> {
        let present = fs::metadata(&self.path).map(|file| file.permissions());
        if present.as_ref().is_ok_and(fs::Permissions::readonly) {
            let why = "the file is read-only; allow writing, or save it elsewhere";
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, why));
        }
        let folder = self.path.parent().filter(|it| !it.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        let mut next = tempfile::Builder::new();
        next.prefix(".tickbus-").suffix(".part");
        let next = next
            .tempfile_in(folder)
            .map_err(|error| without_name(&error, folder))?;
        next.as_file().write_all(text.as_bytes())?;
        match present {
            Ok(permissions) => next.as_file().set_permissions(permissions)?,
            Err(_) => usual_permissions(next.as_file())?,
        }
        next.as_file().sync_all()?;
        next.persist(&self.path).map_err(|error| error.error)?;
        Ok(())
    }
}

/// The kind of error alone: the whole one has the random name of the new file, which is another at each try.
fn without_name(error: &io::Error, folder: &Path) -> io::Error {
    let (kind, folder) = (error.kind(), folder.display());
    let why = format!("no new file can be made in {folder}, to take its place: {kind}");
    io::Error::new(kind, why)
}

/// Lets others read a new file: a temporary file is its owner's alone.
#[cfg(unix)]
fn usual_permissions(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt as _;
    file.set_permissions(fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
#[expect(clippy::unnecessary_wraps, reason = "as on Unix")]
fn usual_permissions(_: &File) -> io::Result<()> {
    Ok(())
}
