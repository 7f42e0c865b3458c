//! The dispatchers of one laboratory, and the order of its clients.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A dispatcher of a laboratory: a number that no other process has, and that ends with its process.
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
    /// When it registered, in nanoseconds, and later than every client that its dispatcher knew then; unique in one
    /// dispatcher.
    pub(crate) since: u64,
    /// Its dispatcher.
    pub(crate) host: HostId,
}
