//! How a driver is shown.

use tickbus_base::time::Nanos;

use crate::picture::Picture;

/// How a driver is shown.
#[derive(Clone, Debug)]
pub struct Options {
    /// How long its signals stay forced when nobody with the token looks any more; `None` for as long as it runs.
    pub grace: Option<Nanos>,
    /// The picture of its machine.
    pub picture: Option<Picture>,
}
