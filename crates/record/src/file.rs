//! The file of a recording, which ends whole whatever happens to it.

use std::fs::File;
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};

/// Where a recording goes.
pub(super) trait Target: Write + Send {
    /// Cuts what was written down to `length` bytes, and goes on from there.
    fn cut(&mut self, length: u64) -> io::Result<()>;
}

impl Target for File {
    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)?;
        self.seek(SeekFrom::Start(length)).map(drop)
    }
}

/// A buffer in front of a file, which knows where whole ticks end.
pub(super) struct Out {
    target: Box<dyn Target>,
    pending: Vec<u8>,
    /// Where in `pending` something whole ends, each with the ticks that the file has by then.
    ends: Vec<(usize, u64)>,
    /// Bytes and ticks in the file.
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

    /// Where to write the next tick.
    pub(super) fn buffer(&mut self) -> &mut Vec<u8> {
        &mut self.pending
    }

    /// Bytes that wait to be written.
    pub(super) fn pending(&self) -> usize {
        self.pending.len()
    }

    /// What is in the buffer by now is whole, and the file has so many `ticks` with it.
    pub(super) fn whole(&mut self, ticks: u64) {
        self.ends.push((self.pending.len(), ticks));
    }

    /// Whether anything whole is in the file.
    pub(super) fn has_begun(&self) -> bool {
        self.length > 0
    }

    /// Ticks that are in the file.
    pub(super) fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Writes what waits.
    ///
    /// # Errors
    ///
    /// The file takes no more. It then ends with the last whole tick for which there was room, and the rest
    /// is gone.
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
            // Of a device that cannot be cut, such as a pipe, nothing better can be made.
            let _ = self.target.cut(self.length);
        }
        result
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    /// A disc with so many bytes of room, which takes what fits of a write.
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
                // Two ticks in a flush, so that a flush fails within one.
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
