//! One frame at a time, from one process to another.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};

use tickbus_base::os::SharedMemory;

use crate::wire::LONGEST_FRAME;

/// Counts the posted frames; the reader waits for a change.
const POSTED: usize = 0;
/// The bytes of the frame.
const LENGTH: usize = 1;
/// Counts the frames taken out of the mailbox of the other direction. So only one process writes to each cache line,
/// and a short frame needs a single one.
const TAKEN: usize = 2;
/// True while the process that posts here sleeps.
const SLEEPS: usize = 3;
/// The frame.
const FRAME: usize = 4;

/// One end of a mailbox.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mailbox {
    at: usize,
    /// The position of the mailbox of the other direction.
    back: usize,
    /// The frames that this end has posted or taken.
    count: u64,
}

impl Mailbox {
    /// The end of an empty mailbox at this position; that of the other direction is at `back`.
    pub(super) const fn new(at: usize, back: usize) -> Self {
        Self { at, back, count: 0 }
    }

    /// Resets the mailbox.
    pub(super) fn clear(&mut self, memory: &SharedMemory) {
        memory.word(self.at + POSTED).store(0, SeqCst);
        memory.word(self.at + SLEEPS).store(0, SeqCst);
        memory.word(self.back + TAKEN).store(0, SeqCst);
        self.count = 0;
    }

    /// Where the reader waits, and the value that has to change there.
    pub(super) const fn bell(&self) -> (usize, u64) {
        (self.at + POSTED, self.count)
    }

    /// Sets the sign that the reader of this mailbox sleeps.
    pub(super) fn set_sleeping(&self, memory: &SharedMemory, sleeps: bool) {
        memory
            .word(self.back + SLEEPS)
            .store(u64::from(sleeps), SeqCst);
    }

    /// True if the reader of this mailbox sleeps.
    pub(super) fn is_reader_sleeping(&self, memory: &SharedMemory) -> bool {
        memory.word(self.back + SLEEPS).load(SeqCst) != 0
    }

    /// True if there is room for a frame: the other end has taken the previous one.
    pub(super) fn has_room(&self, memory: &SharedMemory) -> bool {
        memory.word(self.back + TAKEN).load(Acquire) == self.count
    }

    /// Posts a frame; there must be [room](Self::has_room).
    pub(super) fn post(&mut self, memory: &SharedMemory, frame: &[u8]) {
        memory
            .word(self.at + LENGTH)
            .store(frame.len() as u64, Relaxed);
        memory.write(self.at + FRAME, frame);
        self.count += 1;
        // Post before checking if the other end sleeps, since it first sets its sign and then looks here.
        memory.word(self.at + POSTED).store(self.count, SeqCst);
    }

    /// True if a frame has come.
    pub(super) fn has_frame(&self, memory: &SharedMemory) -> bool {
        // Look only after this end has set its sign; see `post`.
        memory.word(self.at + POSTED).load(SeqCst) != self.count
    }

    /// Takes the frame that has come.
    pub(super) fn take(
        &mut self,
        memory: &SharedMemory,
        frame: &mut Vec<u8>,
    ) -> Result<(), String> {
        let posted = memory.word(self.at + POSTED).load(Acquire);
        let length = memory.word(self.at + LENGTH).load(Relaxed);
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        if posted != self.count + 1 || length == 0 || length > LONGEST_FRAME {
            return Err("wrote into the mailbox what is no frame".to_owned());
        }
        frame.resize(length, 0);
        memory.read(self.at + FRAME, frame);
        self.count = posted;
        memory.word(self.back + TAKEN).store(posted, Release);
        Ok(())
    }
}
