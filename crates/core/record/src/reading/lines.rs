//! The complete lines of a file that may be truncated.

use std::io::{self, BufRead, ErrorKind, Read};

/// The longest line of a recording: a CSV header with a great many signals.
const LONGEST: u64 = 64 << 20;

/// Passes on complete lines only: text after the last line end was truncated during writing.
pub(super) struct WholeLines<R> {
    inner: R,
    line: Vec<u8>,
    at: usize,
    number: u64,
    cut: bool,
}

impl<R: BufRead> WholeLines<R> {
    pub(super) fn new(inner: R) -> Self {
        Self {
            inner,
            line: Vec::new(),
            at: 0,
            number: 0,
            cut: false,
        }
    }

    /// Reads the next line, available from [`line`](Self::line); false at the end.
    pub(super) fn advance(&mut self) -> io::Result<bool> {
        self.line.clear();
        self.at = 0;
        self.number += 1;
        let read = (&mut self.inner)
            .take(LONGEST)
            .read_until(b'\n', &mut self.line)?;
        if self.line.last() == Some(&b'\n') {
            return Ok(true);
        }
        if read as u64 == LONGEST {
            let what = format!("a line is longer than {} MiB", LONGEST >> 20);
            return Err(io::Error::new(ErrorKind::InvalidData, what));
        }
        self.cut |= read > 0;
        self.line.clear();
        Ok(false)
    }

    /// The current line, with its line end.
    pub(super) fn line(&self) -> &[u8] {
        &self.line
    }

    /// The number of the current line, from 1.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// True if the file ended within a line.
    pub(super) fn is_cut(&self) -> bool {
        self.cut
    }
}

impl<R: BufRead> BufRead for WholeLines<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.at == self.line.len() {
            self.advance()?;
        }
        Ok(&self.line[self.at..])
    }

    fn consume(&mut self, count: usize) {
        self.at += count;
    }
}

impl<R: BufRead> Read for WholeLines<R> {
    #[inline]
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let from = self.fill_buf()?;
        let count = from.len().min(into.len());
        into[..count].copy_from_slice(&from[..count]);
        self.consume(count);
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_without_its_end_is_left_out() {
        for (text, whole, cut) in [
            ("", "", false),
            ("a", "", true),
            ("a\n", "a\n", false),
            ("a\n\nb", "a\n\n", true),
        ] {
            let mut lines = WholeLines::new(text.as_bytes());
            let mut read = String::new();
            lines.read_to_string(&mut read).expect("memory is readable");
            assert_eq!((read.as_str(), lines.is_cut()), (whole, cut), "{text:?}");
        }
    }
}
