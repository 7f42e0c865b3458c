//! The protocol data units of S7 communication: a header, parameters, data.

use super::ProtocolError;

const PROTOCOL: u8 = 0x32;
/// `S7CommPlus`, the protocol of TIA Portal and newer panels.
const PLUS: u8 = 0x72;

/// Bytes of the header of a job.
pub const JOB_HEADER: usize = 10;
/// Bytes of the header of an answer, with an error.
pub const ANSWER_HEADER: usize = 12;

/// The most jobs that client and server agree to have pending at once on a connection.
pub const JOBS: u16 = 8;

/// Function codes: the first byte of the parameters of a job and its answer.
pub mod function {
    /// Read variables.
    pub const READ: u8 = 0x04;
    /// Write variables.
    pub const WRITE: u8 = 0x05;
    /// Negotiate the PDU length.
    pub const SETUP: u8 = 0xF0;
}

/// Errors of a whole job: class and code.
pub mod error {
    /// No error.
    pub const NONE: u16 = 0;
    /// The server has no such function.
    pub const NO_FUNCTION: u16 = 0x8104;
    /// The lengths in the PDU are inconsistent, or it or its answer exceeds the negotiated length.
    pub const LENGTHS: u16 = 0x8500;
    /// There is no such block.
    pub const NO_BLOCK: u16 = 0xD209;
    /// There is no such system status list.
    pub const NO_LIST: u16 = 0xD401;
    /// There is no such index of a system status list.
    pub const NO_INDEX: u16 = 0xD402;
}

/// The kind of a PDU (ROSCTR).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A client's request.
    Job,
    /// A server's answer without data.
    Ack,
    /// A server's answer.
    AckData,
    /// Request or answer about the system.
    UserData,
}

impl Kind {
    const fn code(self) -> u8 {
        match self {
            Self::Job => 1,
            Self::Ack => 2,
            Self::AckData => 3,
            Self::UserData => 7,
        }
    }

    const fn header(self) -> usize {
        match self {
            Self::Job | Self::UserData => JOB_HEADER,
            Self::Ack | Self::AckData => ANSWER_HEADER,
        }
    }
}

/// One PDU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pdu<'a> {
    /// The kind.
    pub kind: Kind,
    /// Matches an answer to its job.
    pub reference: u16,
    /// In an answer: the error of the whole job.
    pub error: u16,
    /// The function, and its items.
    pub parameters: &'a [u8],
    /// The values of the items.
    pub data: &'a [u8],
}

impl<'a> Pdu<'a> {
    /// Reads a whole message as one PDU.
    ///
    /// # Errors
    ///
    /// The message is not a PDU, or its lengths are inconsistent.
    pub fn read(message: &'a [u8]) -> Result<Self, ProtocolError> {
        match message.first() {
            Some(&PROTOCOL) => {}
            Some(&PLUS) => return Err(ProtocolError::S7CommPlus),
            Some(&other) => return Err(ProtocolError::NoS7(other)),
            None => return Err(ProtocolError::Lengths),
        }
        let header = message
            .first_chunk::<JOB_HEADER>()
            .ok_or(ProtocolError::Lengths)?;
        let [_, kind, _, _, r0, r1, p0, p1, d0, d1] = *header;
        let kind = match kind {
            1 => Kind::Job,
            2 => Kind::Ack,
            3 => Kind::AckData,
            7 => Kind::UserData,
            other => return Err(ProtocolError::Kind(other)),
        };
        let (parameters, data) = (u16::from_be_bytes([p0, p1]), u16::from_be_bytes([d0, d1]));
        let (header, body) = message
            .split_at_checked(kind.header())
            .ok_or(ProtocolError::Lengths)?;
        if body.len() != usize::from(parameters) + usize::from(data) {
            return Err(ProtocolError::Lengths);
        }
        let error = match header[JOB_HEADER..] {
            [class, code] => u16::from_be_bytes([class, code]),
            _ => error::NONE,
        };
        let (parameters, data) = body.split_at(usize::from(parameters));
        Ok(Self {
            kind,
            reference: u16::from_be_bytes([r0, r1]),
            error,
            parameters,
            data,
        })
    }
}

/// A PDU that is being appended to a buffer.
#[derive(Debug)]
#[must_use = "its lengths are set at the end"]
pub struct Draft {
    begin: usize,
    body: usize,
    parameters: Option<usize>,
}

impl Draft {
    /// Begins a PDU at the end of `out`; append its parameters next.
    pub fn begin(kind: Kind, reference: u16, error: u16, out: &mut Vec<u8>) -> Self {
        let begin = out.len();
        let [r0, r1] = reference.to_be_bytes();
        out.extend_from_slice(&[PROTOCOL, kind.code(), 0, 0, r0, r1, 0, 0, 0, 0]);
        if kind.header() == ANSWER_HEADER {
            out.extend_from_slice(&error.to_be_bytes());
        }
        Self {
            begin,
            body: out.len(),
            parameters: None,
        }
    }

    /// Ends the parameters; data follow.
    pub fn data(&mut self, out: &[u8]) {
        self.parameters = Some(out.len() - self.body);
    }

    /// Ends the PDU.
    ///
    /// # Panics
    ///
    /// When it is longer than any PDU can be.
    pub fn end(self, out: &mut [u8]) {
        let body = out.len() - self.body;
        let parameters = self.parameters.unwrap_or(body);
        let lengths = [parameters, body - parameters]
            .map(|length| u16::try_from(length).expect("a unit is shorter than 64 KiB"));
        out[self.begin + 6..self.begin + 8].copy_from_slice(&lengths[0].to_be_bytes());
        out[self.begin + 8..self.begin + 10].copy_from_slice(&lengths[1].to_be_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hex;

    #[test]
    fn a_captured_job_and_its_answer_are_read() {
        let bytes = hex("32 01 0000 0001 0008 0000 f0 00 0001 0001 01e0");
        let job = Pdu::read(&bytes).expect("a job");
        assert_eq!((job.kind, job.reference, job.data), (Kind::Job, 1, &[][..]));
        assert_eq!(job.parameters, hex("f0 00 0001 0001 01e0"));
        let bytes = hex("32 03 0000 0002 0002 0008 85 00 04 01 ff 04 0020 01020304");
        let answer = Pdu::read(&bytes).expect("an answer");
        assert_eq!((answer.kind, answer.error), (Kind::AckData, error::LENGTHS));
        assert_eq!(answer.parameters, [4, 1]);
        assert_eq!(answer.data, hex("ff 04 0020 01020304"));
    }

    #[test]
    fn every_truncation_and_every_byte_too_many_is_refused() {
        let bytes = hex("32 03 0000 0002 0002 0008 00 00 04 01 ff 04 0020 01020304 00");
        let whole = bytes.len() - 1;
        for cut in (0..=bytes.len()).filter(|cut| *cut != whole) {
            assert_eq!(
                Pdu::read(&bytes[..cut]),
                Err(ProtocolError::Lengths),
                "{cut}"
            );
        }
        assert!(Pdu::read(&bytes[..whole]).is_ok());
    }

    #[test]
    fn other_protocols_are_told_apart() {
        assert_eq!(Pdu::read(&hex("72 01 00")), Err(ProtocolError::S7CommPlus));
        assert_eq!(Pdu::read(&hex("00 01 00")), Err(ProtocolError::NoS7(0)));
        let kind = hex("32 05 0000 0001 0000 0000");
        assert_eq!(Pdu::read(&kind), Err(ProtocolError::Kind(5)));
    }

    #[test]
    fn a_unit_is_written_as_it_is_read() {
        let mut out = vec![9];
        let mut draft = Draft::begin(Kind::AckData, 2, 0, &mut out);
        out.extend_from_slice(&[4, 1]);
        draft.data(&out);
        out.extend(hex("ff 04 0020 01020304"));
        draft.end(&mut out);
        assert_eq!(
            out[1..],
            hex("32 03 0000 0002 0002 0008 00 00 04 01 ff 04 0020 01020304")
        );
    }
}
