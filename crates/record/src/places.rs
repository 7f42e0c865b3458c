//! The files that this process records to or replays: none is used for both at once, and none is recorded to
//! twice.

use std::collections::BTreeMap;
use std::fs::{self, File, Metadata};
use std::io;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::RecordingError;

/// How each file in use is used.
static IN_USE: Mutex<BTreeMap<Identity, Use>> = Mutex::new(BTreeMap::new());

/// Identifies a file under any name or link: device and inode.
#[cfg(unix)]
type Identity = (u64, u64);

/// Identifies a file: its path without links and `..`.
#[cfg(not(unix))]
type Identity = std::path::PathBuf;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Use {
    Recorded,
    /// The number of replays.
    Replayed(usize),
}

/// A claim on a file: exclusive for a recording, shared among replays.
#[derive(Debug)]
pub struct FileClaim(Identity);

impl FileClaim {
    /// Claims a file for a recording; if it is in use already, gives how.
    ///
    /// # Errors
    ///
    /// The system cannot identify the file.
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

    /// Claims the file at `path` for a replay; several replays may share a file.
    ///
    /// # Errors
    ///
    /// The file does not exist, or is being recorded to.
    pub fn to_replay(path: &Path) -> Result<Self, RecordingError> {
        let id = fs::metadata(path).and_then(|metadata| identity(path, &metadata));
        let id = id.map_err(|error| {
            RecordingError::of_file(
                path,
                format!("the recording cannot be read: {error}"),
                "check its name and permissions",
            )
        })?;
        let mut in_use = lock();
        match in_use.entry(id.to_owned()).or_insert(Use::Replayed(0)) {
            Use::Replayed(count) => *count += 1,
            Use::Recorded => {
                return Err(RecordingError::of_file(
                    path,
                    "a driver of this process records to this file",
                    "close it before the file is replayed",
                ));
            }
        }
        Ok(Self(id))
    }
}

impl Drop for FileClaim {
    fn drop(&mut self) {
        let mut in_use = lock();
        match in_use.get_mut(&self.0) {
            Some(Use::Replayed(count)) if *count > 1 => *count -= 1,
            _ => drop(in_use.remove(&self.0)),
        }
    }
}

fn lock() -> MutexGuard<'static, BTreeMap<Identity, Use>> {
    // The map is consistent after every single change, so a poisoned lock is safe to use.
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
