//! A build without pages.

use tickbus_driver::Watch;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::tcp::Address;
use tickbus_virtual_time::Controls;

use super::PageError;

/// A place that no driver has.
#[derive(Debug)]
pub(crate) enum Place {}

/// Nothing, unless the driver.cfg asks for a page.
pub(crate) fn show(
    config: &Config,
    _watch: impl FnOnce() -> Option<Watch>,
    _announce: impl FnOnce(&str),
) -> Result<Option<Place>, PageError> {
    if config.page.is_none() {
        return Ok(None);
    }
    Err(PageError::Unsupported(format!(
        "{}: this tickbus was built without live pages; build it with --features page, or remove [page]",
        config.path.display()
    )))
}

/// Nothing: there are no pages.
pub(crate) fn show_run(
    _name: &str,
    _listen: &Address,
    _controls: Controls,
    _announce: impl FnOnce(&str),
) -> Result<Place, PageError> {
    let text = "this tickbus was built without live pages; build it with --features page, or leave out --page";
    Err(PageError::Unsupported(text.to_owned()))
}

/// There is no page.
pub(crate) fn url() -> Option<String> {
    None
}
