//! The two codings of telegrams on a serial line.

use super::{ascii, rtu};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::WrongAnswer;

/// The coding of telegrams on a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coding {
    /// Bytes, delimited by silence.
    Rtu,
    /// Hexadecimal digits, delimited by other characters.
    Ascii,
}

impl Coding {
    /// Appends a telegram, whose PDU `write` appends; appends nothing if `write` does not.
    pub(super) fn append<R>(
        self,
        unit: u8,
        line: &mut Vec<u8>,
        write: impl FnOnce(&mut Vec<u8>) -> R,
    ) -> R {
        match self {
            Self::Rtu => rtu::append(unit, line, write),
            Self::Ascii => ascii::append(unit, line, write),
        }
    }

    /// Unit and PDU of a telegram's bytes; `None` if it is damaged.
    pub(super) fn parse(self, telegram: &[u8]) -> Option<(u8, &[u8])> {
        match self {
            Self::Rtu => rtu::parse(telegram),
            Self::Ascii => ascii::parse(telegram),
        }
    }

    /// Spoils the last answer on `line`, which was [appended](Self::append) from `begin` on.
    pub(super) fn spoil(self, line: &mut Vec<u8>, begin: usize, wrong: WrongAnswer) {
        match self {
            Self::Rtu => rtu::spoil(line, begin, wrong),
            Self::Ascii => ascii::spoil(line, begin, wrong),
        }
    }

    /// Returns true if `line` is the telegram with these bytes.
    pub(super) fn is_of(self, line: &[u8], telegram: &[u8]) -> bool {
        match self {
            Self::Rtu => line == telegram,
            Self::Ascii => ascii::is_of(line, telegram),
        }
    }

    /// The characters on the line for a PDU of this many bytes.
    pub(super) const fn characters(self, pdu: usize) -> usize {
        match self {
            Self::Rtu => 1 + pdu + rtu::CHECKSUM,
            Self::Ascii => ascii::characters(1 + pdu + 1),
        }
    }
}

/// Splits the characters on a line into telegrams.
#[derive(Debug)]
pub(super) enum Framer {
    Rtu(rtu::Framer),
    Ascii(ascii::Framer),
}

impl Framer {
    /// A framer for this coding, with the `silence` that ends a telegram, or gives one up.
    pub(super) fn new(coding: Coding, silence: Nanos) -> Self {
        match coding {
            Coding::Rtu => Self::Rtu(rtu::Framer::new(silence)),
            Coding::Ascii => Self::Ascii(ascii::Framer::new(silence)),
        }
    }

    /// Takes characters that arrived at `now` out of `characters`, up to the end of a telegram.
    pub(super) fn arrived(&mut self, now: Nanos, characters: &mut &[u8]) {
        match self {
            Self::Rtu(framer) => framer.arrived(now, std::mem::take(characters)),
            Self::Ascii(framer) => framer.arrived(now, characters),
        }
    }

    /// When the line has to be looked at again without new characters.
    pub(super) fn deadline(&self) -> Nanos {
        match self {
            Self::Rtu(framer) => framer.deadline(),
            Self::Ascii(framer) => framer.deadline(),
        }
    }

    /// If a telegram has ended by `now`, passes its bytes to `take`; or `None` if it was longer than any telegram.
    pub(super) fn take<R>(
        &mut self,
        now: Nanos,
        take: impl FnOnce(Option<&[u8]>) -> R,
    ) -> Option<R> {
        match self {
            Self::Rtu(framer) => framer.take(now, take),
            Self::Ascii(framer) => framer.take(now, take),
        }
    }
}
