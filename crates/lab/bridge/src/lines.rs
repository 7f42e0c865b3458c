//! Splits input into lines.

use tickbus_dispatcher::grammar::LONGEST_LINE;

/// Splits a stream of bytes into lines. Each of CR, LF and CR LF ends a line, since serial clients use all of them;
/// empty lines are dropped.
#[derive(Debug, Default)]
pub(crate) struct Lines {
    begun: Vec<u8>,
    /// The rest of the current line is too long, and is skipped.
    is_skipping: bool,
}

/// A piece of the input.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Cut {
    /// A line, without its end.
    Line(Vec<u8>),
    /// The beginning of a line that is too long. Reported once; the rest is skipped.
    TooLong,
}

impl Lines {
    /// Takes the next line from the beginning of `bytes`; `None` when all of them are taken.
    pub(crate) fn next(&mut self, bytes: &mut &[u8]) -> Option<Cut> {
        while !bytes.is_empty() {
            let end = bytes.iter().position(|byte| b"\r\n".contains(byte));
            let (part, rest) = bytes.split_at(end.unwrap_or(bytes.len()));
            *bytes = rest.get(1..).unwrap_or_default();
            if !self.is_skipping {
                self.begun.extend_from_slice(part);
                // The dispatcher's limit includes the CR LF.
                if self.begun.len() > LONGEST_LINE - 2 {
                    self.begun = Vec::new();
                    self.is_skipping = end.is_none();
                    return Some(Cut::TooLong);
                }
            }
            if end.is_some() && !std::mem::take(&mut self.is_skipping) && !self.begun.is_empty() {
                return Some(Cut::Line(std::mem::take(&mut self.begun)));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(pieces: &[&[u8]]) -> Vec<Cut> {
        let mut lines = Lines::default();
        let mut all = Vec::new();
        for piece in pieces {
            let mut rest = *piece;
            while let Some(one) = lines.next(&mut rest) {
                all.push(one);
            }
        }
        all
    }

    #[test]
    fn every_end_of_a_line_is_read_in_any_pieces() {
        let line = |text: &[u8]| Cut::Line(text.to_vec());
        let expected = [line(b"LIST"), line(b"PING"), line(b"BYE"), line(b"P")];
        let text = b"LIST\rPING\nBYE\r\n\r\n\nP\r\nrest";
        assert_eq!(cut(&[text]), expected);
        let bytes: Vec<&[u8]> = text.chunks(1).collect();
        assert_eq!(cut(&bytes), expected);
    }

    #[test]
    fn a_line_that_is_too_long_is_reported_once_and_the_next_one_counts() {
        let longest = vec![b'x'; LONGEST_LINE - 2];
        let long = vec![b'x'; LONGEST_LINE - 1];
        let expected = [Cut::TooLong, Cut::Line(b"PING".to_vec())];
        assert_eq!(cut(&[&long, b"\nPING\n"]), expected);
        assert_eq!(cut(&[&[&*long, b"\nPING\n"].concat()]), expected);
        assert_eq!(cut(&[&long, &long, &long, b"\r", b"\nPING\n"]), expected);
        assert_eq!(cut(&[&longest, b"\n"]), [Cut::Line(longest.clone())]);
    }
}
