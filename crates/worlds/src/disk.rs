//! The disk of a simulated world: real files in a folder of the world's own, with as much room as the world gives them.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, ErrorKind, Write as _};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

/// The disk of a world.
#[derive(Debug, Default)]
pub(crate) struct Disk {
    folder: Option<TempDir>,
    /// How long files may become, by their paths.
    limits: BTreeMap<PathBuf, u64>,
    /// Processes that write no more, and since when.
    killed: BTreeMap<usize, i64>,
}

impl Disk {
    /// Where the files of this world are; removed with it.
    pub(crate) fn folder(&mut self) -> &Path {
        self.folder
            .get_or_insert_with(|| tempfile::tempdir().expect("a temporary folder"))
            .path()
    }

    /// A file may become this long.
    pub(crate) fn limit(&mut self, path: PathBuf, limit: u64) {
        self.limits.insert(path, limit);
    }

    /// Nothing that a process writes from now on reaches a file.
    pub(crate) fn kill(&mut self, process: usize, now: i64) {
        self.killed.entry(process).or_insert(now);
    }

    /// Takes back that a process was killed; returns when it was.
    pub(crate) fn revive(&mut self, process: usize) -> Option<i64> {
        self.killed.remove(&process)
    }

    /// A process writes to a file.
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
