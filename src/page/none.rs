//! A build without pages.

#[cfg(feature = "doors")]
use tickbus_base::time::Nanos;
use tickbus_driver::Watch;
use tickbus_net::Address;
use tickbus_virtual_time::Controls;

use super::{PageError, Shown};

/// The place of a driver on the page; without pages there is none.
#[derive(Debug)]
pub enum Place {}

/// Does nothing, unless the driver.cfg asks for a page, which is an error.
pub(crate) fn show(
    shown: Shown<'_, impl FnOnce() -> Option<Watch>>,
    _announce: impl FnOnce(&str, &str),
) -> Result<Option<Place>, PageError> {
    let Shown {
        config,
        watch,
        line,
        read,
        setting,
        keeps_lists: _,
    } = shown;
    // Nothing is watched or edited.
    drop((watch, line, read, setting));
    if config.page.is_none() {
        return Ok(None);
    }
    Err(PageError::Unsupported(format!(
        "{}: this tickbus was built without live pages; build it with --features page, or remove [page]",
        config.path.display()
    )))
}

/// Returns an error: this build has no pages.
pub(crate) fn show_run(
    _name: &str,
    _listen: &Address,
    _controls: Controls,
    _announce: impl FnOnce(&str, &str),
) -> Result<Place, PageError> {
    let text = "this tickbus was built without live pages; build it with --features page, or leave out --page";
    Err(PageError::Unsupported(text.to_owned()))
}

/// The place of nets on the page; without pages there is none.
#[cfg(feature = "doors")]
#[derive(Debug)]
pub(crate) enum NetsPlace {}

/// Returns an error: this build has no pages.
#[cfg(feature = "doors")]
pub(crate) fn show_nets(_title: &str, _listen: &Address) -> Result<NetsPlace, PageError> {
    let text = "this tickbus was built without live pages; build it with --features page";
    Err(PageError::Unsupported(text.to_owned()))
}

#[cfg(feature = "doors")]
impl NetsPlace {
    pub(crate) fn url(&self) -> String {
        match *self {}
    }

    pub(crate) fn draw(&self, _json: &str) -> Result<(), String> {
        match *self {}
    }

    pub(crate) fn wanted(&self, _patience: Nanos) -> bool {
        match *self {}
    }

    pub(crate) fn put(&self, _json: &str) -> Result<(), String> {
        match *self {}
    }

    pub(crate) fn leave(&self) {
        match *self {}
    }
}

/// Does nothing: there is no page.
pub const fn forked() {}

/// Returns `None`: there is no page.
pub const fn url() -> Option<String> {
    None
}
