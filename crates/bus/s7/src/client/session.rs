//! The client's side of one connection, without I/O: time and received bytes go in, bytes to send and the
//! next deadline come out.

use super::in_flight::InFlight;
use super::plan::{Job, JobDirection};
use super::traffic::{Traffic, function_of, write_data};
use super::{ConnectionParameters, End, FrameFields, Refusal, SessionEvent};
use crate::ProtocolError;
use crate::item::{self, Data, ReturnCode};
use crate::length::{LONGEST, SHORTEST};
use crate::pdu::{Draft, JOBS, Kind, Pdu, error, function};
use crate::szl::{self, Identity};
use crate::transport::{self, Connect, Tpdu};
use tickbus_base::time::Nanos;

/// The client's reference, the same on every connection: a socket carries only one.
const REFERENCE: u16 = 1;

/// The requested transport size: 1024 bytes, enough for the longest PDU.
const TPDU: u8 = 10;

/// The longest list that is read; identities are far shorter.
const LIST_LIMIT: usize = 16_384;

/// The lists with a CPU's identity, and the one with its operating state.
const LISTS: [u16; 3] = [0x0011, 0x001C, szl::STATE];

/// The index of the last of them.
const STATE: usize = 2;

/// One connection to a CPU.
///
/// The owner of the socket passes the bytes that it reads to [`hear`](Self::hear), writes [`to_write`](Self::to_write),
/// reports how much the system accepted by [`wrote`](Self::wrote), and calls [`check`](Self::check) to see whether the
/// connection may continue. After [`SessionEvent::Met`] it starts a cycle by [`begin`](Self::begin), or asks for the
/// operating state by [`ask_state`](Self::ask_state), whenever the session [is idle](Self::is_idle);
/// [`SessionEvent::Done`] ends the cycle, [`SessionEvent::State`] the question.
#[derive(Debug)]
pub struct ClientSession {
    terms: ConnectionParameters,
    phase: Phase,
    /// Received bytes of an incomplete packet.
    inbox: Vec<u8>,
    /// Received pieces of an incomplete message.
    pieces: Vec<u8>,
    outbox: Vec<u8>,
    pdu: u16,
    /// Power of two of the longest TPDU.
    size: u8,
    /// The reference of the last request.
    reference: u16,
    /// The time since which an answer has been pending: that of the last request or answer.
    asked: Option<Nanos>,
    in_flight: InFlight,
    identity: Identity,
    /// The received part of the list being read.
    list: Vec<u8>,
    traffic: Traffic,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// A transport connection was requested.
    Connecting,
    /// The PDU length is being negotiated.
    Agreeing,
    /// The list with this index was requested.
    Asking(usize),
    /// Nothing is pending.
    Idle,
    /// Jobs are pending.
    Working,
}

impl FrameFields {
    /// A session that transfers them.
    pub fn session(&self, terms: ConnectionParameters, now: Nanos) -> ClientSession {
        ClientSession::new(terms, now, self.clone())
    }
}

impl ClientSession {
    /// A session that starts at `now` and transfers these frames.
    fn new(terms: ConnectionParameters, now: Nanos, frames: FrameFields) -> Self {
        let mut session = Self {
            phase: Phase::Connecting,
            inbox: Vec::new(),
            pieces: Vec::new(),
            outbox: Vec::new(),
            pdu: LONGEST,
            size: TPDU,
            reference: 0,
            asked: Some(now),
            in_flight: InFlight::new(),
            identity: Identity::default(),
            list: Vec::new(),
            traffic: Traffic::new(frames),
            terms,
        };
        let connect = Connect {
            source: REFERENCE,
            destination: 0,
            size: Some(TPDU),
            calling: session.terms.calling.as_bytes(),
            called: session.terms.called.as_bytes(),
        };
        transport::write_request(&connect, &mut session.outbox);
        session
    }

    /// Allows or forbids writing frames from now on. The session must be idle.
    pub fn allow(&mut self, may_write: bool) {
        self.traffic.may_write = may_write;
        self.traffic.plan(usize::from(self.pdu));
    }

    /// Excludes a station from the cycles, or includes it again. The session must be idle.
    pub fn suspend(&mut self, station: usize, is_out: bool) {
        if std::mem::replace(&mut self.traffic.suspended[station], is_out) != is_out {
            self.traffic.plan(usize::from(self.pdu));
        }
    }

    /// True while the CPU is being asked for its identity.
    pub fn asks_who(&self) -> bool {
        matches!(self.phase, Phase::Asking(list) if list < STATE)
    }

    /// True while the CPU is being asked for its operating state.
    pub fn asks_state(&self) -> bool {
        self.phase == Phase::Asking(STATE)
    }

    /// True if a cycle can start.
    pub fn is_idle(&self) -> bool {
        self.phase == Phase::Idle
    }

    /// The buffer for the frame that the next cycle writes to a station.
    pub fn frame_to_write(&mut self, station: usize) -> &mut [u8] {
        &mut self.traffic.out[station]
    }

    /// The frame that the last cycle read from a station: only the bits of its signals.
    pub fn frame_read(&self, station: usize) -> &[u8] {
        &self.traffic.into[station]
    }

    /// The CPU's refusal for a station in the last cycle; everything else was transferred.
    pub fn refusal(&self, station: usize) -> Option<&Refusal> {
        self.traffic.refused[station].as_ref()
    }

    /// Starts a cycle at `now`; returns news if the cycle has no jobs.
    ///
    /// # Panics
    ///
    /// When the session is not idle.
    pub fn begin(&mut self, now: Nanos) -> Option<SessionEvent> {
        assert!(self.is_idle(), "one cycle at a time");
        self.restart(now)
    }

    /// Asks for the operating state at `now`.
    ///
    /// # Panics
    ///
    /// When the session is not idle.
    pub fn ask_state(&mut self, now: Nanos) {
        assert!(self.is_idle(), "one question at a time");
        self.ask_list(now, STATE);
    }

    /// The bytes to be written, if any.
    pub fn to_write(&self) -> &[u8] {
        &self.outbox
    }

    /// The system accepted `count` bytes of [`to_write`](Self::to_write).
    pub fn wrote(&mut self, count: usize) {
        self.outbox.drain(..count);
    }

    /// When the time-out of the pending answer ends.
    pub fn deadline(&self) -> Nanos {
        self.asked
            .map_or(Nanos::MAX, |asked| asked + self.terms.patience + Nanos(1))
    }

    /// Checks that the connection may continue at `now`.
    ///
    /// # Errors
    ///
    /// An answer has timed out.
    pub fn check(&self, now: Nanos) -> Result<(), End> {
        match self.asked {
            Some(asked) if now - asked > self.terms.patience => {
                Err(End::Silent(self.terms.patience))
            }
            _ => Ok(()),
        }
    }

    /// Takes in received bytes, up to the next news; more may be buffered, so call it again without bytes
    /// until it returns none.
    ///
    /// # Errors
    ///
    /// Why the connection ends.
    pub fn hear(&mut self, now: Nanos, bytes: &[u8]) -> Result<Option<SessionEvent>, End> {
        let mut inbox = std::mem::take(&mut self.inbox);
        inbox.extend_from_slice(bytes);
        let mut taken = 0;
        let mut news = Ok(None);
        while let Ok(None) = news {
            match transport::read(&inbox[taken..]) {
                Ok(None) => break,
                Ok(Some((length, tpdu))) => {
                    taken += length;
                    news = self.packet(now, tpdu);
                }
                Err(fault) => news = Err(fault.into()),
            }
        }
        inbox.drain(..taken);
        self.inbox = inbox;
        news
    }

    fn packet(&mut self, now: Nanos, tpdu: Tpdu<'_>) -> Result<Option<SessionEvent>, End> {
        match (tpdu, self.phase) {
            (Tpdu::ConnectConfirm(confirm), Phase::Connecting) => {
                self.size = confirm.size.unwrap_or(TPDU).min(TPDU);
                self.agree(now);
                Ok(None)
            }
            (Tpdu::Disconnect(reason), Phase::Connecting) => {
                Err(End::Refused(Refusal::Connection(reason)))
            }
            (Tpdu::Disconnect(reason), _) => Err(ProtocolError::Disconnected(reason).into()),
            (Tpdu::Error(cause), _) => Err(ProtocolError::Rejected(cause).into()),
            (Tpdu::Data { .. }, Phase::Connecting) => Err(ProtocolError::NotConnected.into()),
            (Tpdu::Data { last, bytes }, _) => self.piece(now, last, bytes),
            (Tpdu::ConnectRequest(_) | Tpdu::ConnectConfirm(_), _) => {
                Err(ProtocolError::ConnectedTwice.into())
            }
        }
    }

    fn piece(&mut self, now: Nanos, last: bool, bytes: &[u8]) -> Result<Option<SessionEvent>, End> {
        if self.pieces.len() + bytes.len() > usize::from(self.pdu) || (bytes.is_empty() && !last) {
            return Err(ProtocolError::Pieces(self.pdu).into());
        }
        if last && self.pieces.is_empty() {
            // An empty message is a keep-alive.
            return if bytes.is_empty() {
                Ok(None)
            } else {
                self.message(now, bytes)
            };
        }
        self.pieces.extend_from_slice(bytes);
        if !last {
            return Ok(None);
        }
        let whole = std::mem::take(&mut self.pieces);
        let news = self.message(now, &whole);
        self.pieces = whole;
        self.pieces.clear();
        news
    }

    fn message(&mut self, now: Nanos, message: &[u8]) -> Result<Option<SessionEvent>, End> {
        let answer = Pdu::read(message)?;
        if answer.kind == Kind::Job {
            return Err(ProtocolError::Asks.into());
        }
        if self.phase == Phase::Working {
            let job = self.in_flight.take(answer.reference);
            let job = job.ok_or(ProtocolError::NotAsked)?;
            self.asked = (!self.in_flight.is_empty()).then_some(now);
            return self.done(now, job, &answer);
        }
        if self.asked.is_none() || answer.reference != self.reference {
            return Err(ProtocolError::NotAsked.into());
        }
        self.asked = None;
        match self.phase {
            Phase::Agreeing => self.agreed(now, &answer),
            Phase::Asking(index) => self.told(now, index, &answer),
            Phase::Connecting | Phase::Idle | Phase::Working => Err(ProtocolError::NotAsked.into()),
        }
    }

    /// Appends a PDU of `kind`, made by `fill`, and waits for its answer.
    fn ask(&mut self, now: Nanos, kind: Kind, fill: impl FnOnce(&mut Draft, &mut Vec<u8>)) {
        self.reference = self.reference.wrapping_add(1);
        self.asked = Some(now);
        let out = &mut self.outbox;
        let begin = transport::begin_data(out);
        let mut draft = Draft::begin(kind, self.reference, error::NONE, out);
        fill(&mut draft, out);
        draft.end(out);
        transport::end_data(begin, self.size, out);
    }

    fn agree(&mut self, now: Nanos) {
        self.phase = Phase::Agreeing;
        let pdu = self.terms.pdu;
        self.ask(now, Kind::Job, |_, out| {
            out.extend_from_slice(&[function::SETUP, 0]);
            for number in [JOBS, JOBS, pdu] {
                out.extend_from_slice(&number.to_be_bytes());
            }
        });
    }

    fn agreed(&mut self, now: Nanos, answer: &Pdu<'_>) -> Result<Option<SessionEvent>, End> {
        whole(answer)?;
        let [function::SETUP, _, g0, g1, d0, d1, l0, l1] = *answer.parameters else {
            return Err(ProtocolError::Answer("no agreement on the length of units").into());
        };
        let [calling, called, length] = [[g0, g1], [d0, d1], [l0, l1]].map(u16::from_be_bytes);
        if !(SHORTEST..=LONGEST).contains(&length) {
            return Err(ProtocolError::Agreed(length).into());
        }
        self.pdu = length;
        // Which of the two counts the jobs of a client is read differently by the makers.
        self.in_flight.agree(calling.min(called).clamp(1, JOBS));
        if self.terms.asks_who {
            self.ask_list(now, 0);
            return Ok(None);
        }
        Ok(Some(self.meet(None)))
    }

    fn meet(&mut self, identity: Option<Identity>) -> SessionEvent {
        self.phase = Phase::Idle;
        self.allow(false);
        SessionEvent::Met(self.pdu, identity)
    }

    /// Requests the list with this index.
    fn ask_list(&mut self, now: Nanos, index: usize) {
        self.phase = Phase::Asking(index);
        self.list.clear();
        let [high, low] = LISTS[index].to_be_bytes();
        self.ask(now, Kind::UserData, |draft, out| {
            out.extend_from_slice(&[0, 1, 0x12, 4, 0x11, 0x44, 1, 0]);
            draft.data(out);
            out.extend_from_slice(&[0xFF, 9, 0, 4, high, low, 0, 0]);
        });
    }

    /// A piece of a list has arrived, or a refusal.
    fn told(
        &mut self,
        now: Nanos,
        index: usize,
        answer: &Pdu<'_>,
    ) -> Result<Option<SessionEvent>, End> {
        const WRONG: ProtocolError = ProtocolError::Answer("no system status list");
        // A peer without such requests answers them like jobs.
        let mut more = None;
        if answer.kind == Kind::UserData {
            let [_, _, 0x12, 8, _, 0x84, 1, sequence, _, last, e0, e1] = *answer.parameters else {
                return Err(WRONG.into());
            };
            let datum = Data::new(1, answer.data).and_then(|mut data| data.next());
            match datum {
                Some(datum) if datum.code == ReturnCode::OK && [e0, e1] == [0, 0] => {
                    if datum.bytes.is_empty() && last != 0 {
                        return Err(WRONG.into());
                    }
                    self.list.extend_from_slice(datum.bytes);
                    more = (last != 0).then_some(sequence);
                }
                // The CPU does not have this list.
                _ => self.list.clear(),
            }
        }
        if self.list.len() > LIST_LIMIT {
            return Err(ProtocolError::Answer("a system status list without end").into());
        }
        if let Some(sequence) = more {
            self.ask(now, Kind::UserData, |draft, out| {
                out.extend_from_slice(&[0, 1, 0x12, 8, 0x12, 0x44, 1, sequence, 0, 0, 0, 0]);
                draft.data(out);
                item::write_refusal(ReturnCode::MISSING, out);
            });
            return Ok(None);
        }
        if index == STATE {
            self.phase = Phase::Idle;
            return Ok(Some(SessionEvent::State(szl::state(&self.list))));
        }
        szl::learn(&mut self.identity, &self.list);
        if index + 1 < STATE {
            self.ask_list(now, index + 1);
            return Ok(None);
        }
        let identity = std::mem::take(&mut self.identity);
        Ok(Some(self.meet(Some(identity))))
    }

    /// Starts the cycle from its first job.
    fn restart(&mut self, now: Nanos) -> Option<SessionEvent> {
        self.traffic.refused.fill(None);
        self.in_flight.begin();
        self.phase = Phase::Working;
        self.work(now)
    }

    /// Sends as many of the remaining jobs as may be pending; after the last answer, returns the event that the cycle is
    /// over.
    fn work(&mut self, now: Nanos) -> Option<SessionEvent> {
        while let Some(index) = self.in_flight.next(self.traffic.jobs.len()) {
            self.send(now, index);
            self.in_flight.sent(self.reference);
        }
        if !self.in_flight.is_empty() {
            return None;
        }
        self.phase = Phase::Idle;
        Some(SessionEvent::Done)
    }

    fn send(&mut self, now: Nanos, index: usize) {
        let jobs = std::mem::take(&mut self.traffic.jobs);
        let frames = std::mem::take(&mut self.traffic.out);
        let Job { way, pieces } = &jobs[index];
        let [code, count] = function_of(*way, pieces);
        self.ask(now, Kind::Job, |draft, out| {
            out.extend_from_slice(&[code, count]);
            for piece in pieces {
                piece.item.write(out);
            }
            draft.data(out);
            if *way == JobDirection::Write {
                write_data(pieces, &frames, out);
            }
        });
        self.traffic.jobs = jobs;
        self.traffic.out = frames;
    }

    /// A job has been answered.
    fn done(
        &mut self,
        now: Nanos,
        index: usize,
        answer: &Pdu<'_>,
    ) -> Result<Option<SessionEvent>, End> {
        whole(answer)?;
        let Job { way, pieces } = &self.traffic.jobs[index];
        let asked = function_of(*way, pieces);
        if answer.parameters == [asked[0], 1] && asked[1] > 1 {
            // Some servers answer only the first item. The cycle restarts; writing the same value twice does no harm.
            self.in_flight.void();
        }
        if self.in_flight.is_void() {
            if !self.in_flight.is_empty() {
                return Ok(None);
            }
            self.traffic.one_by_one = true;
            self.traffic.plan(usize::from(self.pdu));
            return Ok(self.restart(now));
        }
        if answer.parameters != asked {
            return Err(
                ProtocolError::Answer("another function, or another number of items").into(),
            );
        }
        match way {
            JobDirection::Write => {
                if answer.data.len() != pieces.len() {
                    return Err(ProtocolError::Answer("another number of codes").into());
                }
                for (piece, code) in answer.data.iter().enumerate() {
                    self.traffic.judge(index, piece, ReturnCode(*code));
                }
            }
            JobDirection::Read => {
                let data = Data::new(asked[1], answer.data);
                let data = data.ok_or(ProtocolError::Answer("data that do not add up"))?;
                for (piece, datum) in data.enumerate() {
                    if !self.traffic.judge(index, piece, datum.code) {
                        continue;
                    }
                    let Traffic { jobs, into, .. } = &mut self.traffic;
                    let piece = &jobs[index].pieces[piece];
                    if datum.bytes.len() != piece.item.range().len() {
                        return Err(ProtocolError::Answer("another number of bytes").into());
                    }
                    piece.scatter(datum.bytes, &mut into[piece.station]);
                }
            }
        }
        Ok(self.work(now))
    }
}

/// Checks the header of an answer to a job for an error.
fn whole(answer: &Pdu<'_>) -> Result<(), End> {
    match (answer.kind, answer.error) {
        (Kind::Ack | Kind::AckData, error::NONE) => Ok(()),
        (Kind::Ack | Kind::AckData, code) => Err(End::Refused(Refusal::Job(code))),
        _ => Err(ProtocolError::Answer("a system function").into()),
    }
}

#[cfg(test)]
mod tests;
