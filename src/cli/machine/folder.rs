//! A built-in machine in a folder of its own for as long as the command runs.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::shelf::BuiltIn;

/// The number of names that are tried.
const ATTEMPTS: u32 = 1000;

/// The exit code after Ctrl-C.
const INTERRUPTED: i32 = 130;

/// The folder, which nobody else can write to, and which is removed at the end.
#[derive(Debug)]
pub(super) struct Unpacked {
    /// The folder that is removed.
    root: PathBuf,
    /// The one in it with the name of the machine.
    folder: PathBuf,
}

impl Unpacked {
    /// Unpacks a machine.
    pub(super) fn new(machine: &BuiltIn) -> Result<Self, String> {
        let root = private_folder()?;
        let folder = root.join(machine.name);
        let unpacked = Self { root, folder };
        machine.copy_to(&unpacked.folder)?;
        Ok(unpacked)
    }

    /// Removes the folder when this process is interrupted, and ends the process: for work that cannot be stopped otherwise.
    pub(super) fn leave_when_interrupted(&self) {
        let root = self.root.clone();
        // Where signals cannot be caught, the folder stays among other temporary files.
        let _ = ctrlc::set_handler(move || {
            let _ = fs::remove_dir_all(&root);
            std::process::exit(INTERRUPTED);
        });
    }

    /// The folder of the machine.
    pub(super) fn path(&self) -> &Path {
        &self.folder
    }
}

impl Drop for Unpacked {
    fn drop(&mut self) {
        // What is left after an error lies among other temporary files.
        let _ = fs::remove_dir_all(&self.root);
    }
}

/// Makes a new folder among the temporary files.
fn private_folder() -> Result<PathBuf, String> {
    let parent = std::env::temp_dir();
    #[cfg_attr(not(unix), expect(unused_mut, reason = "only Unix has a mode to set"))]
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    // Another process with the same id may have left a folder of that name.
    for number in 0..ATTEMPTS {
        let path = parent.join(format!("tickbus-machine-{}-{number}", std::process::id()));
        match builder.create(&path) {
            Ok(()) => return Ok(path),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => {
                return Err(format!(
                    "{} cannot be made: {error}; TMPDIR names another folder for temporary files",
                    path.display()
                ));
            }
        }
    }
    Err(format!(
        "{} is full of folders of earlier runs; remove tickbus-machine-*",
        parent.display()
    ))
}
