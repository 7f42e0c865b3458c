//! The transport of letters to other dispatchers.

use crate::host::HostId;

/// A network that transports letters to other dispatchers. Letters from them arrive through the [`Door`](crate::Door).
///
/// The dispatcher's thread calls the methods; they must not block.
pub trait Post: Send {
    /// True if the network accepts a letter now. When it becomes ready again, it wakes the loop by an errand through
    /// the door.
    fn has_room(&self) -> bool;

    /// Sends a letter. Letters to one dispatcher must not overtake each other; they may be lost.
    fn send(&mut self, to: HostId, letter: Vec<u8>);
}
