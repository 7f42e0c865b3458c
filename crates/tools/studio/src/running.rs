//! A driver that runs already: its simulation owns the line, and the line takes the changes of the file.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use serde_json::{Value as Json, json};
use tickbus_driver::Line;
use tickbus_driver_cfg::{Config, Kinds};

/// Reads the driver.cfg as the driver was opened, with what its command line asks for; or says what is wrong.
pub type Read = Box<dyn Fn() -> Result<Config, String> + Send + Sync>;

/// A driver that runs in this process, and the file that it was opened from.
pub struct Running {
    /// The number that the live page has the driver under.
    pub id: i32,
    /// The settings that the driver was opened with.
    pub config: Arc<Config>,
    /// The kinds of bus that its file can name.
    pub kinds: &'static Kinds,
    /// The line; `None` if the bus runs in step with the simulation.
    pub line: Option<Line>,
    /// Reads the file.
    pub read: Read,
}

/// The changes that the file asks of a line that runs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Asked {
    /// True if the file differs from the line.
    is_other: bool,
    /// The changes that need a restart.
    restart: Vec<String>,
}

impl Running {
    pub(crate) fn path(&self) -> PathBuf {
        self.config.path.clone()
    }

    /// Returns the present settings of the line.
    pub(crate) fn present(&self) -> Arc<Config> {
        let present = self.line.as_ref().and_then(Line::config);
        present.unwrap_or_else(|| Arc::clone(&self.config))
    }

    /// Returns the changes that the file asks of the line. A file with mistakes asks for nothing: they are marked.
    pub(crate) fn asked(&self) -> Asked {
        let Ok(next) = (self.read)() else {
            return Asked::default();
        };
        let present = self.present();
        let mut restart = present.needs_restart(&next);
        let is_other = !restart.is_empty() || !present.has_line_of(&next);
        if is_other && self.line.is_none() {
            restart.push("the bus runs in step with the simulation".to_owned());
        }
        Asked { is_other, restart }
    }

    /// Gives the line the settings of the file.
    pub(crate) fn take(&self) -> Result<(), String> {
        let next = (self.read)()?;
        match &self.line {
            Some(line) => line
                .take(next)
                .map(drop)
                .map_err(|untaken| untaken.to_string()),
            None => Err(
                "the bus runs in step with the simulation; restart the simulation for that"
                    .to_owned(),
            ),
        }
    }

    /// The line for the page.
    pub(crate) fn json(&self, asked: &Asked, refused: &str) -> Json {
        json!({
            "runs": true,
            "refused": refused,
            "isOld": asked.is_other,
            "owner": { "id": self.id, "name": self.config.name, "restart": asked.restart },
        })
    }
}

impl fmt::Debug for Running {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Running").finish_non_exhaustive()
    }
}
