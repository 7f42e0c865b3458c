//! The options of a driver on the page.

use std::path::PathBuf;

use tickbus_base::time::Nanos;

use crate::picture::Picture;

/// The options of a driver on the page.
#[derive(Clone, Debug)]
pub struct Options {
    /// How long signals stay forced after the last viewer with the token has gone; `None` for as long as the driver
    /// runs.
    pub grace: Option<Nanos>,
    /// The picture of the machine.
    pub picture: Option<Picture>,
    /// The file of its lists of signals, which need not exist; without one no list can be kept.
    pub lists: Option<PathBuf>,
}
