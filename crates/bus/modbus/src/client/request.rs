//! The client's half of the codec: requests, and their possible answers.

use std::fmt;

use tickbus_fieldbus::copy_bits;

use crate::function::EXCEPTION_BIT;
use crate::table::{Span, Table};
use crate::{ElementAddress, Exception, Function, identification};

use crate::Piece;

/// Consecutive elements of a table, and the bits of a frame that they carry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    /// The table.
    pub table: Table,
    /// The elements.
    pub span: Span,
    /// The pieces in the elements, in order of place; adjacent ones are merged.
    pub pieces: Vec<Piece>,
    /// True if there are elements between the pieces that belong to none of them.
    pub joined: bool,
}

impl Region {
    /// These elements, without pieces.
    pub const fn new(table: Table, span: Span) -> Self {
        Self {
            table,
            span,
            pieces: Vec::new(),
            joined: false,
        }
    }

    /// Adds a piece, in order of place.
    pub(super) fn take(&mut self, piece: Piece) {
        if let Some(last) = self.pieces.last_mut()
            && last.wire + last.bits == piece.wire
            && last.bit + last.bits == piece.bit
        {
            last.bits += piece.bits;
            return;
        }
        self.pieces.push(piece);
    }

    /// Bytes of the elements on the wire.
    pub(super) const fn bytes(&self) -> usize {
        (self.span.count * self.table.width()).div_ceil(8)
    }

    /// The first bit of a piece, counted from the first element.
    const fn bit(&self, piece: &Piece) -> usize {
        piece.wire - self.span.first * self.table.width()
    }

    /// The number of bits that belong to no piece, and are written as zero.
    pub fn zeros(&self) -> usize {
        let own: usize = self.pieces.iter().map(|piece| piece.bits).sum();
        // Overlapping pieces count twice; a driver.cfg must not have them where it writes.
        (self.span.count * self.table.width()).saturating_sub(own)
    }

    /// Appends the elements' values, with zeros between the pieces.
    fn append(&self, sends: &[u8], pdu: &mut Vec<u8>) {
        let begin = pdu.len();
        pdu.resize(begin + self.bytes(), 0);
        for piece in &self.pieces {
            let to = self.bit(piece);
            copy_bits(sends, piece.bit, piece.bits, &mut pdu[begin..], to);
        }
    }

    /// Copies the pieces from the elements' values.
    fn scatter(&self, values: &[u8], receives: &mut [u8]) {
        for piece in &self.pieces {
            copy_bits(values, self.bit(piece), piece.bits, receives, piece.bit);
        }
    }

    /// The bits that pieces cover in the region's only register.
    fn mask(&self) -> u16 {
        let mut mask = [0; 2];
        for piece in &self.pieces {
            copy_bits(&[0xFF; 2], 0, piece.bits, &mut mask, self.bit(piece));
        }
        u16::from_be_bytes(mask)
    }
}

/// The elements in both notations, for messages.
impl fmt::Display for Region {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Span { first, count } = self.span;
        let table = self.table;
        ElementAddress {
            table,
            offset: first,
        }
        .fmt(f)?;
        match count {
            0 | 1 => Ok(()),
            _ => write!(f, " to {}", first + count - 1),
        }
    }
}

/// One request of the client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Reads elements.
    Read(Region),
    /// Writes consecutive elements.
    Write(Region),
    /// Writes one element, for a device that cannot write several.
    WriteOne(Region),
    /// Writes bits of one register without changing the others.
    Mask(Region),
    /// Writes, then reads; both holding registers.
    Both {
        /// The elements to write.
        write: Region,
        /// The elements to read.
        read: Region,
    },
}

/// Why an answer is not valid data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AnswerError {
    /// The server refused.
    Refused(Exception),
    /// The answer violates the standard.
    Malformed(String),
}

impl Request {
    /// The function code.
    pub const fn function(&self) -> Function {
        match self {
            Self::Both { .. } => Function::ReadWriteRegisters,
            Self::Mask(_) => Function::MaskWriteRegister,
            Self::Read(region) => match region.table {
                Table::Coils => Function::ReadCoils,
                Table::DiscreteInputs => Function::ReadDiscreteInputs,
                Table::InputRegisters => Function::ReadInputRegisters,
                Table::HoldingRegisters => Function::ReadHoldingRegisters,
            },
            Self::Write(region) if region.table.is_bits() => Function::WriteCoils,
            Self::Write(_) => Function::WriteRegisters,
            Self::WriteOne(region) if region.table.is_bits() => Function::WriteCoil,
            Self::WriteOne(_) => Function::WriteRegister,
        }
    }

    /// The elements that the request reads.
    pub const fn read(&self) -> Option<&Region> {
        match self {
            Self::Read(read) | Self::Both { read, .. } => Some(read),
            _ => None,
        }
    }

    /// The elements that the request writes.
    pub const fn write(&self) -> Option<&Region> {
        match self {
            Self::Write(write)
            | Self::WriteOne(write)
            | Self::Mask(write)
            | Self::Both { write, .. } => Some(write),
            Self::Read(_) => None,
        }
    }

    /// True if the request only checks that the device is there: the values read are ignored.
    pub(super) fn is_look(&self) -> bool {
        matches!(self, Self::Read(read) if read.pieces.is_empty())
    }

    /// The length of the answer's PDU.
    pub fn answer_length(&self) -> usize {
        match self.read() {
            Some(read) => 2 + read.bytes(),
            None => 7,
        }
    }

    /// Appends the request's PDU, with values from `sends`.
    ///
    /// # Panics
    ///
    /// When `sends` is too short, or the query exceeds the limits.
    pub fn append(&self, sends: &[u8], pdu: &mut Vec<u8>) {
        pdu.push(self.function().code());
        if let Some(read) = self.read() {
            append_span(read.span, pdu);
        }
        match self {
            Self::Read(_) => {}
            Self::Write(write) | Self::Both { write, .. } => {
                append_span(write.span, pdu);
                pdu.push(u8::try_from(write.bytes()).expect("the limits keep it below"));
                write.append(sends, pdu);
            }
            Self::WriteOne(write) => {
                append_word(write.span.first, pdu);
                let begin = pdu.len();
                write.append(sends, pdu);
                if write.table.is_bits() {
                    let on = pdu[begin] & 1 == 1;
                    pdu.truncate(begin);
                    pdu.extend_from_slice(if on { &[0xFF, 0] } else { &[0, 0] });
                }
            }
            Self::Mask(write) => {
                append_word(write.span.first, pdu);
                pdu.extend_from_slice(&(!write.mask()).to_be_bytes());
                write.append(sends, pdu);
            }
        }
    }

    /// Copies the values in the answer `pdu` to the request `asked` into `receives`.
    ///
    /// # Errors
    ///
    /// The answer is a refusal, or malformed; then nothing was copied.
    pub fn take(&self, asked: &[u8], pdu: &[u8], receives: &mut [u8]) -> Result<(), AnswerError> {
        let data = expect(self.function(), pdu)?;
        let Some(read) = self.read() else {
            // An answer to writing several elements has their address and count; an answer to writing one has the whole
            // request.
            let echo = match self {
                Self::Write(_) => asked.get(1..5),
                _ => asked.get(1..),
            };
            let echo = echo.unwrap_or_default();
            return if data == echo {
                Ok(())
            } else {
                Err(AnswerError::Malformed(format!(
                    "its answer to a write is {data:02X?}, where the request's {echo:02X?} belongs"
                )))
            };
        };
        let expected = read.bytes();
        match data.split_first() {
            Some((counted, values))
                if usize::from(*counted) == expected && values.len() == expected =>
            {
                read.scatter(values, receives);
                Ok(())
            }
            _ => Err(AnswerError::Malformed(format!(
                "its answer has {} bytes behind the function code, where a count and {expected} bytes belong",
                data.len()
            ))),
        }
    }
}

/// The query in words, for messages.
impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let code = self.function().code();
        match self {
            Self::Read(read) => write!(f, "read {read} (function {code})"),
            Self::Write(write) | Self::WriteOne(write) => {
                write!(f, "write {write} (function {code})")
            }
            Self::Mask(write) => {
                let mask = write.mask();
                let bits = (0..16).filter(|bit| mask >> bit & 1 == 1);
                let bits: Vec<String> = bits.map(|bit: u8| bit.to_string()).collect();
                let word = if bits.len() == 1 { "bit" } else { "bits" };
                write!(
                    f,
                    "write {word} {} of {write} (function {code})",
                    bits.join(", ")
                )
            }
            Self::Both { write, read } => {
                write!(f, "write {write} and read {read} (function {code})")
            }
        }
    }
}

/// The bytes after the function code of an answer, if that is the expected one.
pub(super) fn expect(function: Function, pdu: &[u8]) -> Result<&[u8], AnswerError> {
    let code = function.code();
    match *pdu {
        [given, ref data @ ..] if given == code => Ok(data),
        [given, exception] if given == code | EXCEPTION_BIT => {
            Err(AnswerError::Refused(Exception(exception)))
        }
        [given, ..] => Err(AnswerError::Malformed(format!(
            "its answer has the function code {given} with {} bytes of data, where {code} was asked for",
            pdu.len() - 1
        ))),
        [] => Err(AnswerError::Malformed("its answer is empty".to_owned())),
    }
}

/// The length of an answer that starts like this, function code first, as soon as it is determined. With RTU there is
/// no other way to know the length before the silence.
pub(super) fn length(beginning: &[u8]) -> Option<usize> {
    let (&code, data) = beginning.split_first()?;
    if code & EXCEPTION_BIT != 0 {
        return Some(2);
    }
    match Function::of(code)? {
        Function::ReadCoils
        | Function::ReadDiscreteInputs
        | Function::ReadHoldingRegisters
        | Function::ReadInputRegisters
        | Function::ReadWriteRegisters
        | Function::ReportServerId
        | Function::CommEventLog
        | Function::ReadFileRecord
        | Function::WriteFileRecord => Some(2 + usize::from(*data.first()?)),
        Function::WriteCoil
        | Function::WriteRegister
        | Function::WriteCoils
        | Function::WriteRegisters
        | Function::Diagnostics
        | Function::CommEventCounter => Some(5),
        Function::ReadExceptionStatus => Some(2),
        Function::ReadFifoQueue => {
            let count = data.first_chunk::<2>()?;
            Some(3 + usize::from(u16::from_be_bytes(*count)))
        }
        Function::MaskWriteRegister => Some(7),
        Function::DeviceIdentification => identification::length(beginning),
    }
}

fn append_word(word: usize, pdu: &mut Vec<u8>) {
    let word = u16::try_from(word).expect("a table has 65,536 elements");
    pdu.extend_from_slice(&word.to_be_bytes());
}

fn append_span(span: Span, pdu: &mut Vec<u8>) {
    append_word(span.first, pdu);
    append_word(span.count, pdu);
}

#[cfg(test)]
mod tests;
