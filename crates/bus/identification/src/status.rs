//! The status in every answer about a carrier.

use std::fmt;

/// A status, by the two hexadecimal digits of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Status(pub u8);

impl Status {
    /// The command was executed.
    pub const DONE: Self = Self(0x00);
    /// The command is unknown.
    pub const UNKNOWN_COMMAND: Self = Self(0x01);
    /// There is no head.
    pub const NO_HEAD: Self = Self(0x02);
    /// There is no carrier before the head.
    pub const NO_CARRIER: Self = Self(0x03);
    /// The carrier rejected a write.
    pub const WRITE_ERROR: Self = Self(0x04);
    /// The command was damaged on the line.
    pub const LINE_CHECKSUM: Self = Self(0x06);
    /// The address, or the length, is beyond the carrier.
    pub const OUT_OF_RANGE: Self = Self(0x09);
    /// The reader does not reach the head.
    pub const HEAD_SILENT: Self = Self(0x0A);
    /// The carrier does not have this function.
    pub const UNSUPPORTED: Self = Self(0x0D);
    /// The head is of another kind.
    pub const HEAD_UNSUITABLE: Self = Self(0x0E);
    /// The command was executed, and the carrier's battery is low.
    pub const BATTERY_LOW: Self = Self(0x10);

    /// True if the command was executed, so that a reading answer has data.
    pub const fn is_done(self) -> bool {
        matches!(self, Self::DONE | Self::BATTERY_LOW)
    }

    /// True if the head itself is missing, or is the wrong one.
    pub const fn is_of_the_head(self) -> bool {
        matches!(
            self,
            Self::NO_HEAD | Self::HEAD_SILENT | Self::HEAD_UNSUITABLE
        )
    }

    /// True if the status implies a carrier in front of the head.
    pub const fn is_of_a_carrier(self) -> bool {
        matches!(self.0, 0x00 | 0x04 | 0x08 | 0x0C | 0x0D | 0x10 | 0x11)
    }

    /// The meaning and the remedy; for a code that is not in the manual, just that.
    pub const fn sentence(self) -> &'static str {
        match self.0 {
            0x00 => "done",
            0x01 => "the reader does not know the command; check that it is in read/write mode",
            0x02 => "the head is not connected, or not ready; check its cable",
            0x03 => "no carrier is before the head, or it cannot transmit",
            0x04 => "the carrier did not take the data; check that it is not protected",
            0x05 => "the reader's EPROM is faulty; replace the reader",
            0x06 => "the command was damaged on the serial line; check cable, shield and rate",
            0x07 => "the reader's RAM is faulty; replace the reader",
            0x08 => {
                "the carrier's data were damaged on their way; bring it nearer, or keep it there longer"
            }
            0x09 => {
                "address or length is beyond the carrier; check them, and the type of the carrier"
            }
            0x0A => "the reader does not reach its head; check the head's cable",
            0x0B => "the reader was reset by its watchdog; give the command again",
            0x0C => "the echo from the carrier was wrong; bring it nearer, or keep it there longer",
            0x0D => "the carrier does not have this function; check the type of the carrier",
            0x0E => "the head does not suit this reader; connect a read/write head",
            0x0F => "the reader's synchronisation failed; give the command again",
            0x10 => "done, and the carrier's battery is low; replace it",
            0x11 => "the carrier did not acknowledge; bring it nearer, or keep it there longer",
            _ => "the manual does not have this status",
        }
    }

    /// The digits in an answer.
    pub(crate) fn digits(self) -> [u8; 2] {
        super::hex::digits(self.0)
    }
}

/// The sentence, and the digits.
impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (status {:02X})", self.sentence(), self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_status_of_the_manual_has_its_own_sentence_and_no_other_has_one() {
        let unknown = Status(0xFF).sentence();
        let known = (0..=u8::MAX).map(Status);
        let known: Vec<Status> = known.filter(|code| code.sentence() != unknown).collect();
        assert_eq!(known, (0..=0x11).map(Status).collect::<Vec<_>>());
        let mut sentences: Vec<&str> = known.iter().map(|code| code.sentence()).collect();
        sentences.sort_unstable();
        sentences.dedup();
        assert_eq!(sentences.len(), known.len());
        let done = known.into_iter().filter(|code| code.is_done());
        assert_eq!(done.collect::<Vec<_>>(), [Status(0), Status(0x10)]);
        assert_eq!(Status(0x0B).digits(), *b"0B");
        assert!(Status(3).to_string().ends_with("(status 03)"));
    }
}
