//! ISO on TCP: packets (TPKT, RFC 1006) and the transport protocol of class 0 within them (COTP, ISO 8073).
//!
//! Both directions, without I/O. A packet is a TPKT header of four bytes, which has the total length, and one
//! transport protocol data unit (TPDU).

use super::ProtocolError;
use tickbus_fieldbus::faults::WrongAnswer;

/// The port of ISO on TCP, on which every S7 CPU listens.
pub const PORT: u16 = 102;

/// Bytes before a TPDU: version, a reserved byte, length of the packet.
pub const TPKT: usize = 4;

/// Bytes of a data TPDU before its data, packet header included.
pub const DATA_HEADER: usize = TPKT + 3;

/// The longest packet accepted. S7 packets are far shorter.
pub const LONGEST_PACKET: usize = 4096;

/// The longest TSAP, in bytes.
pub const LONGEST_TSAP: usize = 32;

const VERSION: u8 = 3;
const CONNECT_REQUEST: u8 = 0xE0;
const CONNECT_CONFIRM: u8 = 0xD0;
const DISCONNECT_REQUEST: u8 = 0x80;
const DISCONNECT_CONFIRM: u8 = 0xC0;
const ERROR: u8 = 0x70;
const DATA: u8 = 0xF0;
/// In a data TPDU: the last one of its message.
const END: u8 = 0x80;

const SIZE: u8 = 0xC0;
const CALLING: u8 = 0xC1;
const CALLED: u8 = 0xC2;

/// The parameters of a connect request or confirmation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Connect<'a> {
    /// The reference of the sender.
    pub source: u16,
    /// The reference of the receiver; 0 in a request.
    pub destination: u16,
    /// Power of two of the longest TPDU, if stated.
    pub size: Option<u8>,
    /// The TSAP of the client.
    pub calling: &'a [u8],
    /// The TSAP of the server.
    pub called: &'a [u8],
}

/// One TPDU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tpdu<'a> {
    /// A client requests a connection.
    ConnectRequest(Connect<'a>),
    /// A server confirms it.
    ConnectConfirm(Connect<'a>),
    /// A message, or a piece of one.
    Data {
        /// The message ends here.
        last: bool,
        /// The bytes of the message.
        bytes: &'a [u8],
    },
    /// The peer ends the connection, or refuses it; with its reason.
    Disconnect(u8),
    /// The peer rejected a TPDU; with the cause.
    Error(u8),
}

/// The powers of two that are valid as the size of a TPDU: 128 to 8192 bytes.
pub const SIZES: std::ops::RangeInclusive<u8> = 7..=13;

/// Reads the first packet in `bytes`: its length, and its TPDU. `None` if it is incomplete.
///
/// # Errors
///
/// The bytes are not ISO on TCP.
pub fn read(bytes: &[u8]) -> Result<Option<(usize, Tpdu<'_>)>, ProtocolError> {
    let Some(header) = bytes.first_chunk::<TPKT>() else {
        return match bytes.first() {
            Some(&version) if version != VERSION => Err(ProtocolError::NoIsoOnTcp(version)),
            _ => Ok(None),
        };
    };
    let [version, _, high, low] = *header;
    if version != VERSION {
        return Err(ProtocolError::NoIsoOnTcp(version));
    }
    let length = usize::from(u16::from_be_bytes([high, low]));
    // The shortest TPDU is a data TPDU without data.
    if !(DATA_HEADER..=LONGEST_PACKET).contains(&length) {
        return Err(ProtocolError::PacketLength(length));
    }
    let Some(packet) = bytes.get(TPKT..length) else {
        return Ok(None);
    };
    Ok(Some((length, read_tpdu(packet)?)))
}

fn read_tpdu(packet: &[u8]) -> Result<Tpdu<'_>, ProtocolError> {
    let (&indicator, rest) = packet.split_first().ok_or(ProtocolError::TransportHeader)?;
    let header = usize::from(indicator);
    if header > rest.len() {
        return Err(ProtocolError::TransportHeader);
    }
    let (header, data) = rest.split_at(header);
    let (&code, fields) = header.split_first().ok_or(ProtocolError::TransportHeader)?;
    match code & 0xF0 {
        DATA if code == DATA => match fields {
            [number] => Ok(Tpdu::Data {
                last: number & END != 0,
                bytes: data,
            }),
            _ => Err(ProtocolError::TransportHeader),
        },
        CONNECT_REQUEST => read_connect(fields).map(Tpdu::ConnectRequest),
        CONNECT_CONFIRM => read_connect(fields).map(Tpdu::ConnectConfirm),
        DISCONNECT_REQUEST => Ok(Tpdu::Disconnect(fields.get(4).copied().unwrap_or(0))),
        DISCONNECT_CONFIRM => Ok(Tpdu::Disconnect(0)),
        ERROR => Ok(Tpdu::Error(fields.get(2).copied().unwrap_or(0))),
        _ => Err(ProtocolError::TransportUnit(code)),
    }
}

fn read_connect(fields: &[u8]) -> Result<Connect<'_>, ProtocolError> {
    let (fixed, mut parameters) = fields
        .split_first_chunk::<5>()
        .ok_or(ProtocolError::TransportHeader)?;
    let [to_high, to_low, from_high, from_low, class] = *fixed;
    if class & 0xF0 != 0 {
        return Err(ProtocolError::TransportClass(class >> 4));
    }
    let mut connect = Connect {
        source: u16::from_be_bytes([from_high, from_low]),
        destination: u16::from_be_bytes([to_high, to_low]),
        size: None,
        calling: &[],
        called: &[],
    };
    while let [code, length, rest @ ..] = parameters {
        let Some((value, after)) = rest.split_at_checked(usize::from(*length)) else {
            return Err(ProtocolError::TransportHeader);
        };
        parameters = after;
        match (*code, value) {
            (SIZE, [size]) if SIZES.contains(size) => connect.size = Some(*size),
            (SIZE, _) => return Err(ProtocolError::TransportHeader),
            (CALLING | CALLED, name) if name.len() > LONGEST_TSAP => {
                return Err(ProtocolError::TransportHeader);
            }
            (CALLING, name) => connect.calling = name,
            (CALLED, name) => connect.called = name,
            // A receiver ignores unknown parameters, according to the standard.
            _ => {}
        }
    }
    if parameters.is_empty() {
        Ok(connect)
    } else {
        Err(ProtocolError::TransportHeader)
    }
}

/// Appends a packet with a connect request.
pub fn write_request(connect: &Connect<'_>, out: &mut Vec<u8>) {
    let names = [(CALLING, connect.calling), (CALLED, connect.called)];
    write_connect(CONNECT_REQUEST, connect, out, |out| {
        for (code, name) in names {
            write_name(code, name, out);
        }
        write_size(connect.size, out);
    });
}

/// Appends a packet with the confirmation of a connection.
pub fn write_confirm(connect: &Connect<'_>, out: &mut Vec<u8>) {
    let names = [(CALLING, connect.calling), (CALLED, connect.called)];
    write_connect(CONNECT_CONFIRM, connect, out, |out| {
        write_size(connect.size, out);
        for (code, name) in names {
            write_name(code, name, out);
        }
    });
}

fn write_connect(
    code: u8,
    connect: &Connect<'_>,
    out: &mut Vec<u8>,
    parameters: impl FnOnce(&mut Vec<u8>),
) {
    let begin = out.len();
    out.extend_from_slice(&[VERSION, 0, 0, 0, 0, code]);
    out.extend_from_slice(&connect.destination.to_be_bytes());
    out.extend_from_slice(&connect.source.to_be_bytes());
    out.push(0);
    parameters(out);
    let length = out.len() - begin;
    out[begin + 2..begin + TPKT].copy_from_slice(&short(length).to_be_bytes());
    out[begin + TPKT] = u8::try_from(length - TPKT - 1).expect("two short names and a size");
}

fn write_name(code: u8, name: &[u8], out: &mut Vec<u8>) {
    if !name.is_empty() {
        let length = u8::try_from(name.len()).expect("a short name");
        out.extend_from_slice(&[code, length]);
        out.extend_from_slice(name);
    }
}

fn write_size(size: Option<u8>, out: &mut Vec<u8>) {
    if let Some(size) = size {
        out.extend_from_slice(&[SIZE, 1, size]);
    }
}

/// Begins a data packet at the end of `out`; [`end_data`] must follow. Returns its offset.
pub fn begin_data(out: &mut Vec<u8>) -> usize {
    out.extend_from_slice(&[VERSION, 0, 0, 0, 2, DATA, END]);
    out.len() - DATA_HEADER
}

/// Ends the packet at offset `begin`, after whose header the message has been appended. A message longer than
/// a TPDU of 2^`size` bytes is split into several packets.
pub fn end_data(begin: usize, size: u8, out: &mut Vec<u8>) {
    let most = (1 << size) - (DATA_HEADER - TPKT);
    let message = begin + DATA_HEADER;
    let length = out.len() - message;
    if length <= most {
        let packet = short(out.len() - begin);
        out[begin + 2..begin + TPKT].copy_from_slice(&packet.to_be_bytes());
        return;
    }
    let whole = out.split_off(message);
    out.truncate(begin);
    let pieces = whole.chunks(most);
    let count = pieces.len();
    for (index, piece) in pieces.enumerate() {
        let [high, low] = short(DATA_HEADER + piece.len()).to_be_bytes();
        let end = if index + 1 == count { END } else { 0 };
        out.extend_from_slice(&[VERSION, 0, high, low, 2, DATA, end]);
        out.extend_from_slice(piece);
    }
}

fn short(length: usize) -> u16 {
    u16::try_from(length).expect("packets are much shorter than 64 KiB")
}

/// Spoils the last message in `bytes`, whose packets begin at `begin`, if it has data: the answer to a job. Units do not exist here,
/// so such an answer has the reference of another job in that case, too.
pub fn spoil(bytes: &mut Vec<u8>, begin: usize, wrong: WrongAnswer) {
    /// The low byte of the job's reference, behind protocol, kind and two bytes that are 0.
    const REFERENCE: usize = DATA_HEADER + 5;
    if bytes.len() <= begin + REFERENCE || bytes[begin + TPKT + 1] != DATA {
        return;
    }
    match wrong {
        WrongAnswer::Truncated => {
            // A message longer than a TPDU is several packets, and its last byte is in the last one.
            let mut last = begin;
            loop {
                let length = u16::from_be_bytes([bytes[last + 2], bytes[last + 3]]);
                let next = last + usize::from(length);
                if next >= bytes.len() {
                    break;
                }
                last = next;
            }
            bytes.pop();
            let length = short(bytes.len() - last);
            bytes[last + 2..last + TPKT].copy_from_slice(&length.to_be_bytes());
        }
        // A driver.cfg cannot ask for short answers of this bus.
        WrongAnswer::Transaction | WrongAnswer::Unit | WrongAnswer::Short => {
            bytes[begin + REFERENCE] = bytes[begin + REFERENCE].wrapping_add(1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hex;

    const REQUEST: &str = "03 00 00 16 11 e0 0000 0001 00 c1 02 0100 c2 02 0101 c0 01 0a";
    const CONFIRM: &str = "03 00 00 16 11 d0 0001 0001 00 c0 01 0a c1 02 0100 c2 02 0101";

    fn asked(destination: u16) -> Connect<'static> {
        Connect {
            source: 1,
            destination,
            size: Some(10),
            calling: &[1, 0],
            called: &[1, 1],
        }
    }

    #[test]
    fn the_captured_connect_telegrams_are_read_and_written() {
        let (request, confirm) = (hex(REQUEST), hex(CONFIRM));
        assert_eq!(
            read(&request),
            Ok(Some((22, Tpdu::ConnectRequest(asked(0)))))
        );
        assert_eq!(
            read(&confirm),
            Ok(Some((22, Tpdu::ConnectConfirm(asked(1)))))
        );
        let mut written = Vec::new();
        write_request(&asked(0), &mut written);
        assert_eq!(written, request);
        written.clear();
        write_confirm(&asked(1), &mut written);
        assert_eq!(written, confirm);
    }

    #[test]
    fn every_truncation_is_awaited_and_nothing_behind_is_touched() {
        let mut stream = hex(REQUEST);
        stream.extend(hex("03 00 00 08 02 f0 80 32"));
        for cut in 0..stream.len() {
            let read = read(&stream[..cut]).expect("nothing is wrong");
            assert_eq!(read.map(|read| read.0), (cut >= 22).then_some(22), "{cut}");
        }
        assert_eq!(
            read(&stream[22..]),
            Ok(Some((
                8,
                Tpdu::Data {
                    last: true,
                    bytes: &[0x32]
                }
            )))
        );
    }

    #[test]
    fn what_is_no_iso_on_tcp_is_told_at_its_first_byte() {
        for (bytes, fault) in [
            ("47", ProtocolError::NoIsoOnTcp(0x47)),
            ("47 45 54 20", ProtocolError::NoIsoOnTcp(0x47)),
            ("03 00 00 06", ProtocolError::PacketLength(6)),
            ("03 00 ff ff", ProtocolError::PacketLength(65_535)),
            ("03 00 00 07 03 f0 80", ProtocolError::TransportHeader),
            ("03 00 00 07 00 f0 80", ProtocolError::TransportHeader),
            (
                "03 00 00 08 02 10 80 00",
                ProtocolError::TransportUnit(0x10),
            ),
            (
                "03 00 00 08 02 f1 80 00",
                ProtocolError::TransportUnit(0xF1),
            ),
            ("03 00 00 08 03 f0 80 00", ProtocolError::TransportHeader),
            (
                "03 00 00 0b 06 e0 0000 0001 40",
                ProtocolError::TransportClass(4),
            ),
            (
                "03 00 00 0d 08 e0 0000 0001 00 c1 05",
                ProtocolError::TransportHeader,
            ),
            (
                "03 00 00 0c 07 e0 0000 0001 00 c1",
                ProtocolError::TransportHeader,
            ),
            (
                "03 00 00 0e 09 e0 0000 0001 00 c0 01 0e",
                ProtocolError::TransportHeader,
            ),
            (
                "03 00 00 0a 05 e0 0000 0001",
                ProtocolError::TransportHeader,
            ),
        ] {
            assert_eq!(read(&hex(bytes)), Err(fault), "{bytes}");
        }
    }

    #[test]
    fn disconnects_and_errors_have_their_reason() {
        assert_eq!(
            read(&hex("03 00 00 0b 06 80 0000 0001 02")),
            Ok(Some((11, Tpdu::Disconnect(2))))
        );
        assert_eq!(
            read(&hex("03 00 00 09 04 70 0001 03")),
            Ok(Some((9, Tpdu::Error(3))))
        );
    }

    #[test]
    fn a_long_message_is_cut_into_pieces_and_the_last_says_so() {
        let message: Vec<u8> = (0..=255).collect();
        for size in SIZES {
            let mut out = vec![7];
            let begin = begin_data(&mut out);
            out.extend_from_slice(&message);
            end_data(begin, size, &mut out);
            let (mut rest, mut joined, mut ended) = (&out[1..], Vec::new(), false);
            while let Some((length, tpdu)) = read(rest).expect("written well") {
                let Tpdu::Data { last, bytes } = tpdu else {
                    panic!("{tpdu:?}");
                };
                assert!(length - TPKT <= 1 << size && !ended);
                (rest, ended) = (&rest[length..], last);
                joined.extend_from_slice(bytes);
            }
            assert!(ended && rest.is_empty() && joined == message);
        }
    }
}
