//! The header of Modbus TCP, in front of a PDU.

use super::{PDU_LIMIT, answer};
use tickbus_fieldbus::faults::WrongAnswer;

/// Transaction, protocol, length, unit.
pub const HEADER: usize = 7;

/// The longest telegram.
pub const ADU_LIMIT: usize = HEADER + PDU_LIMIT;

/// One telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Telegram<'a> {
    /// Chosen by the client, repeated in the answer.
    pub transaction: u16,
    /// The addressed unit.
    pub unit: u8,
    /// Function code and data; never empty, at most [`PDU_LIMIT`] bytes.
    pub pdu: &'a [u8],
}

/// Why bytes are not a telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TelegramError {
    /// The protocol identifier is not that of Modbus.
    #[error("its header has the protocol {0}, and Modbus is 0; check that it speaks Modbus TCP")]
    Protocol(u16),
    /// No telegram can have this length.
    #[error(
        "its header has the length {0}, and from 2 to 254 are possible; check that it speaks Modbus TCP"
    )]
    Length(u16),
}

impl<'a> Telegram<'a> {
    /// The telegram at the start of `bytes`, and its length; `None` if it is not complete yet.
    ///
    /// # Errors
    ///
    /// The bytes cannot become a telegram.
    pub fn parse(bytes: &'a [u8]) -> Result<Option<(Self, usize)>, TelegramError> {
        let word = |at: usize| {
            let pair = bytes.get(at..at + 2)?;
            Some(u16::from_be_bytes([pair[0], pair[1]]))
        };
        if let Some(protocol) = word(2)
            && protocol != 0
        {
            return Err(TelegramError::Protocol(protocol));
        }
        let Some(length) = word(4) else {
            return Ok(None);
        };
        let end = 6 + usize::from(length);
        if end <= HEADER || end > ADU_LIMIT {
            return Err(TelegramError::Length(length));
        }
        let Some(whole) = bytes.get(..end) else {
            return Ok(None);
        };
        let telegram = Self {
            transaction: u16::from_be_bytes([whole[0], whole[1]]),
            unit: whole[6],
            pdu: &whole[HEADER..],
        };
        Ok(Some((telegram, end)))
    }
}

/// Appends a telegram, whose PDU `write` appends; appends nothing if `write` does not.
pub fn append<R>(
    transaction: u16,
    unit: u8,
    bytes: &mut Vec<u8>,
    write: impl FnOnce(&mut Vec<u8>) -> R,
) -> R {
    let begin = bytes.len();
    let [high, low] = transaction.to_be_bytes();
    bytes.extend_from_slice(&[high, low, 0, 0, 0, 0, unit]);
    let result = write(bytes);
    if bytes.len() == begin + HEADER {
        bytes.truncate(begin);
        return result;
    }
    state_length(bytes, begin);
    result
}

/// Writes the length of the telegram that begins at `begin`, the last one in `bytes`, into its header.
fn state_length(bytes: &mut [u8], begin: usize) {
    let length = u16::try_from(bytes.len() - begin - 6).expect("a PDU is short");
    bytes[begin + 4..begin + 6].copy_from_slice(&length.to_be_bytes());
}

/// Spoils the last answer in `bytes`, which [`append`] wrote from `begin` on.
pub(crate) fn spoil(bytes: &mut Vec<u8>, begin: usize, wrong: WrongAnswer) {
    if bytes.len() <= begin + HEADER {
        return;
    }
    match wrong {
        WrongAnswer::Truncated => drop(bytes.pop()),
        WrongAnswer::Short => answer::shorten(bytes, begin + HEADER),
        WrongAnswer::Transaction => bytes[begin + 1] = bytes[begin + 1].wrapping_add(1),
        WrongAnswer::Unit => bytes[begin + 6] = bytes[begin + 6].wrapping_add(1),
    }
    state_length(bytes, begin);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_telegram_is_read_as_it_is_written_and_every_truncation_waits() {
        let mut bytes = Vec::new();
        append(0x1233, 7, &mut bytes, |_| ());
        append(0x1234, 7, &mut bytes, |pdu| pdu.extend([3, 0, 0, 0, 1]));
        assert_eq!(
            bytes,
            [0x12, 0x34, 0, 0, 0, 6, 7, 3, 0, 0, 0, 1],
            "big-endian"
        );
        for cut in 0..bytes.len() {
            assert_eq!(Telegram::parse(&bytes[..cut]), Ok(None), "{cut} bytes");
        }
        bytes.push(0xFF);
        let telegram = Telegram {
            transaction: 0x1234,
            unit: 7,
            pdu: &[3, 0, 0, 0, 1],
        };
        assert_eq!(Telegram::parse(&bytes), Ok(Some((telegram, 12))));
    }

    #[test]
    fn what_cannot_become_a_telegram_is_told_at_once() {
        for (bytes, expected) in [
            (&[0, 1, 0, 1][..], TelegramError::Protocol(1)),
            (&[0, 1, 0x47, 0x45, 0, 6], TelegramError::Protocol(0x4745)),
            (&[0, 1, 0, 0, 0, 0], TelegramError::Length(0)),
            (&[0, 1, 0, 0, 0, 1], TelegramError::Length(1)),
            (&[0, 1, 0, 0, 0, 255], TelegramError::Length(255)),
            (&[0, 1, 0, 0, 0xFF, 0xFF], TelegramError::Length(0xFFFF)),
        ] {
            assert_eq!(Telegram::parse(bytes), Err(expected));
        }
        assert_eq!(Telegram::parse(&[0, 1, 0, 0, 0, 254]), Ok(None));
    }
}
