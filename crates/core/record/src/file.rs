//! The file of a recording, which always ends with a whole tick.

use std::fs::File;
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::Arc;

use tickbus_base::time::Clock;

/// The destination of a recording.
pub(super) trait Target: Write + Send {
    /// Truncates what was written to `length` bytes, and continues from there.
    fn cut(&mut self, length: u64) -> io::Result<()>;
}

impl Target for File {
    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)?;
        self.seek(SeekFrom::Start(length)).map(drop)
    }
}

/// A file in a simulation, whose disk may be full.
pub(super) struct SimulatedFile {
    pub(super) file: File,
    pub(super) path: PathBuf,
    pub(super) clock: Arc<dyn Clock>,
}

impl Write for SimulatedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.clock.simulation() {
            Some(simulation) => simulation.write(&self.file, &self.path, bytes),
            None => self.file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Target for SimulatedFile {
    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.file.cut(length)
    }
}

/// A buffer in front of a file that knows where ticks end.
pub(super) struct Out {
    target: Box<dyn Target>,
    pending: Vec<u8>,
    /// The ends of ticks in `pending`, each with the number of ticks in the file up to there.
    ends: Vec<(usize, u64)>,
    /// Bytes in the file, and ticks.
    length: u64,
    ticks: u64,
}

impl Out {
    pub(super) fn new(target: Box<dyn Target>) -> Self {
        Self {
            target,
            pending: Vec::new(),
            ends: Vec::new(),
            length: 0,
            ticks: 0,
        }
    }

    /// The buffer for the next tick.
    pub(super) fn buffer(&mut self) -> &mut Vec<u8> {
        &mut self.pending
    }

    /// Bytes that are not written yet.
    pub(super) fn pending(&self) -> usize {
        self.pending.len()
    }

    /// Marks the end of a tick in the buffer; the file then has `ticks` ticks.
    pub(super) fn whole(&mut self, ticks: u64) {
        self.ends.push((self.pending.len(), ticks));
    }

    /// True if the file has at least one whole part.
    pub(super) fn has_begun(&self) -> bool {
        self.length > 0
    }

    /// Number of ticks in the file.
    pub(super) fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Writes the pending bytes.
    ///
    /// # Errors
    ///
    /// The file cannot take more. It then ends with the last whole tick that fitted, and the rest is
    /// discarded.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        let mut done = 0;
        let mut result = Ok(());
        while done < self.pending.len() {
            match self.target.write(&self.pending[done..]) {
                Ok(0) => {
                    result = Err(ErrorKind::WriteZero.into());
                    break;
                }
                Ok(count) => done += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => {
                    result = Err(error);
                    break;
                }
            }
        }
        let result = result.and_then(|()| self.target.flush());
        let whole = self.ends.iter().rev().find(|(end, _)| *end <= done);
        let (end, ticks) = whole.copied().unwrap_or((0, self.ticks));
        self.length += end as u64;
        self.ticks = ticks;
        self.pending.clear();
        self.ends.clear();
        if result.is_err() {
            // Some targets, such as a pipe, cannot be truncated; there is nothing better to do.
            let _ = self.target.cut(self.length);
        }
        result
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    /// A disk with little room, which accepts the part of a write that fits.
    #[derive(Clone)]
    pub(crate) struct SmallDisc {
        pub(crate) bytes: Arc<Mutex<Vec<u8>>>,
        pub(crate) room: usize,
    }

    impl SmallDisc {
        pub(crate) fn new(room: usize) -> Self {
            Self {
                bytes: Arc::default(),
                room,
            }
        }
    }

    impl Write for SmallDisc {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let mut disc = self.bytes.lock().expect("no panic");
            let fits = bytes.len().min(self.room - disc.len());
            if fits == 0 && !bytes.is_empty() {
                return Err(ErrorKind::StorageFull.into());
            }
            disc.extend_from_slice(&bytes[..fits]);
            Ok(fits)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Target for SmallDisc {
        fn cut(&mut self, length: u64) -> io::Result<()> {
            let length = usize::try_from(length).expect("short");
            self.bytes.lock().expect("no panic").truncate(length);
            Ok(())
        }
    }

    #[test]
    fn a_full_disc_keeps_what_is_whole() {
        for room in 0..=16 {
            let disc = SmallDisc::new(room);
            let mut out = Out::new(Box::new(disc.clone()));
            let mut failed = false;
            for tick in 1..=4 {
                out.buffer().extend_from_slice(b"abc\n");
                out.whole(tick);
                // Two ticks per flush, so that a flush can fail within a tick.
                failed |= tick % 2 == 0 && out.flush().is_err();
                if failed {
                    break;
                }
            }
            assert_eq!(failed, room < 16, "{room}");
            assert_eq!(out.ticks(), room as u64 / 4);
            let whole = "abc\n".repeat(room / 4);
            assert_eq!(disc.bytes.lock().unwrap().as_slice(), whole.as_bytes());
        }
    }
}
