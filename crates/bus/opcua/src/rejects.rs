//! The folder of rejected certificates.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The number of certificates that the folder keeps: a peer can present new ones without limit, before any login.
const KEPT: usize = 50;

/// The folder as of the last look.
#[derive(Debug)]
pub(super) struct Rejects {
    folder: PathBuf,
    known: BTreeSet<String>,
}

/// The result of a look.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Found {
    /// The files added since the last look that are kept.
    pub(super) files: Vec<String>,
    /// The number of certificates added.
    pub(super) count: usize,
}

impl Rejects {
    /// The current folder, after removing surplus certificates.
    pub(super) fn new(folder: PathBuf) -> Self {
        let mut rejects = Self {
            folder,
            known: BTreeSet::new(),
        };
        rejects.look();
        rejects
    }

    /// Looks for new certificates. Keeps the latest [`KEPT`] and deletes older ones.
    pub(super) fn look(&mut self) -> Found {
        let mut files = list(&self.folder);
        let is_new = |name: &&String| !self.known.contains(*name);
        let count = files.iter().filter(is_new).count();
        for name in files.drain(KEPT.min(files.len())..) {
            // A file that cannot be deleted is found again at the next look.
            let _ = fs::remove_file(self.folder.join(name));
        }
        let kept: BTreeSet<String> = files.into_iter().collect();
        let files = kept.difference(&self.known).cloned().collect();
        self.known = kept;
        Found { files, count }
    }
}

/// The certificates in a folder, newest first.
fn list(folder: &Path) -> Vec<String> {
    let files = fs::read_dir(folder).into_iter().flatten().flatten();
    let dated = files.filter_map(|file| {
        let name = file.file_name().into_string().ok()?;
        let is_certificate = Path::new(&name).extension()? == "der";
        let time = file.metadata().and_then(|data| data.modified()).ok();
        is_certificate.then_some((time, name))
    });
    let mut dated: Vec<_> = dated.collect();
    dated.sort_by(|one, other| other.cmp(one));
    dated.into_iter().map(|(_, name)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, UNIX_EPOCH};

    #[test]
    fn the_newest_fifty_certificates_are_kept_and_all_are_counted() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = |number: u64| {
            let file = folder.path().join(format!("{number}.der"));
            let file = fs::File::create(file).expect("a file");
            let time = UNIX_EPOCH + Duration::from_secs(number);
            file.set_modified(time).expect("a time");
        };
        fs::write(folder.path().join("note.txt"), "not a certificate").expect("a file");
        store(1);
        let mut rejects = Rejects::new(folder.path().to_owned());
        assert_eq!(rejects.look(), Found::default(), "it was there before");
        (2..=2000).for_each(store);
        let found = rejects.look();
        assert_eq!((found.count, found.files.len()), (1999, KEPT));
        assert!(found.files.contains(&"2000.der".to_owned()));
        assert!(found.files.contains(&"1951.der".to_owned()));
        assert_eq!(rejects.look(), Found::default());
        let left = fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(left, KEPT + 1, "and the note");
    }
}
