//! The encoding of damaged characters by a serial port.

/// Characters off a line, with the damaged ones marked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Characters<'a> {
    /// All characters; a damaged one has the value that was read.
    pub bytes: &'a [u8],
    /// The indices of characters with wrong parity, without a stop bit, or of a break; ascending.
    pub damaged: &'a [usize],
}

impl<'a> From<&'a [u8]> for Characters<'a> {
    /// Sound characters.
    fn from(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            damaged: &[],
        }
    }
}

/// Decodes the output of [`SerialPort::mark_damaged`](super::SerialPort::mark_damaged): `FF FF` is the character FF,
/// `FF 00 x` a damaged x, and any other byte is itself. A code may be split anywhere between two reads.
#[derive(Debug, Default)]
pub struct Marks {
    code: Code,
    bytes: Vec<u8>,
    damaged: Vec<usize>,
}

/// The part of a code that has arrived.
#[derive(Clone, Copy, Debug, Default)]
enum Code {
    #[default]
    None,
    /// `FF`.
    Begun,
    /// `FF 00`.
    Damaged,
}

impl Marks {
    /// The characters that `read` completes.
    pub fn read(&mut self, read: &[u8]) -> Characters<'_> {
        self.bytes.clear();
        self.damaged.clear();
        for &byte in read {
            self.code = match (self.code, byte) {
                (Code::None, 0xFF) => Code::Begun,
                (Code::Begun, 0) => Code::Damaged,
                (code, _) => {
                    // A port sends no other code after FF: a character was lost.
                    if matches!(code, Code::Damaged) || matches!(code, Code::Begun) && byte != 0xFF
                    {
                        self.damaged.push(self.bytes.len());
                    }
                    self.bytes.push(byte);
                    Code::None
                }
            };
        }
        Characters {
            bytes: &self.bytes,
            damaged: &self.damaged,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_read_wherever_they_are_cut() {
        let line = [
            0x10, 0xFF, 0xFF, 0, 0xFF, 0, 0x80, 0xFF, 0, 0xFF, 0xFF, 0, 0, 0xFF, 7, 0x16,
        ];
        let bytes = [0x10, 0xFF, 0, 0x80, 0xFF, 0, 7, 0x16];
        let damaged = [3, 4, 5, 6];
        for cut in 0..=line.len() {
            let mut marks = Marks::default();
            let first = marks.read(&line[..cut]);
            let mut all = first.bytes.to_vec();
            let mut wrong = first.damaged.to_vec();
            let second = marks.read(&line[cut..]);
            wrong.extend(second.damaged.iter().map(|index| index + all.len()));
            all.extend(second.bytes);
            assert_eq!((&all[..], &wrong[..]), (&bytes[..], &damaged[..]), "{cut}");
        }
    }
}
