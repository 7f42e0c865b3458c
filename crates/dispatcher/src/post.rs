//! The way of letters to other dispatchers.

use crate::host::HostId;

/// A network that takes letters for other dispatchers. What arrives from them comes in through the [`Door`](crate::Door).
///
/// It is used in the dispatcher's thread and must not block.
pub trait Post: Send {
    /// Whether it takes a letter now. When it does again it wakes the loop, by an errand through the door.
    fn has_room(&self) -> bool;

    /// Takes a letter. Letters to one dispatcher must not overtake each other; they may get lost.
    fn send(&mut self, to: HostId, letter: Vec<u8>);
}
