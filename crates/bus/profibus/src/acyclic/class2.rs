//! The connections of MS2: any master opens one, uses it, and closes it.

use tickbus_base::time::Nanos;

use super::pdu::{Refusal, function, refuse};
use super::records::Called;
use super::{Peer, Reply};

/// The access point of the first connection; the others have those below.
const HIGHEST_SAP: u8 = 48;

/// The octets of a request to open a connection, without the additional addresses.
const INITIATE_HEAD: usize = 16;

/// The octets of an additional address that names no network: `API` and `SCL`.
const NO_NETWORK: usize = 2;

/// The service that every device has: reading and writing.
const FEATURES: [u8; 2] = [0x01, 0];

/// Why this end closes a connection: the octet of `Instance` (MS2) and `Reason_Code`.
#[derive(Clone, Copy)]
#[repr(u8)]
enum Reason {
    /// A request before the answer to the last one was fetched.
    Sequence = 0x11,
    /// A request that is none.
    Request = 0x12,
    /// The master is silent.
    Timeout = 0x13,
    /// An additional address that this end does not have.
    Address = 0x17,
}

/// The connections of a station.
#[derive(Debug)]
pub(super) struct Connections {
    all: Vec<Option<Connection>>,
    /// `Send_Timeout` in units of 10 ms.
    send_timeout: u16,
    /// The most octets of a record.
    room: u8,
}

#[derive(Debug)]
struct Connection {
    peer: Peer,
    send_timeout: Nanos,
    /// When the master has been silent for too long.
    deadline: Nanos,
    /// The answer that the master has not fetched yet; empty if there is no such answer.
    answer: Vec<u8>,
    /// The connection closes with this answer.
    ends: bool,
    called: Called,
}

impl Connection {
    /// Provides an answer, which the master has to fetch in time.
    fn answer(&mut self, now: Nanos, answer: Vec<u8>) {
        self.answer = answer;
        self.deadline = now + self.send_timeout;
    }

    fn abort(&mut self, now: Nanos, why: Reason) {
        // No subnet.
        self.answer(now, vec![function::ABORT, 0, why as u8]);
        self.ends = true;
    }
}

impl Connections {
    pub(super) fn new(count: u8, send_timeout: u16, room: usize) -> Self {
        Self {
            all: (0..count.min(HIGHEST_SAP)).map(|_| None).collect(),
            send_timeout: send_timeout.max(1),
            room: u8::try_from(room).expect("at most 240"),
        }
    }

    pub(super) fn deadline(&self) -> Nanos {
        let open = self.all.iter().flatten();
        open.map(|own| own.deadline).min().unwrap_or(Nanos::MAX)
    }

    /// Ends the connections of silent masters: the next request gets that as its answer, if it comes within another
    /// `Send_Timeout`.
    pub(super) fn turn(&mut self, now: Nanos) {
        for own in &mut self.all {
            match own {
                Some(silent) if silent.deadline > now => {}
                Some(silent) if !silent.ends => silent.abort(now, Reason::Timeout),
                _ => *own = None,
            }
        }
    }

    /// Opens a connection. An empty request only asks which access point the next one would have.
    pub(super) fn open(&mut self, now: Nanos, peer: Peer, request: &[u8]) -> Reply {
        if self.all.is_empty() {
            return Reply::Closed;
        }
        let Some(free) = self.all.iter().position(Option::is_none) else {
            return Reply::Full;
        };
        if !request.is_empty() {
            let mut send_timeout = self.send_timeout;
            let answer = match Initiate::read(request) {
                Ok(initiate) => {
                    send_timeout = send_timeout.max(initiate.send_timeout);
                    Ok(initiate.answer(self.room))
                }
                Err(why) => Err(why),
            };
            let mut own = Connection {
                peer,
                send_timeout: Nanos::from_millis(10 * i64::from(send_timeout)),
                deadline: now,
                answer: Vec::new(),
                ends: false,
                called: Called::default(),
            };
            match answer {
                Ok(answer) => own.answer(now, answer),
                Err(why) => own.abort(now, why),
            }
            self.all[free] = Some(own);
        }
        let mut offer = vec![function::RESOURCE_MANAGER, sap(free)];
        offer.extend(self.send_timeout.to_be_bytes());
        Reply::Data(offer)
    }

    /// A request on a connection, or an empty one that fetches the answer to the last; `records` serves the requests
    /// for records.
    pub(super) fn serve(
        &mut self,
        now: Nanos,
        peer: Peer,
        at: u8,
        request: &[u8],
        records: impl FnOnce(&[u8], &mut Called) -> Vec<u8>,
    ) -> Reply {
        let slots = (0..).zip(&mut self.all);
        let mut slots = slots.filter(|(number, _)| sap(*number) == at);
        let Some((_, slot)) = slots.next() else {
            return Reply::Closed;
        };
        let Some(own) = slot.as_mut().filter(|own| own.peer == peer) else {
            return Reply::Closed;
        };
        match request.first() {
            Some(&function::ABORT) => {
                *slot = None;
                return Reply::Nothing;
            }
            None if own.answer.is_empty() => return Reply::Nothing,
            None => {}
            Some(_) if own.ends => {}
            Some(_) if !own.answer.is_empty() => own.abort(now, Reason::Sequence),
            Some(&service) => {
                match service {
                    function::IDLE => own.answer(now, request.to_vec()),
                    function::READ | function::WRITE => {
                        let answer = records(request, &mut own.called);
                        own.answer(now, answer);
                    }
                    function::DATA_TRANSPORT => {
                        let mut answer = Vec::new();
                        refuse(service, Refusal::NotSupported, &mut answer);
                        own.answer(now, answer);
                    }
                    _ => own.abort(now, Reason::Request),
                }
                return Reply::Nothing;
            }
        }
        let answer = std::mem::take(&mut own.answer);
        if own.ends {
            *slot = None;
        } else {
            // The next request has to come within twice that time; a master without one sends an idle request.
            own.deadline = now + own.send_timeout + own.send_timeout;
        }
        Reply::Data(answer)
    }
}

/// The access point of a connection.
fn sap(number: usize) -> u8 {
    HIGHEST_SAP - u8::try_from(number).expect("there are at most 48")
}

/// A request to open a connection.
struct Initiate<'a> {
    /// In units of 10 ms.
    send_timeout: u16,
    /// `Profile_Ident_Number`.
    profile: [u8; 2],
    /// Kind, length, and octets of the master's additional address.
    source: (u8, u8, &'a [u8]),
    /// The octets of this end's own.
    destination: &'a [u8],
}

impl<'a> Initiate<'a> {
    fn read(request: &'a [u8]) -> Result<Self, Reason> {
        let (head, addresses) = request
            .split_first_chunk::<INITIATE_HEAD>()
            .ok_or(Reason::Request)?;
        let &[
            service,
            _,
            _,
            _,
            high,
            low,
            _,
            _,
            _,
            _,
            first,
            second,
            source_kind,
            source_length,
            kind,
            length,
        ] = head;
        if service != function::INITIATE {
            return Err(Reason::Request);
        }
        // Kind 0 names no network; a network behind this end does not exist.
        if kind != 0 {
            return Err(Reason::Address);
        }
        let is_plain = |length: u8| usize::from(length) == NO_NETWORK;
        if !is_plain(length) || source_kind == 0 && !is_plain(source_length) {
            return Err(Reason::Request);
        }
        let lengths = (usize::from(source_length), usize::from(length));
        if addresses.len() != lengths.0 + lengths.1 {
            return Err(Reason::Address);
        }
        let (source, destination) = addresses.split_at(lengths.0);
        Ok(Self {
            send_timeout: u16::from_be_bytes([high, low]),
            profile: [first, second],
            source: (source_kind, source_length, source),
            destination,
        })
    }

    /// The answer that accepts the connection: the addresses change places.
    fn answer(&self, room: u8) -> Vec<u8> {
        let mut answer = vec![function::INITIATE, room];
        answer.extend(FEATURES);
        answer.extend([0, 0]); // Profile_Features_Supported
        answer.extend(self.profile);
        let (kind, length, source) = self.source;
        answer.extend([0, 2, kind, length]);
        answer.extend_from_slice(self.destination);
        answer.extend_from_slice(source);
        answer
    }
}
