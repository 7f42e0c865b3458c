//! The server's side of one connection, without I/O: packets in, packets out, on a memory that is passed in.

use std::ops::Range;

use super::item::{self, Addresses, Data, Element, Item, Object, ReturnCode};
use super::length::{LONGEST, SHORTEST};
use super::pdu::{Draft, JOBS, Kind, Pdu, error, function};
use super::szl::Facts;
use super::transport::{self, Connect, Tpdu};
use super::userdata::{self, Ask, Rest};
use super::{ProtocolError, Tsap};
use tickbus_base::time::Nanos;

/// The largest transport size agreed to: 1024 bytes.
const LARGEST_TPDU: u8 = 10;

/// The server's reference, the same on every connection: a socket carries only one.
const REFERENCE: u16 = 1;

/// The variables of a server.
///
/// A job reads and writes pieces one after another, but is a unit: its reads are consistent, and its writes take effect
/// when [`done`](Self::done) is called.
pub trait Memory {
    /// Bytes of an object that a job reads. They are sent in its answer.
    ///
    /// # Errors
    ///
    /// The code of the item.
    fn read(&mut self, object: Object, range: Range<usize>) -> Result<&[u8], ReturnCode>;

    /// A byte of an object of which a job reads one bit. Only this bit is sent in its answer.
    ///
    /// # Errors
    ///
    /// The code of the item.
    fn read_bit(&mut self, object: Object, byte: usize, bit: u8) -> Result<u8, ReturnCode> {
        let _ = bit;
        Ok(self.read(object, byte..byte + 1)?[0])
    }

    /// A job writes bytes of an object, from the byte `first` on.
    ///
    /// # Errors
    ///
    /// The code of the item.
    fn write(&mut self, object: Object, first: usize, values: &[u8]) -> Result<(), ReturnCode>;

    /// A job writes one bit of a byte of an object.
    ///
    /// # Errors
    ///
    /// The code of the item.
    fn write_bit(
        &mut self,
        object: Object,
        byte: usize,
        bit: u8,
        on: bool,
    ) -> Result<(), ReturnCode>;

    /// A job has been processed, successfully or not.
    fn done(&mut self);

    /// The data blocks and their lengths, in order of their numbers.
    fn blocks(&self) -> &[(u16, usize)];
}

/// The conversation with one client.
#[derive(Debug)]
pub struct ServerSession {
    phase: Phase,
    /// Power of two of the longest TPDU.
    size: u8,
    /// The longest unit.
    pdu: u16,
    called: Tsap,
    /// Received pieces of an incomplete message.
    pieces: Vec<u8>,
    /// The part of a list that the client has not read yet.
    rest: Option<Rest>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The client must request a connection.
    Opening,
    /// The client is connected, and must negotiate the PDU length.
    Connected,
    /// The client may send jobs.
    Agreed,
}

impl Default for ServerSession {
    fn default() -> Self {
        Self {
            phase: Phase::Opening,
            size: LARGEST_TPDU,
            pdu: LONGEST,
            called: Tsap::default(),
            pieces: Vec::new(),
            rest: None,
        }
    }
}

impl ServerSession {
    /// The TSAP that the client connected to; empty before that.
    pub fn called(&self) -> Tsap {
        self.called
    }

    /// Processes the first packet in `bytes` and appends the answer to `reply`. Returns the packet's length,
    /// or 0 if it is incomplete.
    ///
    /// # Errors
    ///
    /// The client violates the protocol, or ends the connection. Send nothing more.
    pub fn packet(
        &mut self,
        now: Nanos,
        bytes: &[u8],
        facts: &Facts,
        memory: &mut impl Memory,
        reply: &mut Vec<u8>,
    ) -> Result<usize, ProtocolError> {
        let Some((length, tpdu)) = transport::read(bytes)? else {
            return Ok(0);
        };
        match (tpdu, self.phase) {
            (Tpdu::ConnectRequest(request), Phase::Opening) => self.connect(&request, reply),
            (Tpdu::Data { .. }, Phase::Opening) => return Err(ProtocolError::NotConnected),
            (Tpdu::Data { last, bytes }, _) => {
                self.piece(now, last, bytes, facts, memory, reply)?;
            }
            (Tpdu::Disconnect(reason), _) => return Err(ProtocolError::Disconnected(reason)),
            (Tpdu::Error(cause), _) => return Err(ProtocolError::Rejected(cause)),
            (Tpdu::ConnectRequest(_) | Tpdu::ConnectConfirm(_), _) => {
                return Err(ProtocolError::ConnectedTwice);
            }
        }
        Ok(length)
    }

    fn connect(&mut self, request: &Connect<'_>, reply: &mut Vec<u8>) {
        let size = request.size.map(|size| size.min(LARGEST_TPDU));
        // Without a size there is no limit, according to RFC 1006.
        self.size = size.unwrap_or(*transport::SIZES.end());
        self.called = Tsap::new(request.called);
        self.phase = Phase::Connected;
        let confirm = Connect {
            source: REFERENCE,
            destination: request.source,
            size,
            ..*request
        };
        transport::write_confirm(&confirm, reply);
    }

    fn piece(
        &mut self,
        now: Nanos,
        last: bool,
        bytes: &[u8],
        facts: &Facts,
        memory: &mut impl Memory,
        reply: &mut Vec<u8>,
    ) -> Result<(), ProtocolError> {
        if last && self.pieces.is_empty() {
            // An empty message is a keep-alive.
            return if bytes.is_empty() {
                Ok(())
            } else {
                self.message(now, bytes, facts, memory, reply)
            };
        }
        if self.pieces.len() + bytes.len() > usize::from(self.pdu) || (bytes.is_empty() && !last) {
            return Err(ProtocolError::Pieces(self.pdu));
        }
        self.pieces.extend_from_slice(bytes);
        if last {
            let whole = std::mem::take(&mut self.pieces);
            self.message(now, &whole, facts, memory, reply)?;
            self.pieces = whole;
            self.pieces.clear();
        }
        Ok(())
    }

    fn message(
        &mut self,
        now: Nanos,
        message: &[u8],
        facts: &Facts,
        memory: &mut impl Memory,
        reply: &mut Vec<u8>,
    ) -> Result<(), ProtocolError> {
        let pdu = Pdu::read(message)?;
        if matches!(pdu.kind, Kind::Ack | Kind::AckData) {
            return Err(ProtocolError::NotAsked);
        }
        let begin = transport::begin_data(reply);
        let done = match (pdu.kind, pdu.parameters.first()) {
            _ if message.len() > usize::from(self.pdu) => Err(error::LENGTHS),
            (Kind::Job, Some(&function::SETUP)) => self.agree(&pdu, facts, reply),
            _ if self.phase != Phase::Agreed => Err(error::NO_FUNCTION),
            (Kind::Job, None) => Err(error::LENGTHS),
            (Kind::Job, Some(&function::READ)) => self.read(&pdu, memory, reply),
            (Kind::Job, Some(&function::WRITE)) => write(&pdu, memory, reply),
            (Kind::Job, Some(_)) => Err(error::NO_FUNCTION),
            _ => {
                let ask = Ask {
                    now,
                    facts,
                    blocks: memory.blocks(),
                    limit: usize::from(self.pdu),
                };
                userdata::answer(&pdu, &ask, &mut self.rest, reply);
                Ok(())
            }
        };
        match done {
            Ok(()) => memory.done(),
            Err(error) => {
                reply.truncate(begin + transport::DATA_HEADER);
                refuse(&pdu, error, reply);
            }
        }
        transport::end_data(begin, self.size, reply);
        Ok(())
    }

    /// Negotiates the PDU length and the number of pending jobs.
    fn agree(&mut self, pdu: &Pdu<'_>, facts: &Facts, reply: &mut Vec<u8>) -> Result<(), u16> {
        let [_, _, g0, g1, d0, d1, l0, l1] = *pdu.parameters else {
            return Err(error::LENGTHS);
        };
        let [calling, called, length] = [[g0, g1], [d0, d1], [l0, l1]].map(u16::from_be_bytes);
        if length < SHORTEST {
            return Err(error::LENGTHS);
        }
        self.pdu = length.min(facts.pdu);
        self.phase = Phase::Agreed;
        let draft = Draft::begin(Kind::AckData, pdu.reference, error::NONE, reply);
        reply.extend_from_slice(&[function::SETUP, 0]);
        for number in [calling.clamp(1, JOBS), called.clamp(1, JOBS), self.pdu] {
            reply.extend_from_slice(&number.to_be_bytes());
        }
        draft.end(reply);
        Ok(())
    }

    fn read(
        &self,
        pdu: &Pdu<'_>,
        memory: &mut impl Memory,
        reply: &mut Vec<u8>,
    ) -> Result<(), u16> {
        // Some clients omit even the number of items, just to check that the server is alive.
        let (count, addresses) = match pdu.parameters {
            [_] => (0, &[][..]),
            [_, count, addresses @ ..] => (*count, addresses),
            [] => return Err(error::LENGTHS),
        };
        let items = Addresses::new(count, addresses).ok_or(error::LENGTHS)?;
        if answer_length(items.clone()) > usize::from(self.pdu) {
            return Err(error::LENGTHS);
        }
        let mut draft = Draft::begin(Kind::AckData, pdu.reference, error::NONE, reply);
        reply.extend_from_slice(&[function::READ, count]);
        draft.data(reply);
        let data = reply.len();
        for item in items {
            if (reply.len() - data) % 2 == 1 {
                reply.push(0);
            }
            let read = item.and_then(|item| read_item(&item, memory, reply));
            if let Err(code) = read {
                item::write_refusal(code, reply);
            }
        }
        draft.end(reply);
        Ok(())
    }
}

fn read_item(item: &Item, memory: &mut impl Memory, reply: &mut Vec<u8>) -> Result<(), ReturnCode> {
    let bit;
    let bytes = match item.element {
        Element::Bit => {
            let byte = memory.read_bit(item.object, item.byte, item.bit)?;
            bit = [byte >> item.bit & 1];
            &bit[..]
        }
        _ => memory.read(item.object, item.range())?,
    };
    item::write_header(ReturnCode::OK, item.element, bytes.len(), reply);
    reply.extend_from_slice(bytes);
    Ok(())
}

/// The length of the answer to these items if all of them can be read.
fn answer_length(items: Addresses<'_>) -> usize {
    let mut length = super::pdu::ANSWER_HEADER + 2;
    for item in items {
        let bytes = item.map_or(0, |item| item.range().len());
        length = length.next_multiple_of(2) + item::DATA_HEADER + bytes;
    }
    length
}

fn write(pdu: &Pdu<'_>, memory: &mut impl Memory, reply: &mut Vec<u8>) -> Result<(), u16> {
    let [_, count, addresses @ ..] = pdu.parameters else {
        return Err(error::LENGTHS);
    };
    let items = Addresses::new(*count, addresses).ok_or(error::LENGTHS)?;
    let data = Data::new(*count, pdu.data).ok_or(error::LENGTHS)?;
    let mut draft = Draft::begin(Kind::AckData, pdu.reference, error::NONE, reply);
    reply.extend_from_slice(&[function::WRITE, *count]);
    draft.data(reply);
    for (item, datum) in items.zip(data) {
        let code = item
            .and_then(|item| write_item(&item, datum.bytes, memory))
            .err();
        reply.push(code.unwrap_or(ReturnCode::OK).0);
    }
    draft.end(reply);
    Ok(())
}

fn write_item(item: &Item, bytes: &[u8], memory: &mut impl Memory) -> Result<(), ReturnCode> {
    let range = item.range();
    if bytes.len() != range.len() {
        return Err(ReturnCode::INCONSISTENT);
    }
    match item.element {
        Element::Bit => memory.write_bit(item.object, item.byte, item.bit, bytes[0] != 0),
        _ => memory.write(item.object, range.start, bytes),
    }
}

/// Appends the refusal of a whole job or userdata request.
fn refuse(pdu: &Pdu<'_>, error: u16, reply: &mut Vec<u8>) {
    if pdu.kind == Kind::UserData {
        userdata::refuse(pdu, error, reply);
        return;
    }
    Draft::begin(Kind::Ack, pdu.reference, error, reply).end(reply);
}

#[cfg(test)]
mod tests;
