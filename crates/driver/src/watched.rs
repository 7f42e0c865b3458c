//! What the tick of a driver keeps while another thread may look at it.

use super::extras::Extras;
use super::tap::Tap;

/// What a tick needs to be looked at.
#[derive(Debug)]
pub(super) struct Watched {
    pub(super) tap: Tap,
    /// What a driver without faults gets when the first one comes, so that it need not be allocated then.
    pub(super) spare: Option<Box<Extras>>,
}

impl Watched {
    /// Whether anything is wanted of this tick.
    #[inline]
    pub(super) fn is_wanted(&self) -> bool {
        self.tap.is_wanted()
    }
}
