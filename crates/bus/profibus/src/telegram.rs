//! The telegrams on the line: bytes in, bytes out.

/// The address that all stations listen to.
pub const BROADCAST: u8 = 127;

/// The most octets of user data in a telegram.
pub const DATA_LIMIT: usize = 244;

const SD1: u8 = 0x10;
const SD2: u8 = 0x68;
const SD3: u8 = 0xA2;
const SD4: u8 = 0xDC;
const SC: u8 = 0xE5;
const ED: u8 = 0x16;

/// In an address octet: a service access point follows.
const HAS_SAP: u8 = 0x80;

/// The octets of DA, SA and FC.
const HEAD: usize = 3;

/// The highest value of LE.
const LE_LIMIT: usize = 249;

/// One telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Telegram<'a> {
    /// SD1, SD2 or SD3: a request or an answer.
    Frame(Frame<'a>),
    /// SD4: the token passes to another master.
    Token {
        /// The master that gets it.
        destination: u8,
        /// The master that had it.
        source: u8,
    },
    /// SC: a bare acknowledgement.
    ShortAck,
}

/// A telegram with addresses, a control octet and a checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// The station to which it is addressed, 0 to 127.
    pub destination: u8,
    /// The station that sends it, 0 to 127.
    pub source: u8,
    /// FC, the kind of request or answer.
    pub control: Control,
    /// The service access point at the receiver.
    pub dsap: Option<u8>,
    /// The service access point at the sender.
    pub ssap: Option<u8>,
    /// The user data.
    pub data: &'a [u8],
}

/// The control octet FC.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Control(pub u8);

impl Control {
    /// Answer: positive acknowledgement, no data.
    pub const OK: Self = Self(0x00);
    /// Answer: no resource for the request.
    pub const NO_RESOURCE: Self = Self(0x02);
    /// Answer: the service access point is not active.
    pub const NOT_ACTIVE: Self = Self(0x03);
    /// Answer: data.
    pub const DATA_LOW: Self = Self(0x08);
    /// Answer: data, and a diagnosis waits to be read.
    pub const DATA_HIGH: Self = Self(0x0A);

    /// Request: send data with no acknowledgement.
    pub const SDN_LOW: u8 = 0x04;
    /// As [`SDN_LOW`](Self::SDN_LOW), with high priority.
    pub const SDN_HIGH: u8 = 0x06;
    /// Request: report your status.
    pub const FDL_STATUS: u8 = 0x09;
    /// Request: send and request data.
    pub const SRD_LOW: u8 = 0x0C;
    /// As [`SRD_LOW`](Self::SRD_LOW), with high priority.
    pub const SRD_HIGH: u8 = 0x0D;

    /// True for a request, false for an answer.
    pub const fn is_request(self) -> bool {
        self.0 & 0x40 != 0
    }

    /// FCV: true if the frame count bit counts.
    pub const fn counts(self) -> bool {
        self.0 & 0x10 != 0
    }

    /// True if a request gets an answer: SDN does not.
    pub const fn is_answered(self) -> bool {
        !matches!(self.function(), Self::SDN_LOW | Self::SDN_HIGH)
    }

    /// The function of a request.
    pub const fn function(self) -> u8 {
        self.0 & 0x0F
    }
}

/// Bytes that are no telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TelegramError {
    /// The first octet starts no telegram.
    #[error("{0:02X} starts no telegram")]
    Start(u8),
    /// The two lengths of an SD2 differ, or it is out of range.
    #[error("a length of {0} and {1}, expected the same twice, from 3 to 249")]
    Length(u8, u8),
    /// The checksum is wrong.
    #[error("the checksum {found:02X}, expected {expected:02X}")]
    Checksum {
        /// The checksum in the telegram.
        found: u8,
        /// The sum of the octets.
        expected: u8,
    },
    /// The last octet is not the end delimiter, or the start delimiter is not repeated.
    #[error("{0:02X} in the place of a delimiter")]
    Delimiter(u8),
    /// The telegram ends before the service access points that it announces.
    #[error("no octets for the service access points")]
    AccessPoint,
    /// The address of a token is out of range.
    #[error("a token of or for {0}, which is no address")]
    Token(u8),
}

impl<'a> Telegram<'a> {
    /// Reads the telegram at the start of `bytes`, and its length; `None` if more bytes have to arrive first.
    ///
    /// # Errors
    ///
    /// The bytes are no telegram, whatever follows.
    pub fn parse(bytes: &'a [u8]) -> Result<Option<(Self, usize)>, TelegramError> {
        let Some(&start) = bytes.first() else {
            return Ok(None);
        };
        let (head, body) = match start {
            SC => return Ok(Some((Self::ShortAck, 1))),
            SD4 => return token(bytes),
            SD1 => (1, HEAD),
            SD3 => (1, HEAD + 8),
            SD2 => match variable_length(bytes)? {
                Some(length) => (4, length),
                None => return Ok(None),
            },
            other => return Err(TelegramError::Start(other)),
        };
        let end = head + body;
        let Some(&[found, last]) = bytes.get(end..end + 2) else {
            return Ok(None);
        };
        let body = &bytes[head..end];
        let expected = checksum(body);
        if found != expected {
            return Err(TelegramError::Checksum { found, expected });
        }
        if last != ED {
            return Err(TelegramError::Delimiter(last));
        }
        Ok(Some((Self::Frame(Frame::of_body(body)?), end + 2)))
    }
}

fn token<'a>(bytes: &[u8]) -> Result<Option<(Telegram<'a>, usize)>, TelegramError> {
    let Some(&[destination, source]) = bytes.get(1..3) else {
        return Ok(None);
    };
    // A token has no checksum: only an address that does not exist can be detected as wrong.
    match [destination, source]
        .into_iter()
        .find(|address| *address >= BROADCAST)
    {
        Some(wrong) => Err(TelegramError::Token(wrong)),
        None => Ok(Some((
            Telegram::Token {
                destination,
                source,
            },
            3,
        ))),
    }
}

/// LE of an SD2, if its head has arrived.
fn variable_length(bytes: &[u8]) -> Result<Option<usize>, TelegramError> {
    let Some(&length) = bytes.get(1) else {
        return Ok(None);
    };
    let in_range = (HEAD..=LE_LIMIT).contains(&usize::from(length));
    let again = bytes.get(2).copied();
    if !in_range || again.is_some_and(|again| again != length) {
        return Err(TelegramError::Length(length, again.unwrap_or(length)));
    }
    match bytes.get(3) {
        None => Ok(None),
        Some(&SD2) => Ok(Some(length.into())),
        Some(&other) => Err(TelegramError::Delimiter(other)),
    }
}

fn checksum(body: &[u8]) -> u8 {
    body.iter()
        .fold(0, |sum: u8, octet| sum.wrapping_add(*octet))
}

impl<'a> Frame<'a> {
    /// Reads DA to the last octet of data.
    fn of_body(body: &'a [u8]) -> Result<Self, TelegramError> {
        let (&[destination, source, control], mut data) =
            body.split_first_chunk::<HEAD>().expect("checked by length");
        let mut access_point = |address: u8| {
            if address & HAS_SAP == 0 {
                return Ok(None);
            }
            let (&sap, rest) = data.split_first().ok_or(TelegramError::AccessPoint)?;
            data = rest;
            Ok(Some(sap))
        };
        let dsap = access_point(destination)?;
        let ssap = access_point(source)?;
        Ok(Self {
            destination: destination & !HAS_SAP,
            source: source & !HAS_SAP,
            control: Control(control),
            dsap,
            ssap,
            data,
        })
    }

    /// Appends the frame's bytes: SD1 without data, SD2 otherwise.
    ///
    /// # Panics
    ///
    /// When the frame has more than [`DATA_LIMIT`] octets of data.
    pub fn append(&self, out: &mut Vec<u8>) {
        assert!(self.data.len() <= DATA_LIMIT, "it does not fit");
        let flag = |sap: Option<u8>| if sap.is_some() { HAS_SAP } else { 0 };
        let saps = self.dsap.iter().chain(&self.ssap);
        let length = HEAD + saps.clone().count() + self.data.len();
        if length == HEAD {
            out.push(SD1);
        } else {
            let le = u8::try_from(length).expect("checked above");
            out.extend([SD2, le, le, SD2]);
        }
        let body = out.len();
        out.extend([
            self.destination | flag(self.dsap),
            self.source | flag(self.ssap),
            self.control.0,
        ]);
        out.extend(saps);
        out.extend_from_slice(self.data);
        let sum = checksum(&out[body..]);
        out.extend([sum, ED]);
    }
}

/// Appends a bare acknowledgement.
pub fn append_short_ack(out: &mut Vec<u8>) {
    out.push(SC);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bytes(hex: &str) -> Vec<u8> {
        let octets = hex.split_whitespace();
        octets
            .map(|octet| u8::from_str_radix(octet, 16).expect("hex"))
            .collect()
    }

    /// Telegrams recorded from other programs and devices, each with its meaning.
    fn golden() -> Vec<(Vec<u8>, Telegram<'static>)> {
        let frame = |destination, source, control, dsap, ssap, data| {
            Telegram::Frame(Frame {
                destination,
                source,
                control: Control(control),
                dsap,
                ssap,
                data,
            })
        };
        let all: [(&str, Telegram<'static>); 8] = [
            ("10 08 02 49 53 16", frame(8, 2, 0x49, None, None, &[])),
            ("10 02 08 00 0A 16", frame(2, 8, 0x00, None, None, &[])),
            (
                "68 05 05 68 08 02 5D 12 34 AD 16",
                frame(8, 2, 0x5D, None, None, &[0x12, 0x34]),
            ),
            (
                "68 07 07 68 FF 81 46 3A 3E 00 00 3E 16",
                frame(127, 1, 0x46, Some(58), Some(62), &[0, 0]),
            ),
            (
                "68 0B 0B 68 82 88 08 3E 3C 02 05 00 FF 47 11 EA 16",
                frame(2, 8, 0x08, Some(62), Some(60), &[2, 5, 0, 0xFF, 0x47, 0x11]),
            ),
            (
                "A2 08 02 5D 01 02 03 04 05 06 07 08 8B 16",
                frame(8, 2, 0x5D, None, None, &[1, 2, 3, 4, 5, 6, 7, 8]),
            ),
            (
                "DC 02 02",
                Telegram::Token {
                    destination: 2,
                    source: 2,
                },
            ),
            ("E5", Telegram::ShortAck),
        ];
        all.map(|(hex, says)| (bytes(hex), says)).to_vec()
    }

    #[test]
    fn golden_telegrams_say_what_they_say_and_are_written_the_same() {
        for (bytes, says) in golden() {
            assert_eq!(Telegram::parse(&bytes), Ok(Some((says, bytes.len()))));
            let mut more = bytes.clone();
            more.extend([0x10, 1]);
            assert_eq!(Telegram::parse(&more), Ok(Some((says, bytes.len()))));
            if let Telegram::Frame(frame) = says
                && bytes[0] != SD3
            {
                let mut written = Vec::new();
                frame.append(&mut written);
                assert_eq!(written, bytes);
            }
        }
    }

    #[test]
    fn every_truncation_is_incomplete_and_every_flipped_bit_is_found() {
        for (bytes, _) in golden() {
            for length in 0..bytes.len() {
                assert_eq!(Telegram::parse(&bytes[..length]), Ok(None), "{length}");
            }
            // The addresses of a token are not protected: only the line's parity bit would detect an error.
            let protected = if bytes[0] == SD4 { 8 } else { 8 * bytes.len() };
            for bit in 0..protected {
                let mut flipped = bytes.clone();
                flipped[bit / 8] ^= 1 << (bit % 8);
                // Before the copy of a length has arrived, a longer one cannot be detected as wrong; here it has.
                assert!(
                    Telegram::parse(&flipped).is_err(),
                    "bit {bit} of {bytes:02X?}"
                );
            }
        }
    }

    #[test]
    fn a_telegram_without_the_access_points_that_it_announces_is_wrong() {
        let mut bytes = vec![SD1, 0x88, 0x02, 0x6D];
        bytes.extend([checksum(&bytes[1..]), ED]);
        assert_eq!(Telegram::parse(&bytes), Err(TelegramError::AccessPoint));
    }

    proptest! {
        #[test]
        fn any_frame_reads_back(
            destination in 0_u8..=127,
            source in 0_u8..=127,
            control: u8,
            dsap: Option<u8>,
            ssap: Option<u8>,
            data in proptest::collection::vec(any::<u8>(), 0..=DATA_LIMIT),
        ) {
            let control = Control(control);
            let frame = Frame { destination, source, control, dsap, ssap, data: &data };
            let mut bytes = Vec::new();
            frame.append(&mut bytes);
            prop_assert_eq!(Telegram::parse(&bytes), Ok(Some((Telegram::Frame(frame), bytes.len()))));
        }

        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            if let Ok(Some((_, length))) = Telegram::parse(&bytes) {
                prop_assert!(length <= bytes.len());
            }
        }
    }
}
