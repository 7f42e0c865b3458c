//! The files that this process records to and replays: none of them both at once, and none recorded to twice.

use std::collections::BTreeMap;
use std::fs::{self, File, Metadata};
use std::io;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What is done with each file that is in use.
static IN_USE: Mutex<BTreeMap<Identity, Use>> = Mutex::new(BTreeMap::new());

/// What a file is, by whatever name and link it is opened: device and inode.
#[cfg(unix)]
type Identity = (u64, u64);

/// What a file is: its path without links and detours.
#[cfg(not(unix))]
type Identity = std::path::PathBuf;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Use {
    Recorded,
    /// By so many.
    Replayed(usize),
}

/// A file that a recording has to itself, or that recordings must leave alone while it is replayed.
#[derive(Debug)]
pub struct Place(Identity);

impl Place {
    /// Claims a file for a recording; gives what is done with it already, if anything is.
    ///
    /// # Errors
    ///
    /// The system does not say which file it is.
    pub(super) fn to_record(path: &Path, file: &File) -> io::Result<Result<Self, &'static str>> {
        let id = identity(path, &file.metadata()?)?;
        let mut in_use = lock();
        Ok(match in_use.get(&id) {
            Some(Use::Recorded) => Err("another driver of this process records to this file"),
            Some(Use::Replayed(_)) => {
                Err("this file is being replayed, and recording would destroy it")
            }
            None => {
                in_use.insert(id.to_owned(), Use::Recorded);
                Ok(Self(id))
            }
        })
    }

    /// Claims the file at `path` for a replay; several may replay one file.
    ///
    /// # Errors
    ///
    /// The file is not there, or is being recorded to; the text says what to do.
    pub fn to_replay(path: &Path) -> Result<Self, String> {
        let shown = path.display();
        let id = fs::metadata(path).and_then(|metadata| identity(path, &metadata));
        let id = id.map_err(|error| {
            format!(
                "{shown}: the recording cannot be read: {error}; check its name and permissions"
            )
        })?;
        let mut in_use = lock();
        match in_use.entry(id.to_owned()).or_insert(Use::Replayed(0)) {
            Use::Replayed(count) => *count += 1,
            Use::Recorded => {
                return Err(format!(
                    "{shown}: a driver of this process records to this file; close it before the file is replayed"
                ));
            }
        }
        Ok(Self(id))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut in_use = lock();
        match in_use.get_mut(&self.0) {
            Some(Use::Replayed(count)) if *count > 1 => *count -= 1,
            _ => drop(in_use.remove(&self.0)),
        }
    }
}

fn lock() -> MutexGuard<'static, BTreeMap<Identity, Use>> {
    // The map is whole between any two of its changes.
    IN_USE.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(unix)]
#[expect(
    clippy::unnecessary_wraps,
    reason = "it can fail where paths are asked for"
)]
fn identity(_path: &Path, metadata: &Metadata) -> io::Result<Identity> {
    use std::os::unix::fs::MetadataExt as _;

    Ok((metadata.dev(), metadata.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path, _metadata: &Metadata) -> io::Result<Identity> {
    path.canonicalize()
}
