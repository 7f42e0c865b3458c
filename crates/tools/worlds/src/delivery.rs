//! The record of bytes that a process has read, from a connection or from the serial line.

/// Bytes that a process has read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Delivery {
    /// When they arrived at its computer.
    pub at: i64,
    /// When they were sent, or earlier.
    pub sent: i64,
    /// The process that sent them.
    pub from: usize,
    /// True for the last bytes of a message; without them, the receiver cannot know the message.
    pub is_whole: bool,
}
