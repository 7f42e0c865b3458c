//! The layout of the memory. All positions are numbers of words, of 8 bytes.

use std::path::PathBuf;

use tickbus_base::os::{NamedMemory, SharedMemory};

use crate::wire::LONGEST_FRAME;

/// The first word of ready memory: the format and its version.
pub(super) const READY: u64 = u64::from_le_bytes(*b"SDSPshm2");

/// The position of [`READY`].
pub(super) const MAGIC: usize = 0;

/// The number of seats.
pub(super) const SEATS: usize = 1;

/// How often a waiting client spins.
pub(super) const SPINS: usize = 2;

/// Counts the posts of clients while the server sleeps; the server waits for a change.
pub(super) const BELL: usize = 8;

/// True while the server sleeps.
pub(super) const SERVER_SLEEPS: usize = 9;

/// Counts how often the server has checked all seats.
pub(super) const PULSE: usize = 10;

/// The position of the first seat.
const FIRST: usize = 16;

/// The words of one mailbox: its head, and the longest frame.
const MAILBOX: usize = 16 + LONGEST_FRAME / 8;

/// The words of one seat. Only used seats take memory.
const SEAT: usize = 16 + 2 * MAILBOX;

/// A free seat.
pub(super) const FREE: u64 = 0;

/// A seat whose client has left; the server frees it.
pub(super) const LEFT: u64 = u64::MAX;

/// The position of a seat's owner: the number of its process, or one of the above.
pub(super) const fn owner(seat: usize) -> usize {
    FIRST + seat * SEAT
}

/// The mailbox to the server.
pub(super) const fn up(seat: usize) -> usize {
    owner(seat) + 16
}

/// The mailbox to the client.
pub(super) const fn down(seat: usize) -> usize {
    up(seat) + MAILBOX
}

/// The bytes of the memory for this many seats.
pub(super) const fn bytes(seats: usize) -> usize {
    owner(seats) * 8
}

/// The number of seats in this memory; `None` if it has another format or is not ready.
pub(super) fn seats(memory: &SharedMemory) -> Option<usize> {
    use std::sync::atomic::Ordering::Acquire;

    if memory.len() <= FIRST || memory.word(MAGIC).load(Acquire) != READY {
        return None;
    }
    let seats = usize::try_from(memory.word(SEATS).load(Acquire)).ok()?;
    // The length of the file is decisive.
    (seats <= memory.len() / SEAT && memory.len() >= owner(seats)).then_some(seats)
}

/// The file of the run with this name.
pub(super) fn path(name: &str) -> PathBuf {
    NamedMemory::path(&format!("tickbus-sdsp-{name}"))
}
