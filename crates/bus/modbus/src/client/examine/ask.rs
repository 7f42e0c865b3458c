//! Single questions to a device, one after another on a connection that blocks.

use std::fmt;

use crate::identification::{READ_DEVICE_IDENTIFICATION, Taken};
use crate::mbap::{self, Telegram};
use crate::{Coding, Exception, Function, Identification, ascii, rtu};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::examine::{Wire, WireEnd};

use super::super::request::{AnswerError, Request, expect, length};

/// The framing of telegrams in a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::client) enum Frame {
    /// With the header of TCP.
    Tcp,
    /// As RTU, with a checksum.
    Rtu,
    /// As on a serial line, with the echo of each request if `echoes`. Requests are `apart` from what was before them.
    Serial {
        coding: Coding,
        echoes: bool,
        apart: Nanos,
    },
}

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::client) enum Miss {
    /// The device is silent, or the connection has ended.
    End(WireEnd),
    /// The bytes are no telegram of this framing.
    Alien(Vec<u8>),
    /// The device answers with an exception.
    Refused(Exception),
    /// The answer violates the standard.
    Malformed(String),
    /// The line sends the request back, or does not although the file says so.
    Echo {
        /// True if the file says that the line echoes.
        expected: bool,
    },
}

impl fmt::Display for Miss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::End(end) => end.fmt(f),
            Self::Alien(bytes) => {
                let first = &bytes[..bytes.len().min(16)];
                write!(
                    f,
                    "answers with bytes that are no Modbus telegram ({first:02X?})"
                )
            }
            Self::Refused(exception) => write!(f, "answers {exception}"),
            Self::Malformed(why) => f.write_str(why),
            Self::Echo { expected: false } => f.write_str("sends each request back"),
            Self::Echo { expected: true } => f.write_str("does not send requests back"),
        }
    }
}

/// The most answers to a request for an identity, as of the polling client.
const IDENTIFYING: usize = 8;

/// A conversation with the units behind one connection.
pub(in crate::client) struct Talk {
    wire: Wire,
    frame: Frame,
    transaction: u16,
    inbox: Vec<u8>,
}

impl Talk {
    pub(in crate::client) fn new(wire: Wire, frame: Frame) -> Self {
        Self {
            wire,
            frame,
            transaction: 0,
            inbox: Vec::new(),
        }
    }

    /// Ends the connection, so that a device with a single one accepts the next.
    pub(in crate::client) fn hang_up(&self) {
        self.wire.hang_up();
    }

    /// Sends a PDU, and returns that of the answer, which may be an exception.
    fn exchange(&mut self, unit: u8, pdu: &[u8]) -> Result<Vec<u8>, Miss> {
        let mut request = Vec::new();
        let copy = |to: &mut Vec<u8>| to.extend_from_slice(pdu);
        self.transaction = self.transaction.wrapping_add(1);
        match self.frame {
            Frame::Tcp => mbap::append(self.transaction, unit, &mut request, copy),
            Frame::Rtu => rtu::append(unit, &mut request, copy),
            Frame::Serial { coding, apart, .. } => {
                self.wire.pause(apart);
                let (now, end) = (self.wire.now(), self.wire.deadline());
                // Drops a late answer to an earlier question, here and below. A line that floods has no end.
                while self.wire.receive(&mut self.inbox, now).is_ok() && self.wire.now() < end {
                    self.inbox.clear();
                }
                coding.append(unit, &mut request, copy);
            }
        }
        self.inbox.clear();
        self.wire.send(&request).map_err(Miss::End)?;
        let deadline = self.wire.deadline();
        // What has come by the deadline is read behind it, too; a line that floods always has more.
        let end = deadline + self.wire.patience();
        let mut is_echoed = false;
        loop {
            if matches!(self.frame, Frame::Serial { .. }) && self.wire.now() > end {
                return Err(Miss::Alien(std::mem::take(&mut self.inbox)));
            }
            if let Frame::Serial { echoes, .. } = self.frame
                && !is_echoed
                && !self.inbox.is_empty()
            {
                if self.inbox.starts_with(&request) {
                    if !echoes {
                        return Err(Miss::Echo { expected: false });
                    }
                    self.inbox.drain(..request.len());
                    is_echoed = true;
                } else if request.starts_with(&self.inbox) {
                    // An echo or an answer: the next bytes tell.
                    self.wire
                        .receive(&mut self.inbox, deadline)
                        .map_err(Miss::End)?;
                    continue;
                } else if echoes {
                    return Err(Miss::Echo { expected: true });
                }
            }
            if let Some(answer) = self.take(unit, pdu[0])? {
                return Ok(answer);
            }
            self.wire
                .receive(&mut self.inbox, deadline)
                .map_err(Miss::End)?;
        }
    }

    /// The PDU of the awaited answer, if it has arrived. Drops other telegrams.
    fn take(&mut self, unit: u8, code: u8) -> Result<Option<Vec<u8>>, Miss> {
        loop {
            let (taken, answer) = match self.frame {
                Frame::Tcp => match Telegram::parse(&self.inbox) {
                    Err(_) => return Err(Miss::Alien(self.inbox.clone())),
                    Ok(None) => return Ok(None),
                    Ok(Some((telegram, taken))) => {
                        let is_it = telegram.transaction == self.transaction;
                        (taken, is_it.then(|| telegram.pdu.to_vec()))
                    }
                },
                Frame::Serial {
                    coding: Coding::Ascii,
                    ..
                } => match ascii_telegram(&self.inbox) {
                    None => return Ok(None),
                    Some((taken, None)) => return Err(Miss::Alien(self.inbox[..taken].to_vec())),
                    Some((taken, Some((from, pdu)))) => {
                        let is_it = from == unit && pdu[0] & 0x7F == code;
                        (taken, is_it.then_some(pdu))
                    }
                },
                Frame::Rtu | Frame::Serial { .. } => match rtu::split(&self.inbox, length) {
                    Err(_) => return Err(Miss::Alien(self.inbox.clone())),
                    Ok(None) => return Ok(None),
                    Ok(Some((from, pdu, taken))) => {
                        let is_it = from == unit && pdu[0] & 0x7F == code;
                        (taken, is_it.then(|| pdu.to_vec()))
                    }
                },
            };
            self.inbox.drain(..taken);
            if answer.is_some() {
                return Ok(answer);
            }
        }
    }

    /// Reads elements into `receives`. The request must not write.
    pub(in crate::client) fn read(
        &mut self,
        unit: u8,
        request: &Request,
        receives: &mut [u8],
    ) -> Result<(), Miss> {
        debug_assert!(request.write().is_none(), "an examination writes nothing");
        let mut pdu = Vec::new();
        request.append(&[], &mut pdu);
        let answer = self.exchange(unit, &pdu)?;
        request.take(&pdu, &answer, receives).map_err(miss)
    }

    /// The identity by function 43, or else by function 17.
    pub(in crate::client) fn identity(&mut self, unit: u8) -> Result<Identification, Miss> {
        match self.identification(unit) {
            Err(Miss::Refused(exception)) if exception.is_about_the_request() => {
                let code = Function::ReportServerId.code();
                let answer = self.exchange(unit, &[code])?;
                let data = expect(Function::ReportServerId, &answer).map_err(miss)?;
                let text = data.get(1..).unwrap_or_default();
                Ok(Identification {
                    server_id: Some(text.to_vec()),
                    ..Identification::default()
                })
            }
            known => known,
        }
    }

    fn identification(&mut self, unit: u8) -> Result<Identification, Miss> {
        const BASIC: u8 = 1;
        let code = Function::DeviceIdentification.code();
        let mut identification = Identification::default();
        let mut object = 0;
        for _ in 0..IDENTIFYING {
            let pdu = [code, READ_DEVICE_IDENTIFICATION, BASIC, object];
            let answer = self.exchange(unit, &pdu)?;
            let data = expect(Function::DeviceIdentification, &answer).map_err(miss)?;
            match identification.take(data) {
                Some(Taken::Whole) => break,
                Some(Taken::MoreFrom(next)) => object = next,
                None => {
                    return Err(Miss::Malformed(
                        "gives a malformed answer when asked who it is".to_owned(),
                    ));
                }
            }
        }
        Ok(identification)
    }
}

/// Unit and PDU of a telegram.
type Parsed = (u8, Vec<u8>);

/// The number of characters up to the end of the first telegram, and its unit and PDU if it is whole; `None` if it has no
/// end yet.
fn ascii_telegram(characters: &[u8]) -> Option<(usize, Option<Parsed>)> {
    let mut framer = ascii::Framer::new(ascii::SILENCE);
    let mut rest = characters;
    framer.arrived(Nanos::ZERO, &mut rest);
    let taken = characters.len() - rest.len();
    let telegram = framer.take(Nanos::ZERO, |bytes| {
        let (unit, pdu) = ascii::parse(bytes?)?;
        Some((unit, pdu.to_vec()))
    })?;
    Some((taken, telegram))
}

fn miss(error: AnswerError) -> Miss {
    match error {
        AnswerError::Refused(exception) => Miss::Refused(exception),
        AnswerError::Malformed(why) => Miss::Malformed(why),
    }
}

/// The printable parts of a server id, whose format is the device's own.
pub(in crate::client) fn legible(bytes: &[u8]) -> String {
    let texts = bytes.split(|byte| !matches!(byte, b' '..=b'~'));
    let texts = texts.map(|text| String::from_utf8_lossy(text).trim().to_owned());
    let texts: Vec<String> = texts.filter(|text| text.len() > 1).collect();
    texts.join(" ")
}

/// The beginning of TLS 1.2: a `ClientHello` (RFC 5246, 7.4.1.2; its extensions RFC 8422, 5.1). Every build has it, with or
/// without a stack for TLS.
fn client_hello() -> Vec<u8> {
    let version = [3, 3];
    // ECDHE with AES-128-GCM, for certificates with ECDSA and with RSA.
    let suites = [0, 4, 0xC0, 0x2B, 0xC0, 0x2F];
    let extensions: [&[u8]; 3] = [
        // The groups x25519 and secp256r1.
        &[0, 10, 0, 6, 0, 4, 0, 29, 0, 23],
        // Uncompressed points.
        &[0, 11, 0, 2, 1, 0],
        // Signatures with SHA-256: ECDSA, RSA-PSS and RSA.
        &[0, 13, 0, 8, 0, 6, 4, 3, 8, 4, 4, 1],
    ];
    let extensions = extensions.concat();
    let short = |length: usize| u16::try_from(length).unwrap_or(u16::MAX).to_be_bytes();
    // The random bytes need not be random, as no connection follows.
    let mut hello = [&version[..], &[0x5A; 32], &[0], &suites, &[1, 0]].concat();
    hello.extend(short(extensions.len()));
    hello.extend(extensions);
    let handshake = [&[1, 0][..], &short(hello.len()), &hello].concat();
    [&[0x16, 3, 1][..], &short(handshake.len()), &handshake].concat()
}

/// True if the device answers the beginning of TLS with TLS.
pub(super) fn speaks_tls(mut wire: Wire) -> bool {
    let deadline = wire.deadline();
    let mut answer = Vec::new();
    let asked = wire.send(&client_hello());
    asked.is_ok() && wire.receive(&mut answer, deadline).is_ok() && protocol(&answer) == Some("TLS")
}

/// The protocol that begins an answer with these bytes.
pub(super) fn protocol(bytes: &[u8]) -> Option<&'static str> {
    Some(match bytes {
        [0x15 | 0x16, 3, ..] => "TLS",
        [3, 0, ..] => "ISO on TCP, as S7 does",
        [b'H', b'T', b'T', b'P', ..] | [b'<', ..] => "HTTP",
        [b'S', b'S', b'H', b'-', ..] => "SSH",
        [b'E', b'R', b'R', ..] | [b'A', b'C', b'K', ..] => "OPC UA",
        _ => return None,
    })
}

#[cfg(all(test, unix))]
mod tests {
    use std::io::Write as _;
    use std::sync::Arc;

    use super::*;
    use tickbus_base::os::{Parity, PseudoTerminal, SerialPort, SerialSettings};
    use tickbus_base::time::{Clock, Monotonic};

    const PATIENCE: Nanos = Nanos::from_millis(50);

    const SETTINGS: SerialSettings = SerialSettings {
        baud: 19200,
        parity: Parity::Even,
        two_stop_bits: false,
        seven_bits: false,
        rs485: false,
    };

    /// As a program that writes into its end without a pause.
    #[test]
    fn a_line_that_floods_has_an_end() {
        for (coding, flood) in [(Coding::Rtu, &[0][..]), (Coding::Ascii, b":0103")] {
            let (mut far, near) = PseudoTerminal::open().expect("a pseudo-terminal");
            let flood = flood.repeat(4096);
            std::thread::spawn(move || while far.write_all(&flood).is_ok() {});
            let clock: Arc<dyn Clock> = Monotonic::shared();
            let port = SerialPort::open(&near, SETTINGS).expect("a port");
            let frame = Frame::Serial {
                coding,
                echoes: false,
                apart: Nanos::ZERO,
            };
            let mut talk = Talk::new(Wire::serial(port, PATIENCE, &clock), frame);
            let (ended, has_ended) = std::sync::mpsc::channel();
            std::thread::spawn(move || ended.send(talk.identity(1).is_err()));
            let answer = has_ended.recv_timeout(std::time::Duration::from_secs(20));
            assert_eq!(answer, Ok(true), "{coding:?}");
        }
    }
}
