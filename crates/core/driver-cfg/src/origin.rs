//! How the contents of a driver.cfg were read, so that they can be read again.

use tickbus_fieldbus::Role;

/// Says which end of the bus a command line asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandLineEnd {
    /// The end. A file without a role serves both ends.
    pub role: Role,
    /// True if another address will replace the file's; see [`Options::set_address`](crate::Options::set_address).
    pub moved: bool,
}

/// The command line and the tables that were read beside the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Origin {
    pub(crate) asked: Option<CommandLineEnd>,
    /// The tables that replaced the file's own, each with the name that mistakes in it have.
    pub(crate) overlays: Vec<(String, String)>,
}

impl Origin {
    pub(crate) fn of(asked: Option<CommandLineEnd>) -> Self {
        Self {
            asked,
            overlays: Vec::new(),
        }
    }

    pub(crate) fn overlaid(&mut self, name: &str, text: &str) {
        self.overlays.push((name.to_owned(), text.to_owned()));
    }
}
