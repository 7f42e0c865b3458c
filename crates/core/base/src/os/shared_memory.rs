//! Memory that two processes share.

#![allow(unsafe_code, reason = "memory is mapped")]

use std::io;
use std::ptr::NonNull;
#[cfg(target_os = "linux")]
use std::sync::atomic::AtomicU32;
use std::sync::atomic::{AtomicU64, Ordering, fence};
use std::time::Duration;

#[cfg(target_os = "linux")]
use super::poll::timespec;

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(unix)]
use unix as system;
#[cfg(unix)]
pub use unix::MemoryFile;
#[cfg(windows)]
use windows as system;
#[cfg(windows)]
pub use windows::MemoryFile;

/// Bytes of one word.
const WORD: usize = size_of::<AtomicU64>();

/// A piece of memory that another process may read and write at any time.
///
/// Whole images are copied in and out. The processes take turns by other means, such as a socket; a process
/// that violates its turn causes wrong bytes, but nothing worse.
#[derive(Debug)]
pub struct SharedMemory {
    words: NonNull<AtomicU64>,
    count: usize,
}

// SAFETY: the mapping belongs to the process, not to a thread, and all access to it is atomic.
unsafe impl Send for SharedMemory {}

impl SharedMemory {
    /// Creates zeroed memory of at least `bytes` bytes, and the file by which another process
    /// [opens](Self::open) it.
    ///
    /// # Errors
    ///
    /// The system has no memory left.
    pub fn create(bytes: usize) -> io::Result<(Self, MemoryFile)> {
        let file = system::create(words(bytes) * WORD)?;
        let memory = Self::open(&file, bytes)?;
        Ok((memory, file))
    }

    /// Opens memory of `bytes` bytes that another process has created.
    ///
    /// # Errors
    ///
    /// The file is not such memory, or is too small.
    pub fn open(file: &impl system::Mappable, bytes: usize) -> io::Result<Self> {
        let count = words(bytes);
        let start = system::map(file, count * WORD).map_err(|error| match error {
            system::Unmapped::TooSmall(has) => {
                let text = format!("the shared memory has {has} bytes, expected {bytes}");
                io::Error::new(io::ErrorKind::InvalidData, text)
            }
            system::Unmapped::System(error) => error,
        })?;
        Ok(Self {
            words: start.cast(),
            count,
        })
    }

    /// The memory as words.
    ///
    /// This is sound although the other process may write at any time, whatever code it runs: the words are
    /// atomics, so concurrent writes are no data race, and every bit pattern is a valid value. No reference
    /// to plain bytes of the mapping is ever made.
    fn words(&self) -> &[AtomicU64] {
        // SAFETY: the mapping has `count` words, page-aligned, zeroed by the system, and lives until
        // `drop`; see above for the other process.
        unsafe { std::slice::from_raw_parts(self.words.as_ptr(), self.count) }
    }

    /// Copies `bytes` to the memory, from word `at` on.
    ///
    /// # Panics
    ///
    /// When the bytes would extend beyond the memory.
    pub fn write(&self, at: usize, bytes: &[u8]) {
        let words = &self.words()[at..at + Self::words_for(bytes.len())];
        for (word, chunk) in words.iter().zip(bytes.chunks(WORD)) {
            let mut value = [0; WORD];
            value[..chunk.len()].copy_from_slice(chunk);
            word.store(u64::from_ne_bytes(value), Ordering::Relaxed);
        }
        // The message that gives the turn to the other process must come after the words.
        fence(Ordering::Release);
    }

    /// Fills `bytes` from the memory, from word `at` on.
    ///
    /// # Panics
    ///
    /// When the bytes would extend beyond the memory.
    pub fn read(&self, at: usize, bytes: &mut [u8]) {
        // The message that gave us the turn came before the words.
        fence(Ordering::Acquire);
        let words = &self.words()[at..at + Self::words_for(bytes.len())];
        for (word, chunk) in words.iter().zip(bytes.chunks_mut(WORD)) {
            let value = word.load(Ordering::Relaxed).to_ne_bytes();
            chunk.copy_from_slice(&value[..chunk.len()]);
        }
    }

    /// The number of words.
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub const fn len(&self) -> usize {
        self.count
    }

    /// The word at `at`.
    ///
    /// # Panics
    ///
    /// When the memory ends before that word.
    pub fn word(&self, at: usize) -> &AtomicU64 {
        &self.words()[at]
    }

    /// Waits until another process [wakes](Self::wake) the waiters for the word `at`, for `limit` at most. Returns at
    /// once if the lower 32 bits of that word are no longer those of `seen`, and may return early without a reason.
    ///
    /// # Panics
    ///
    /// When the memory ends before that word.
    pub fn wait(&self, at: usize, seen: u64, limit: Duration) {
        #[cfg(target_os = "linux")]
        {
            use rustix::thread::futex;

            #[expect(clippy::cast_possible_truncation, reason = "the lower half is meant")]
            let seen = seen as u32;
            let limit = timespec(limit);
            // The word changed, the time is up, or a signal came: the caller checks again in any case.
            let _ = futex::wait(
                self.lower_half(at),
                futex::Flags::empty(),
                seen,
                Some(&limit),
            );
        }
        #[cfg(not(target_os = "linux"))]
        {
            // Without such a wait, check again soon.
            let _ = (self.word(at), seen);
            let _ = super::poll::poll_once(&mut [], Some(limit.min(Duration::from_millis(1))));
        }
    }

    /// Wakes every process that [waits](Self::wait) for the word `at`, which must have been changed before.
    ///
    /// # Panics
    ///
    /// When the memory ends before that word.
    pub fn wake(&self, at: usize) {
        #[cfg(target_os = "linux")]
        {
            use rustix::thread::futex;

            // Can only fail for an invalid address, and this one is mapped.
            let everyone = i32::MAX.unsigned_abs();
            let _ = futex::wake(self.lower_half(at), futex::Flags::empty(), everyone);
        }
        #[cfg(not(target_os = "linux"))]
        let _ = self.word(at);
    }

    /// The lower half of a word: the system's waits compare 32 bits.
    #[cfg(target_os = "linux")]
    fn lower_half(&self, at: usize) -> &AtomicU32 {
        let halves = std::ptr::from_ref(self.word(at)).cast::<AtomicU32>();
        let lower = usize::from(cfg!(target_endian = "big"));
        // SAFETY: within the word, aligned for its half, and alive as long as `self`. No code accesses the half: it is
        // only passed to the system, which reads it by itself, like another process.
        unsafe { &*halves.add(lower) }
    }

    /// The number of words for `bytes` bytes.
    pub fn words_for(bytes: usize) -> usize {
        bytes.div_ceil(WORD)
    }
}

impl Drop for SharedMemory {
    fn drop(&mut self) {
        // SAFETY: the whole of a mapping that `open` made; references to it end with borrows of `self`.
        unsafe { system::unmap(self.words.cast(), self.count * WORD) };
    }
}

/// The number of words for `bytes` bytes: at least one, since an empty mapping is not allowed.
fn words(bytes: usize) -> usize {
    SharedMemory::words_for(bytes).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_any_length_come_out_of_the_other_mapping_as_they_went_in() {
        let (one, file) = SharedMemory::create(64).expect("memory");
        let two = SharedMemory::open(&file, 64).expect("the same memory");
        for length in 0..=48 {
            let sent: Vec<u8> = (1..=length).collect();
            let mut got = vec![0; sent.len()];
            one.write(2, &sent);
            two.read(2, &mut got);
            assert_eq!(got, sent);
        }
    }

    #[test]
    fn no_bytes_fit_at_the_very_end() {
        let (memory, _file) = SharedMemory::create(16).expect("memory");
        memory.write(2, &[]);
        memory.read(2, &mut []);
    }

    #[test]
    fn memory_that_is_too_small_is_refused() {
        let (_memory, file) = SharedMemory::create(8).expect("memory");
        // More than a page, which some systems give for any smaller number.
        let error = SharedMemory::open(&file, 1 << 20).expect_err("too small");
        assert!(error.to_string().contains("bytes, expected 1048576"));
    }

    #[test]
    fn a_wait_for_a_word_ends_when_it_changes() {
        let (one, file) = SharedMemory::create(64).expect("memory");
        let two = SharedMemory::open(&file, 64).expect("the same memory");
        one.wait(3, 1, Duration::from_secs(3600));
        let waiting = std::thread::spawn(move || {
            while two.word(3).load(Ordering::Acquire) == 0 {
                two.wait(3, 0, Duration::from_secs(3600));
            }
        });
        one.word(3).store(1, Ordering::Release);
        one.wake(3);
        waiting.join().expect("no panic");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_other_process_cannot_shorten_it() {
        let (_memory, file) = SharedMemory::create(8).expect("memory");
        assert!(rustix::fs::ftruncate(&file, 0).is_err());
    }

    #[test]
    #[should_panic(expected = "range end index")]
    fn nothing_is_written_beyond_it() {
        let (memory, _file) = SharedMemory::create(16).expect("memory");
        memory.write(1, &[0; 9]);
    }
}
