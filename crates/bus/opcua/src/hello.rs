//! The first message of a connection and its answer (OPC 10000-6, 7.1.2): whether a peer speaks OPC UA at all. Needs no
//! stack, so every build has it.

use tickbus_fieldbus::examine::{Examination, Wire, WireEnd};

use super::Url;

/// Bytes of the header of a message: its type, a chunk type, its length.
const HEADER: usize = 8;

/// The sizes of the buffers that this end offers; 8192 is the least that every end has.
const BUFFER: u32 = 65_536;

/// The answer of a peer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    /// The peer speaks OPC UA.
    Acknowledged,
    /// The peer speaks OPC UA, and refuses, with this status and reason.
    Refused(u32, String),
    /// The peer speaks something else.
    Alien(Vec<u8>),
    /// There is no answer.
    End(WireEnd),
}

/// The message, for the server at this URL.
fn message(url: &str) -> Vec<u8> {
    let length = |length: usize| u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes();
    let mut bytes = b"HELF".to_vec();
    bytes.extend(length(HEADER + 6 * 4 + url.len()));
    // The version, the buffers, and no limit for messages and chunks.
    for word in [0, BUFFER, BUFFER, 0, 0] {
        bytes.extend(u32::to_le_bytes(word));
    }
    bytes.extend(length(url.len()));
    bytes.extend(url.as_bytes());
    bytes
}

/// The answer at the beginning of `bytes`, once it is complete.
fn read(bytes: &[u8]) -> Option<Answer> {
    let kinds: [&[u8]; 2] = [b"ACKF", b"ERRF"];
    let known = bytes.len().min(4);
    if !kinds.iter().any(|kind| kind[..known] == bytes[..known]) {
        return Some(Answer::Alien(bytes.to_vec()));
    }
    let word = |at: usize| Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
    let length = word(4)? as usize;
    if !(HEADER..=4096 + HEADER).contains(&length) {
        return Some(Answer::Alien(bytes.to_vec()));
    }
    let whole = bytes.get(..length)?;
    if whole.starts_with(b"ACKF") {
        return Some(Answer::Acknowledged);
    }
    let reason = whole.get(HEADER + 8..).unwrap_or_default();
    Some(Answer::Refused(
        word(HEADER)?,
        String::from_utf8_lossy(reason).into_owned(),
    ))
}

/// Says hello to the server at `url`.
pub(crate) fn greet(wire: &mut Wire, url: &str) -> Answer {
    if let Err(end) = wire.send(&message(url)) {
        return Answer::End(end);
    }
    let deadline = wire.deadline();
    let mut bytes = Vec::new();
    loop {
        if let Err(end) = wire.receive(&mut bytes, deadline) {
            return Answer::End(end);
        }
        if let Some(answer) = read(&bytes) {
            return answer;
        }
    }
}

/// The step `protocol`: whether the peer speaks OPC UA.
pub(crate) fn says_hello(examination: &mut Examination<'_>, wire: &mut Wire, url: &Url) -> bool {
    let (cause, told, next) = match greet(wire, &url.to_string()) {
        Answer::Acknowledged => {
            examination.ok(
                "protocol",
                format!("{url} answers as an OPC UA server does"),
            );
            return true;
        }
        Answer::Refused(status, reason) => {
            // BadTcpServerTooBusy, BadTcpNotEnoughResources, BadMaxConnectionsReached, BadTooManyOperations.
            let is_full = [0x807D_0000, 0x8081_0000, 0x80B7_0000, 0x8010_0000].contains(&status);
            let told = format!("{url} refuses the connection (status 0x{status:08X} {reason})");
            if is_full {
                (
                    "connection-limit",
                    told,
                    "end other clients, or raise their number in the server",
                )
            } else {
                (
                    "connection-refused",
                    told,
                    "correct the path of the url: it must be as the server announces it",
                )
            }
        }
        Answer::Alien(bytes) => {
            let first = &bytes[..bytes.len().min(16)];
            let told = format!("{url} answers with bytes that are no OPC UA ({first:02X?})");
            (
                "not-opcua",
                told,
                "correct the port (OPC UA usually has 4840), or the kind of bus",
            )
        }
        Answer::End(WireEnd::Silent) => (
            "silent",
            format!("{url} does not answer"),
            "the port is open, but nothing answers: see what listens there, and whether the server is busy",
        ),
        Answer::End(end) => (
            "connection-limit",
            format!("{url} {end}"),
            "the server lets nobody in: end other clients, and see its log",
        ),
    };
    examination.fail("protocol", cause, told, next);
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_has_its_length_and_every_truncation_of_an_answer_waits() {
        let sent = message("opc.tcp://a");
        assert_eq!(sent.len(), 43);
        assert_eq!(sent[4..8], [43, 0, 0, 0]);
        let mut busy = b"ERRF".to_vec();
        busy.extend([20, 0, 0, 0, 0, 0, 0x7D, 0x80, 4, 0, 0, 0]);
        busy.extend(b"full");
        for cut in 0..busy.len() {
            assert_eq!(read(&busy[..cut]), None, "{cut}");
        }
        assert_eq!(
            read(&busy),
            Some(Answer::Refused(0x807D_0000, "full".to_owned()))
        );
        let mut ack = b"ACKF".to_vec();
        ack.extend([28, 0, 0, 0]);
        ack.extend([0; 20]);
        assert_eq!(read(&ack), Some(Answer::Acknowledged));
        for alien in [&b"H"[..], b"HTTP", b"ACKF\x01\0\0\0", b"\x03\0\0\x16"] {
            assert_eq!(read(alien), Some(Answer::Alien(alien.to_vec())));
        }
    }
}
