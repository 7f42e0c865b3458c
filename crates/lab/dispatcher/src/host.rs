//! The dispatchers of one laboratory, and the order of its clients.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A dispatcher of a laboratory: a number that no other process has, and that changes with each start.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct HostId(pub u128);

impl fmt::Display for HostId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:x}", self.0)
    }
}

/// The place of a client in the order of registration. No two clients of a laboratory have the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Rank {
    /// The time of registration in nanoseconds, but later than every client that the dispatcher knew then; unique in
    /// one dispatcher.
    pub(crate) since: u64,
    /// The client's dispatcher.
    pub(crate) host: HostId,
}
