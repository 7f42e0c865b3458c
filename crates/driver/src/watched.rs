//! The tick's data for a thread that looks at the driver.

use super::extras::Extras;
use super::tap::Tap;

/// The data that a tick needs to show itself to another thread.
#[derive(Debug)]
pub(super) struct Watched {
    pub(super) tap: Tap,
    /// Spare extras for the first fault of a driver without faults, so that the tick need not allocate them.
    pub(super) spare: Option<Box<Extras>>,
}

impl Watched {
    /// Returns true if anything is wanted of this tick.
    #[inline]
    pub(super) fn is_wanted(&self) -> bool {
        self.tap.is_wanted()
    }
}
