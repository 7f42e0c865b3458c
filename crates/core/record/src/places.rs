//! The files that are recorded to or replayed: no file is used for both at once, or recorded to twice, by this process
//! or another.

use std::collections::BTreeMap;
use std::fs::{self, File, Metadata, OpenOptions};
use std::io;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::RecordingError;
use tickbus_base::os::{Lock, lock_file, lock_holder, unlock_file};

/// The use of each file.
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
pub struct FileClaim {
    id: Identity,
    /// Holds the lock against other processes.
    file: File,
}

impl FileClaim {
    /// Opens the file at `path` to write at its end, and claims it; if it is in use already, returns how. The contents
    /// stay until [`truncate`](Self::truncate). A device is used without a claim.
    ///
    /// # Errors
    ///
    /// The system cannot open or identify the file.
    pub fn to_write(path: &Path) -> io::Result<Result<(File, Option<Self>), String>> {
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(false);
        // A writer at the end leaves no hole if another program truncates the file. On other systems it could not
        // truncate.
        let file = options.append(cfg!(unix)).open(path)?;
        let metadata = file.metadata()?;
        if !metadata.is_file() {
            return Ok(Ok((file, None)));
        }
        let id = identity(path, &metadata)?;
        let mut in_use = lock();
        let known = match in_use.get(&id) {
            Some(Use::Recorded) => Some("another driver of this process records to this file"),
            Some(Use::Replayed(_)) => {
                Some("this file is being replayed, and recording would destroy it")
            }
            None => None,
        };
        if let Some(known) = known {
            return Ok(Err(known.to_owned()));
        }
        if !is_locked(&file, Lock::Exclusive) {
            let other = process(&file);
            return Ok(Err(format!("{other} records to this file, or replays it")));
        }
        let own = file.try_clone()?;
        in_use.insert(id.to_owned(), Use::Recorded);
        Ok(Ok((file, Some(Self { id, file: own }))))
    }

    /// Claims the file at `path` for a replay; several replays may share a file.
    ///
    /// # Errors
    ///
    /// The file does not exist, or is being recorded to.
    pub fn to_replay(path: &Path) -> Result<Self, RecordingError> {
        let opened = fs::metadata(path).and_then(|metadata| {
            if !metadata.is_file() {
                // Opening a pipe would wait for a writer.
                return Err(io::Error::other("it is no file"));
            }
            Ok((identity(path, &metadata)?, File::open(path)?))
        });
        let (id, file) = opened.map_err(|error| {
            RecordingError::of_file(
                path,
                format!("the recording cannot be read: {error}"),
                "check its name and permissions",
            )
        })?;
        let recorded = |who: &str| {
            RecordingError::of_file(
                path,
                format!("{who} records to this file"),
                "close it before the file is replayed",
            )
        };
        let mut in_use = lock();
        if in_use.get(&id) == Some(&Use::Recorded) {
            return Err(recorded("a driver of this process"));
        }
        if !is_locked(&file, Lock::Shared) {
            return Err(recorded(&process(&file)));
        }
        if let Use::Replayed(count) = in_use.entry(id.to_owned()).or_insert(Use::Replayed(0)) {
            *count += 1;
        }
        Ok(Self { id, file })
    }

    /// True if the file is empty.
    pub(super) fn is_empty(&self) -> bool {
        self.file
            .metadata()
            .is_ok_and(|metadata| metadata.len() == 0)
    }

    /// Discards the contents of the file.
    ///
    /// # Errors
    ///
    /// The system refuses to truncate.
    pub fn truncate(&self) -> io::Result<()> {
        self.file.set_len(0)
    }
}

impl Drop for FileClaim {
    fn drop(&mut self) {
        let mut in_use = lock();
        match in_use.get_mut(&self.id) {
            Some(Use::Replayed(count)) if *count > 1 => *count -= 1,
            _ => drop(in_use.remove(&self.id)),
        }
        // A child of this process may have inherited the open file.
        unlock_file(&self.file);
    }
}

/// Locks a file against other processes; true if nobody else has locked it, or if the file system has no locks.
fn is_locked(file: &File, lock: Lock) -> bool {
    lock_file(file, lock).unwrap_or(true)
}

/// The process that has locked this file, in words.
fn process(file: &File) -> String {
    match lock_holder(file) {
        Some(id) => format!("process {id}"),
        None => "another process".to_owned(),
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
