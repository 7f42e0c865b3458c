//! The content of a file: bytes in, bytes out, and no I/O.

use std::fmt;

/// The size of the two numbers before the image, in bytes.
const HEAD: usize = 16;

/// A frame: the sender's image, and the number of the last frame that the sender has seen from the other end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Counts the sender's frames; 0 before the first.
    pub sequence: u64,
    /// The sequence of the peer's frame that the sender has taken over.
    pub seen: u64,
    /// The frames of all stations, in their order; empty before the first.
    pub image: Vec<u8>,
    /// True once the peer has seen the frame. This is not sent.
    pub confirmed: bool,
}

impl Default for Frame {
    fn default() -> Self {
        Self {
            sequence: 0,
            seen: 0,
            image: Vec::new(),
            confirmed: true,
        }
    }
}

/// Bytes that are not a frame, and the reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoFrame {
    expected: usize,
    found: usize,
}

impl fmt::Display for NoFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the peer's file has {} bytes, expected {HEAD} and an image of {}; both ends need the same signals",
            self.found, self.expected
        )
    }
}

impl Frame {
    /// Returns the bytes of the file.
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HEAD + self.image.len());
        bytes.extend_from_slice(&self.sequence.to_be_bytes());
        bytes.extend_from_slice(&self.seen.to_be_bytes());
        bytes.extend_from_slice(&self.image);
        bytes
    }

    /// Reads a file with an image of `expected` bytes, or without an image yet.
    ///
    /// # Errors
    ///
    /// The file has another length.
    pub fn parse(bytes: &[u8], expected: usize) -> Result<Self, NoFrame> {
        let wrong = NoFrame {
            expected,
            found: bytes.len(),
        };
        let (head, image) = bytes.split_at_checked(HEAD).ok_or_else(|| wrong.clone())?;
        let (sequence, seen) = head.split_at(8);
        let number = |bytes: &[u8]| u64::from_be_bytes(bytes.try_into().expect("eight bytes"));
        let frame = Self {
            sequence: number(sequence),
            seen: number(seen),
            image: image.to_vec(),
            confirmed: false,
        };
        let is_whole = image.len() == expected || (image.is_empty() && frame.sequence == 0);
        is_whole.then_some(frame).ok_or(wrong)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_reads_back_and_every_other_length_is_refused() {
        let frame = Frame {
            sequence: 7,
            seen: 3,
            image: vec![1, 2, 3],
            confirmed: false,
        };
        let bytes = frame.bytes();
        assert_eq!(Frame::parse(&bytes, 3), Ok(frame));
        for length in 0..bytes.len() {
            assert!(Frame::parse(&bytes[..length], 3).is_err(), "{length}");
        }
        assert!(Frame::parse(&bytes, 4).is_err());
        assert!(Frame::parse(&Frame::default().bytes(), 4).is_ok());
    }
}
