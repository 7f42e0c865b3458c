//! The options of the bus in a driver.cfg, and its kind, as an entry in a list of kinds.

use std::path::PathBuf;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table};
use tickbus_fieldbus::{Bus, BusKind, BusOptions, BusSetup, CYCLE, NamedFile, OpenError, Role};
use tickbus_image::signal::SignalTable;

use super::Mailbox;

/// The longest path of a folder, in characters.
const PATH_LIMIT: usize = 1000;

/// The bus's own keys in `[fieldbus]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// The folder with the two files; a relative path in the driver.cfg begins at the driver.cfg's folder.
    pub folder: PathBuf,
}

impl BusKind for Options {
    const NAME: &'static str = "mailbox";
    const KEYS: &'static [&'static [Key]] = &[&[Key::required(
        "folder",
        Shape::Label(PATH_LIMIT),
        "The folder of the two files; a relative path begins at the folder of this file",
    )]];

    fn read(_role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        let hint = "name the folder of the two files, such as folder = \"mailbox\"";
        let folder = table.require("folder", hint);
        let folder = folder.and_then(|value| value.label(PATH_LIMIT, hint))?;
        Some(Self {
            folder: folder.into(),
        })
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        vec![format!("files in {}", self.folder.display())]
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let folder = setup.folder.join(&self.folder);
        if !folder.is_dir() {
            return Err(OpenError::Config(Mistake::new(
                format!("there is no folder {}", folder.display()),
                "make it, or name another one in `folder`",
            )));
        }
        let mailbox = Mailbox::new(&folder, setup.role, setup.cycle.unwrap_or(CYCLE));
        Ok(Bus::Free(Box::new(mailbox)))
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(CYCLE)
    }
}
