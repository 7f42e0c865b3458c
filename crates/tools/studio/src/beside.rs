//! Studios beside the live page of drivers that run: one for each driver that is edited.
//!
//! The first one has the paths of a studio that is alone, `/studio/…`; each of them has `/studio/of/ID/…`.

use std::fmt;

use tickbus_web::{Joined, Pages};

use crate::running::Running;
use crate::site::Studio;

/// The studio of one driver; dropping it ends the studio.
pub struct Seat {
    id: i32,
    joined: Option<Joined>,
    studio: Option<Studio>,
}

impl Seat {
    /// Opens the studio of a driver, which joins these pages, among them the live page that shows the driver.
    ///
    /// # Errors
    ///
    /// The file cannot be read.
    pub fn join(pages: &Pages, running: Running) -> Result<Self, String> {
        let (id, name) = (running.id, running.config.name.clone());
        let studio = Studio::of_running(running)?;
        let page = studio.page().one_of_several(&id.to_string(), &name);
        Ok(Self {
            id,
            joined: Some(pages.join(page)),
            studio: Some(studio),
        })
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.joined = None;
        if let Some(unsaved) = self.studio.take().and_then(Studio::close) {
            let why = &unsaved.why;
            match &unsaved.kept {
                Ok(path) => log::error!(
                    "the driver.cfg could not be written: {why}; the edits are in {}",
                    path.display()
                ),
                Err(error) => log::error!(
                    "the driver.cfg could not be written ({why}), and no other file either: {error}"
                ),
            }
        }
    }
}

impl fmt::Debug for Seat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Seat")
            .field("id", &self.id)
            .finish_non_exhaustive()
    }
}
