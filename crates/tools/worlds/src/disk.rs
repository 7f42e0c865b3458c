//! The disk of a simulated world: real files in a folder, with as much room as the world gives them.
//!
//! The worlds of a thread use one folder in turn, under the same path. Two worlds with the same driver.cfg therefore
//! have the same text, which is parsed once.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write as _};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

/// The folder for files in memory, on systems that have it.
const IN_MEMORY: &str = "/dev/shm";

thread_local! {
    /// The folder of this thread's worlds; empty between two worlds.
    static FOLDER: RefCell<Option<TempDir>> = const { RefCell::new(None) };
}

fn new_folder() -> TempDir {
    let in_memory = tempfile::tempdir_in(IN_MEMORY);
    in_memory.unwrap_or_else(|_| tempfile::tempdir().expect("a temporary folder"))
}

/// The disk of a world.
#[derive(Debug, Default)]
pub(crate) struct Disk {
    folder: Option<PathBuf>,
    /// The maximum lengths of files, by path.
    limits: BTreeMap<PathBuf, u64>,
    /// Killed processes, which write nothing more, and the times of the kills.
    killed: BTreeMap<usize, i64>,
}

impl Disk {
    /// The folder of this world's files, which are removed with the world.
    pub(crate) fn folder(&mut self) -> &Path {
        self.folder.get_or_insert_with(|| {
            FOLDER.with_borrow_mut(|folder| folder.get_or_insert_with(new_folder).path().to_owned())
        })
    }

    /// Gives up the folder: threads that never end may still use its files, so the next world gets another one.
    pub(crate) fn abandon(&mut self) {
        if self.folder.take().is_some() {
            drop(FOLDER.take());
        }
    }

    /// Limits the length of a file.
    pub(crate) fn limit(&mut self, path: PathBuf, limit: u64) {
        self.limits.insert(path, limit);
    }

    /// Kills a process: nothing that it writes from now on reaches a file.
    pub(crate) fn kill(&mut self, process: usize, now: i64) {
        self.killed.entry(process).or_insert(now);
    }

    /// Undoes the kill of a process; returns when it was killed.
    pub(crate) fn revive(&mut self, process: usize) -> Option<i64> {
        self.killed.remove(&process)
    }

    /// Writes bytes of a process to a file, as far as there is room.
    pub(crate) fn write(
        &self,
        process: usize,
        mut file: &File,
        path: &Path,
        bytes: &[u8],
    ) -> io::Result<usize> {
        if self.killed.contains_key(&process) {
            return Ok(bytes.len());
        }
        let Some(limit) = self.limits.get(path) else {
            return file.write(bytes);
        };
        let room = limit.saturating_sub(file.metadata()?.len());
        let fits = bytes.len().min(usize::try_from(room).unwrap_or(usize::MAX));
        if fits == 0 && !bytes.is_empty() {
            return Err(ErrorKind::StorageFull.into());
        }
        file.write(&bytes[..fits])
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let Some(folder) = self.folder.take() else {
            return;
        };
        let empty = || {
            for file in fs::read_dir(&folder)? {
                fs::remove_file(file?.path())?;
            }
            io::Result::Ok(())
        };
        if empty().is_err() {
            drop(FOLDER.take());
        }
    }
}
