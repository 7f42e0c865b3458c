//! Modbus ASCII: telegrams as hexadecimal digits between a colon and CR LF, with a checksum over their bytes (LRC).

use super::{PDU_LIMIT, answer};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::WrongAnswer;

/// The longest pause between two characters of a telegram.
pub const SILENCE: Nanos = Nanos::from_secs(1);

/// The most bytes of a telegram behind its digits: unit, PDU, checksum.
pub const BYTES_LIMIT: usize = 1 + PDU_LIMIT + 1;

/// The longest telegram in characters: a colon, two digits per byte, CR and LF.
pub const ADU_LIMIT: usize = characters(BYTES_LIMIT);

/// The shortest in bytes: unit, function code, checksum.
const SHORTEST: usize = 3;

const DIGITS: &[u8; 16] = b"0123456789ABCDEF";

/// The characters of a telegram with this many bytes.
pub const fn characters(bytes: usize) -> usize {
    1 + 2 * bytes + 2
}

/// The checksum of a telegram's bytes: the two's complement of their sum.
pub fn checksum(bytes: &[u8]) -> u8 {
    let sum = bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
    sum.wrapping_neg()
}

/// Appends a telegram, whose PDU `write` appends as bytes; appends nothing if `write` does not.
pub fn append<R>(unit: u8, line: &mut Vec<u8>, write: impl FnOnce(&mut Vec<u8>) -> R) -> R {
    let mut bytes = vec![unit];
    let result = write(&mut bytes);
    if bytes.len() == 1 {
        return result;
    }
    bytes.push(checksum(&bytes));
    line.push(b':');
    for byte in bytes {
        line.extend([byte >> 4, byte & 15].map(|digit| DIGITS[usize::from(digit)]));
    }
    line.extend_from_slice(b"\r\n");
    result
}

/// Spoils the last answer in `line`, which [`append`] wrote from `begin` on; its checksum is right, as with RTU.
pub(crate) fn spoil(line: &mut Vec<u8>, begin: usize, wrong: WrongAnswer) {
    let mut framer = Framer::new(SILENCE);
    framer.arrived(Nanos::ZERO, &mut &line[begin..]);
    let bytes = framer.take(Nanos::ZERO, |bytes| bytes.map(<[u8]>::to_vec));
    let Some(Some(bytes)) = bytes else {
        return;
    };
    let Some((mut unit, pdu)) = parse(&bytes) else {
        return;
    };
    let mut pdu = pdu.to_vec();
    match wrong {
        WrongAnswer::Truncated => drop(pdu.pop()),
        WrongAnswer::Short => answer::shorten(&mut pdu, 0),
        WrongAnswer::Transaction | WrongAnswer::Unit => unit = unit.wrapping_add(1),
    }
    line.truncate(begin);
    append(unit, line, |to| to.extend_from_slice(&pdu));
}

/// Unit and PDU of a telegram's bytes; `None` if their number or the checksum is wrong.
pub fn parse(bytes: &[u8]) -> Option<(u8, &[u8])> {
    if !(SHORTEST..=BYTES_LIMIT).contains(&bytes.len()) || checksum(bytes) != 0 {
        return None;
    }
    let (_, body) = bytes.split_last()?;
    Some((body[0], &body[1..]))
}

/// Returns true if `line` is the telegram with these bytes.
pub(crate) fn is_of(line: &[u8], bytes: &[u8]) -> bool {
    let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 15]);
    let digits = digits.map(|digit| DIGITS[usize::from(digit)]);
    let written = line
        .strip_prefix(b":")
        .and_then(|line| line.strip_suffix(b"\r\n"));
    written.is_some_and(|written| written.iter().copied().eq(digits))
}

/// Splits the characters on a line into telegrams, and decodes them.
#[derive(Debug)]
pub struct Framer {
    silence: Nanos,
    /// The bytes decoded so far.
    bytes: Vec<u8>,
    /// The first digit of the next byte.
    half: Option<u8>,
    state: State,
    /// Longer than any telegram.
    overlong: bool,
    /// Another character than a digit was there, or the end is not whole.
    broken: bool,
    /// When the last character arrived.
    last: Nanos,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Before a colon.
    Outside,
    /// Behind it.
    Inside,
    /// Behind the CR.
    Ending,
    /// Behind the LF.
    Whole,
}

impl Framer {
    /// A framer that gives up a telegram whose next character does not come within `silence`.
    pub fn new(silence: Nanos) -> Self {
        Self {
            silence,
            bytes: Vec::with_capacity(BYTES_LIMIT),
            half: None,
            state: State::Outside,
            overlong: false,
            broken: false,
            last: Nanos::ZERO,
        }
    }

    /// These characters arrived at `now`. Takes those up to the end of a telegram, which must then be
    /// [taken](Self::take), out of `characters`.
    pub fn arrived(&mut self, now: Nanos, characters: &mut &[u8]) {
        while let [character, rest @ ..] = characters
            && self.state != State::Whole
        {
            *characters = rest;
            self.last = now;
            match (*character, self.state) {
                (b':', _) => {
                    self.clear();
                    self.state = State::Inside;
                }
                (_, State::Outside) => {}
                (b'\r', State::Inside) => self.state = State::Ending,
                (b'\n', _) => {
                    self.broken |= self.state != State::Ending || self.half.is_some();
                    self.state = State::Whole;
                }
                (other, state) => {
                    let digit = char::from(other).to_digit(16);
                    let digit = digit.and_then(|digit| u8::try_from(digit).ok());
                    match digit {
                        Some(digit) if state == State::Inside => self.digit(digit),
                        _ => self.broken = true,
                    }
                }
            }
        }
    }

    fn digit(&mut self, digit: u8) {
        match self.half.take() {
            None => self.half = Some(digit),
            Some(_) if self.bytes.len() == BYTES_LIMIT => self.overlong = true,
            Some(high) => self.bytes.push(high << 4 | digit),
        }
    }

    /// When a telegram is given up, or has ended; [`Nanos::MAX`] between telegrams.
    pub fn deadline(&self) -> Nanos {
        match self.state {
            State::Outside => Nanos::MAX,
            State::Whole => self.last,
            State::Inside | State::Ending => self.last + self.silence,
        }
    }

    /// If a telegram has ended, or is given up at `now`, passes its bytes to `take`: none if they are no digits, or the
    /// telegram is not whole; or `None` if it was longer than any telegram.
    pub fn take<R>(&mut self, now: Nanos, take: impl FnOnce(Option<&[u8]>) -> R) -> Option<R> {
        if now < self.deadline() {
            return None;
        }
        let broken = self.broken || self.state != State::Whole;
        let bytes: &[u8] = if broken { &[] } else { &self.bytes };
        let result = take((!self.overlong).then_some(bytes));
        self.clear();
        Some(result)
    }

    /// Forgets the begun telegram.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.half = None;
        self.state = State::Outside;
        self.overlong = false;
        self.broken = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The telegrams in these characters, which arrive at once; `None` for one that is longer than any.
    fn telegrams(mut characters: &[u8]) -> Vec<Option<Vec<u8>>> {
        let mut framer = Framer::new(SILENCE);
        let mut all = Vec::new();
        loop {
            framer.arrived(Nanos::ZERO, &mut characters);
            let Some(bytes) = framer.take(Nanos::ZERO, |bytes| bytes.map(<[u8]>::to_vec)) else {
                assert!(characters.is_empty());
                return all;
            };
            all.push(bytes);
        }
    }

    #[test]
    fn a_telegram_is_written_and_read_as_in_manuals() {
        let mut line = Vec::new();
        append(0xF7, &mut line, |pdu| pdu.extend([3, 0x13, 0x89, 0, 10]));
        assert_eq!(line, b":F7031389000A60\r\n");
        append(1, &mut line, |_| ());
        assert_eq!(line.len(), characters(7), "nothing is appended");
        let both = [&b"noise"[..], &line, b"\r\n", &line.to_ascii_lowercase()].concat();
        let bytes = [0xF7, 3, 0x13, 0x89, 0, 10, 0x60];
        let expected = vec![Some(bytes.to_vec()); 2];
        assert_eq!(telegrams(&both), expected);
        assert_eq!(parse(&bytes), Some((0xF7, &bytes[1..6])));
        assert!(is_of(&line, &bytes) && !is_of(&line[1..], &bytes));
    }

    #[test]
    fn whatever_is_damaged_is_no_telegram() {
        for damaged in [
            &b":F7031389000A6\r\n"[..],
            b":F7031389000A60\n",
            b":F7031389000A60\r\r\n",
            b":F7031389000A60\rF\n",
            b":F703138900?A60\r\n",
            b":\r\n",
        ] {
            assert_eq!(telegrams(damaged), [Some(vec![])], "{damaged:?}");
        }
        assert_eq!(
            telegrams(b":F7031389000A61\r\n")[0].as_deref().map(parse),
            Some(None)
        );
        assert_eq!(telegrams(b":F703:01"), []);
        // A colon begins anew, and what is too long takes no memory.
        let long = [&b":01:"[..], &[b'0'; 5000], b"\r\n:0103FC\r\n"].concat();
        assert_eq!(telegrams(&long), [None, Some(vec![1, 3, 0xFC])]);
    }

    #[test]
    fn a_pause_of_a_second_ends_a_telegram() {
        let mut framer = Framer::new(SILENCE);
        assert_eq!(framer.deadline(), Nanos::MAX);
        framer.arrived(Nanos(5), &mut &b":01"[..]);
        assert_eq!(framer.deadline(), Nanos(5) + SILENCE);
        assert_eq!(framer.take(SILENCE, |_| ()), None);
        let given_up = framer.take(Nanos(5) + SILENCE, |bytes| bytes.map(<[u8]>::len));
        assert_eq!(given_up, Some(Some(0)));
        assert_eq!(framer.deadline(), Nanos::MAX);
    }

    #[test]
    fn spoilt_answers_have_right_checksums() {
        for (wrong, expected) in [
            (WrongAnswer::Truncated, vec![1, 3, 2, 0, 0xFA]),
            (WrongAnswer::Unit, vec![2, 3, 2, 0, 7, 0xF2]),
            (WrongAnswer::Short, vec![1, 3, 0, 0xFC]),
        ] {
            let mut line = b"kept".to_vec();
            append(1, &mut line, |pdu| pdu.extend([3, 2, 0, 7]));
            spoil(&mut line, 4, wrong);
            assert_eq!(telegrams(&line), [Some(expected)]);
        }
    }
}
