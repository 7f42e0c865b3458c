//! The files that are packed into an FMU with its driver.cfg.

use std::path::{Component, Path, PathBuf};

use tickbus_base::Mistake;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::NamedFile;

/// The files that a driver.cfg names, and notes about them for the FMU's users.
#[derive(Debug, Default)]
pub(super) struct Named {
    /// The files to pack, relative to the driver.cfg's folder.
    pub(super) files: Vec<PathBuf>,
    /// Notes about files that are not packed.
    pub(super) notes: Vec<String>,
}

/// Finds the files that `config` names. Files in its folder or below are packed. Files with an absolute path are not,
/// and must exist wherever the FMU runs.
pub(super) fn named(config: &Config, faults: Option<&Path>) -> Result<Named, Mistake> {
    let mut named = Named::default();
    let faults = faults.map(|file| NamedFile::Plain(file.to_owned()));
    for file in config.bus.files().into_iter().chain(faults) {
        let (path, is_secret) = match &file {
            NamedFile::Plain(path) => (path, false),
            NamedFile::Secret(path) => (path, true),
            NamedFile::InClear(key) => {
                return Err(Mistake::new(
                    format!(
                        "{} has a password ({key}), and an FMU goes through many hands",
                        config.path.display()
                    ),
                    "write password_env, and set that variable on the computer that runs the FMU",
                ));
            }
        };
        if path.is_absolute() {
            named.notes.push(format!(
                "{} stays where it is: it has to be there on every computer that runs the FMU",
                path.display()
            ));
            continue;
        }
        if is_secret {
            return Err(Mistake::new(
                format!(
                    "{} has keys or passwords, and an FMU goes through many hands",
                    path.display()
                ),
                "name it by an absolute path, and put it there on the computer that runs the FMU",
            ));
        }
        if path.components().any(|part| part == Component::ParentDir) {
            return Err(Mistake::new(
                format!("{} is outside of the folder of driver.cfg", path.display()),
                "copy it beside driver.cfg, or name it by an absolute path",
            ));
        }
        if !named.files.contains(path) {
            named.files.push(path.clone());
        }
    }
    Ok(named)
}
