//! Modbus RTU: telegrams with a checksum, delimited by silence, or in a TCP stream by their length.

use super::{Function, PDU_LIMIT, answer};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::WrongAnswer;

/// Bytes of the checksum.
pub const CHECKSUM: usize = 2;

/// The longest telegram: unit, PDU, checksum.
pub const ADU_LIMIT: usize = 1 + PDU_LIMIT + CHECKSUM;

/// The shortest: unit, function code, checksum.
const SHORTEST: usize = 4;

/// Bits of one character: start, eight data, parity or a second stop, stop.
const CHARACTER: i64 = 11;

/// Above this speed, in bits per second, the silence is constant.
const FASTEST: u32 = 19_200;

/// The silence between two telegrams above that speed.
const LEAST_SILENCE: Nanos = Nanos::from_micros(1_750);

/// The silence that ends a telegram: 3.5 characters, and above 19,200 bits per second 1.75 ms.
pub fn silence(baud: u32) -> Nanos {
    if baud > FASTEST {
        return LEAST_SILENCE;
    }
    let half_character = CHARACTER * 1_000_000_000 / (2 * i64::from(baud.max(1)));
    Nanos(7 * half_character)
}

/// Duration of one character.
pub fn character(baud: u32) -> Nanos {
    Nanos(CHARACTER * 1_000_000_000 / i64::from(baud.max(1)))
}

/// The checksum of a telegram's bytes in wire order: low byte first.
pub fn checksum(bytes: &[u8]) -> [u8; 2] {
    let mut crc = 0xFFFF_u16;
    for byte in bytes {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            let carry = crc & 1 == 1;
            crc >>= 1;
            if carry {
                crc ^= 0xA001;
            }
        }
    }
    crc.to_le_bytes()
}

/// Appends a telegram, whose PDU `write` appends; appends nothing if `write` does not.
pub fn append<R>(unit: u8, bytes: &mut Vec<u8>, write: impl FnOnce(&mut Vec<u8>) -> R) -> R {
    let begin = bytes.len();
    bytes.push(unit);
    let result = write(bytes);
    if bytes.len() == begin + 1 {
        bytes.truncate(begin);
        return result;
    }
    let checksum = checksum(&bytes[begin..]);
    bytes.extend_from_slice(&checksum);
    result
}

/// Spoils the last answer in `bytes`, which [`append`] wrote from `begin` on. Its checksum is right: damaged telegrams are
/// for the line to make. An answer has no number here, so it comes from another unit in that case, too.
pub(crate) fn spoil(bytes: &mut Vec<u8>, begin: usize, wrong: WrongAnswer) {
    if bytes.len() < begin + SHORTEST {
        return;
    }
    bytes.truncate(bytes.len() - CHECKSUM);
    match wrong {
        WrongAnswer::Truncated => drop(bytes.pop()),
        WrongAnswer::Short => answer::shorten(bytes, begin + 1),
        WrongAnswer::Transaction | WrongAnswer::Unit => bytes[begin] = bytes[begin].wrapping_add(1),
    }
    let checksum = checksum(&bytes[begin..]);
    bytes.extend_from_slice(&checksum);
}

/// Unit and PDU of a complete telegram; `None` if its length or its checksum is wrong.
pub fn parse(telegram: &[u8]) -> Option<(u8, &[u8])> {
    if !(SHORTEST..=ADU_LIMIT).contains(&telegram.len()) {
        return None;
    }
    let (body, sum) = telegram.split_last_chunk::<CHECKSUM>()?;
    (checksum(body) == *sum).then(|| (body[0], &body[1..]))
}

/// Why bytes in a stream are not a telegram. The start of the next one is then unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StreamError {
    /// A telegram with this function code has no known length, or none that is possible.
    #[error(
        "its telegram has the function {0} and no length that is known; check that it speaks RTU over TCP"
    )]
    Length(u8),
    /// The checksum does not belong to the bytes before it.
    #[error(
        "its telegram has a wrong checksum; check that it speaks RTU over TCP, and whether a serial line behind it \
         is disturbed"
    )]
    Checksum,
}

/// A telegram of a stream: unit, PDU, and the length of the whole, in bytes.
pub type Streamed<'a> = (u8, &'a [u8], usize);

/// The telegram at the start of a stream's `bytes`; `None` if it is not complete yet. `length` returns the length of a
/// PDU, in bytes, once enough of its beginning is there.
///
/// # Errors
///
/// The bytes cannot become a telegram.
pub fn split(
    bytes: &[u8],
    length: impl FnOnce(&[u8]) -> Option<usize>,
) -> Result<Option<Streamed<'_>>, StreamError> {
    let [_, pdu @ ..] = bytes else {
        return Ok(None);
    };
    let Some(&code) = pdu.first() else {
        return Ok(None);
    };
    let end = match length(pdu) {
        Some(length) if length <= PDU_LIMIT => 1 + length + CHECKSUM,
        None if Function::of(code).is_some() && bytes.len() < ADU_LIMIT => return Ok(None),
        _ => return Err(StreamError::Length(code)),
    };
    let Some(telegram) = bytes.get(..end) else {
        return Ok(None);
    };
    let (unit, pdu) = parse(telegram).ok_or(StreamError::Checksum)?;
    Ok(Some((unit, pdu, end)))
}

/// Splits the bytes on a line into telegrams, by the silence between them.
#[derive(Debug)]
pub struct Framer {
    silence: Nanos,
    bytes: Vec<u8>,
    /// Longer than any telegram: the rest cannot be one either.
    overlong: bool,
    /// When the last byte arrived.
    last: Option<Nanos>,
}

impl Framer {
    /// A framer with this silence between telegrams.
    pub fn new(silence: Nanos) -> Self {
        Self {
            silence,
            bytes: Vec::with_capacity(ADU_LIMIT),
            overlong: false,
            last: None,
        }
    }

    /// These bytes arrived at `now`. A telegram that silence has ended before must already be [taken](Self::take).
    pub fn arrived(&mut self, now: Nanos, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        self.last = Some(now);
        let room = ADU_LIMIT - self.bytes.len();
        self.overlong |= bytes.len() > room;
        self.bytes
            .extend_from_slice(&bytes[..bytes.len().min(room)]);
    }

    /// How long to wait for silence; [`Nanos::MAX`] if nothing has arrived.
    pub fn deadline(&self) -> Nanos {
        self.last.map_or(Nanos::MAX, |last| last + self.silence)
    }

    /// True if the line has been silent for long enough at `now`.
    fn is_silent(&self, now: Nanos) -> bool {
        self.last.is_none_or(|last| now >= last + self.silence)
    }

    /// If silence has ended a telegram by `now`, passes it to `take`; or `None` if it was longer than any telegram.
    pub fn take<R>(&mut self, now: Nanos, take: impl FnOnce(Option<&[u8]>) -> R) -> Option<R> {
        if self.last.is_none() || !self.is_silent(now) {
            return None;
        }
        let result = take((!self.overlong).then_some(&self.bytes));
        self.clear();
        Some(result)
    }

    fn clear(&mut self) {
        self.bytes.clear();
        self.overlong = false;
        self.last = None;
    }
}

/// The echo of sent bytes, as of a two-wire adapter whose receiver stays enabled.
#[derive(Debug)]
pub struct Echo {
    /// Duration of one character.
    character: Nanos,
    expected: Vec<u8>,
    /// After this time the rest of the echo will not arrive.
    until: Nanos,
}

impl Echo {
    /// The tolerated delay of an echo: adapters buffer received bytes for up to 16 ms.
    const SLACK: Nanos = Nanos::from_millis(50);

    /// The echo of a line at this speed.
    pub fn new(baud: u32) -> Self {
        Self {
            character: character(baud),
            expected: Vec::new(),
            until: Nanos::ZERO,
        }
    }

    /// These bytes were sent at `now`.
    pub fn sent(&mut self, now: Nanos, bytes: &[u8]) {
        if now > self.until {
            self.expected.clear();
        }
        self.expected.extend_from_slice(bytes);
        let characters = i64::try_from(self.expected.len()).unwrap_or(i64::MAX);
        self.until = now + self.character.times(characters) + Self::SLACK;
    }

    /// The number of bytes, among those that arrived at `now`, that are the echo of sent ones. The first byte that
    /// differs ends the echo.
    pub fn strip(&mut self, now: Nanos, bytes: &[u8]) -> usize {
        if now > self.until {
            self.expected.clear();
        }
        let pairs = self.expected.iter().zip(bytes);
        let count = pairs
            .take_while(|(expected, came)| expected == came)
            .count();
        if count < bytes.len() {
            self.expected.clear();
        } else {
            self.expected.drain(..count);
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answer;

    /// A request for two holding registers of unit 1, found in many manuals.
    const READ: [u8; 8] = [1, 3, 0, 0, 0, 2, 0xC4, 0x0B];

    #[test]
    fn the_checksum_is_the_one_of_the_standard() {
        assert_eq!(checksum(&READ[..6]), READ[6..]);
        // The standard's worked example.
        assert_eq!(checksum(&[0x02, 0x07]), [0x41, 0x12]);
        let mut bytes = Vec::new();
        append(1, &mut bytes, |pdu| pdu.extend([3, 0, 0, 0, 2]));
        assert_eq!(bytes, READ);
        assert_eq!(parse(&READ), Some((1, &READ[1..6])));
    }

    #[test]
    fn every_truncation_and_every_flipped_bit_is_found() {
        for cut in 0..READ.len() {
            assert_eq!(parse(&READ[..cut]), None, "{cut} bytes");
        }
        for bit in 0..READ.len() * 8 {
            let mut wrong = READ;
            wrong[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(parse(&wrong), None, "bit {bit}");
        }
    }

    #[test]
    fn telegrams_in_a_stream_are_split_by_their_length_wherever_it_is_cut() {
        let mut stream = Vec::new();
        // Every function has another length; 7, 8, 17 and 24 are in the standard, but refused here.
        let requests: [&[u8]; 9] = [
            &[3, 0, 0, 0, 2],
            &[7],
            &[15, 0, 0, 0, 9, 2, 1, 1],
            &[8, 0, 0, 0, 0],
            &[17],
            &[22, 0, 1, 0, 0xF2, 0, 0x25],
            &[23, 0, 0, 0, 4, 0, 0, 0, 1, 2, 7, 8],
            &[24, 0, 0],
            &[43, 14, 1, 0],
        ];
        for pdu in requests {
            append(9, &mut stream, |to| to.extend_from_slice(pdu));
        }
        let mut rest = &stream[..];
        for pdu in requests {
            let whole = 1 + pdu.len() + CHECKSUM;
            for cut in 0..whole {
                assert_eq!(split(&rest[..cut], answer::length), Ok(None), "{cut}");
            }
            assert_eq!(split(rest, answer::length), Ok(Some((9, pdu, whole))));
            rest = &rest[whole..];
        }
        assert!(rest.is_empty());
    }

    #[test]
    fn what_cannot_be_a_telegram_of_a_stream_is_told_as_soon_as_it_can_be() {
        let mut damaged = READ;
        damaged[3] ^= 1;
        for (bytes, expected) in [
            (&damaged[..], StreamError::Checksum),
            (&[1, 66], StreamError::Length(66)),
            (&[1, 0x83], StreamError::Length(0x83)),
            (&[1, 16, 0, 0, 0, 127, 254], StreamError::Length(16)),
        ] {
            assert_eq!(split(bytes, answer::length), Err(expected));
        }
        assert_eq!(split(&damaged[..7], answer::length), Ok(None));
    }

    #[test]
    fn silence_is_three_and_a_half_characters() {
        assert_eq!(silence(9_600), Nanos(4_010_412));
        assert_eq!(silence(19_200).rounded(), Nanos(2_005_202).rounded());
        assert_eq!(silence(115_200), Nanos::from_micros(1_750));
        assert!(silence(0) > Nanos::ZERO);
    }

    #[test]
    fn silence_ends_a_telegram_and_nothing_else_does() {
        let mut framer = Framer::new(Nanos(100));
        assert_eq!(framer.deadline(), Nanos::MAX);
        framer.arrived(Nanos(0), &READ[..3]);
        framer.arrived(Nanos(99), &READ[3..]);
        assert_eq!(framer.deadline(), Nanos(199));
        assert_eq!(framer.take(Nanos(198), |_| ()), None);
        let taken = framer.take(Nanos(199), |telegram| telegram.map(<[u8]>::to_vec));
        assert_eq!(taken, Some(Some(READ.to_vec())));
        assert_eq!(framer.take(Nanos(999), |_| ()), None, "it is taken once");
    }

    #[test]
    fn an_echo_that_never_came_is_not_expected_any_more_when_something_else_is_sent() {
        let mut echo = Echo::new(9_600);
        echo.sent(Nanos(0), &READ);
        let later = Nanos::from_secs(1);
        echo.sent(later, &[9, 8]);
        assert_eq!(echo.strip(later, &[9, 8]), 2);
    }

    #[test]
    fn the_echo_of_what_was_sent_is_dropped_and_what_follows_it_is_not() {
        let mut echo = Echo::new(9_600);
        echo.sent(Nanos(0), &READ);
        assert_eq!(echo.strip(Nanos(10), &READ[..5]), 5);
        let rest = [&READ[5..], &[1, 3]].concat();
        assert_eq!(echo.strip(Nanos(20), &rest), 3);
        assert_eq!(echo.strip(Nanos(30), &READ), 0, "it comes once");
        echo.sent(Nanos(40), &READ);
        assert_eq!(echo.strip(Nanos(50), &[2, 3]), 0, "that is another one's");
        assert_eq!(echo.strip(Nanos(60), &READ), 0);
        echo.sent(Nanos(70), &READ);
        let late = Nanos::from_millis(100);
        assert_eq!(echo.strip(late, &READ), 0, "no echo is so late");
    }

    #[test]
    fn what_is_too_long_is_no_telegram_and_takes_no_memory() {
        let mut framer = Framer::new(Nanos(100));
        for now in 0..1_000 {
            framer.arrived(Nanos(now), &[0; 64]);
        }
        assert_eq!(framer.bytes.len(), ADU_LIMIT);
        let taken = framer.take(Nanos(5_000), |telegram| telegram.is_none());
        assert_eq!(taken, Some(true));
        framer.arrived(Nanos(6_000), &READ);
        let taken = framer.take(Nanos(7_000), |telegram| telegram == Some(&READ[..]));
        assert_eq!(taken, Some(true), "the next one is whole again");
    }
}
