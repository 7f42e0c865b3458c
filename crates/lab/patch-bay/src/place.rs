//! The place of a box on the page.

use tickbus_base::time::Nanos;
use tickbus_dispatcher::{Label, Pin};

use crate::arrange::Spot;

/// The largest coordinate.
pub(crate) const FARTHEST: i32 = 1_000_000;

/// The place of a box.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) spot: Spot,
    pub(crate) is_folded: bool,
    pub(crate) group: Option<Label>,
    /// The state in which it last changed.
    pub(crate) changed: u64,
    /// Until when the box may be placed again.
    pub(crate) settles: Option<Nanos>,
}

impl Place {
    pub(crate) const fn kept(spot: Spot, is_folded: bool, group: Option<Label>) -> Self {
        Self {
            spot,
            is_folded,
            group,
            changed: 0,
            settles: None,
        }
    }
}

/// True if a box can have this name.
pub(crate) fn is_box(name: &str) -> bool {
    Pin::parse(&format!("{name}:Q1")).is_some()
}
