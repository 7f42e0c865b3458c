//! The machines that are built in: folders of text in `examples/machines`.

use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::Path;

/// A machine that is built in.
#[derive(Debug)]
pub(super) struct BuiltIn {
    /// The name of its folder.
    pub(super) name: &'static str,
    /// The files: the path within the folder, with `/`, and the text. The first is its driver.cfg.
    pub(super) files: &'static [(&'static str, &'static str)],
}

/// The machine in this folder, with these files besides its driver.cfg, README.md and picture.svg.
macro_rules! machine {
    ($name:literal, $($exercise:literal),+) => {
        BuiltIn {
            name: $name,
            files: &[
                machine!(@ $name, "driver.cfg"),
                machine!(@ $name, "README.md"),
                machine!(@ $name, "picture.svg"),
                $(machine!(@ $name, $exercise)),+
            ],
        }
    };
    (@ $name:literal, $file:literal) => {
        ($file, include_str!(concat!("../../../examples/machines/", $name, "/", $file)))
    };
}

/// All of them, from the easiest to the most difficult one.
pub(super) const MACHINES: &[BuiltIn] = &[
    machine!(
        "two-tanks",
        "exercises/1-fill.toml",
        "exercises/2-level.toml",
        "exercises/3-batch.toml"
    ),
    machine!(
        "traffic-lights",
        "exercises/1-cycle.toml",
        "exercises/2-demand.toml",
        "exercises/3-pedestrians.toml"
    ),
    machine!(
        "sorting",
        "exercises/1-belt.toml",
        "exercises/2-sort.toml",
        "exercises/3-count.toml"
    ),
    machine!(
        "pick-and-place",
        "exercises/1-one-part.toml",
        "exercises/2-again.toml",
        "exercises/3-trouble.toml"
    ),
    machine!(
        "lift",
        "exercises/1-call.toml",
        "exercises/2-several.toml",
        "exercises/3-door.toml"
    ),
    machine!(
        "bottle-rig",
        "exercises/1-home.toml",
        "exercises/2-cycle.toml",
        "exercises/3-jam.toml"
    ),
];

impl BuiltIn {
    /// The title: the first line of its driver.cfg, which is a comment.
    pub(super) fn title(&self) -> &'static str {
        let first = self.files[0].1.lines().next().unwrap_or_default();
        first.trim_start_matches('#').trim()
    }

    /// Writes the files into `folder`, which is made, or is empty. Overwrites nothing.
    pub(super) fn copy_to(&self, folder: &Path) -> Result<(), String> {
        let shown = folder.display();
        let failed = |error: std::io::Error| format!("{shown} cannot be written: {error}");
        if fs::symlink_metadata(folder).is_ok() {
            let mut entries = fs::read_dir(folder).map_err(failed)?;
            if entries.next().is_some() {
                return Err(format!(
                    "{shown} has files already; name a folder that does not exist yet"
                ));
            }
        }
        for (file, text) in self.files {
            let path = folder.join(file);
            if let Some(parent) = path.parent() {
                fs::create_dir_all(parent).map_err(failed)?;
            }
            let mut options = OpenOptions::new();
            let made = options.write(true).create_new(true).open(path);
            made.and_then(|mut made| made.write_all(text.as_bytes()))
                .map_err(failed)?;
        }
        Ok(())
    }
}
