//! A client's side of one connection, without I/O: time and bytes are handed in, bytes and the next deadline come
//! out.

use super::plan::{self, Image, Job, Piece, Way};
use super::{End, News, Refusal, Terms};
use crate::fieldbus::s7::Fault;
use crate::fieldbus::s7::item::{self, Code, Data};
use crate::fieldbus::s7::lists::{self, Identity};
use crate::fieldbus::s7::pdu::{Draft, Kind, LONGEST, Pdu, SHORTEST, error, function};
use crate::fieldbus::s7::transport::{self, Connect, Tpdu};
use crate::time::Nanos;

/// This client's reference of every connection: there is one connection per socket.
const REFERENCE: u16 = 1;

/// The transport size that is asked for: 1024 bytes, which hold the longest unit.
const TPDU: u8 = 10;

/// The longest list that is fetched; an identity is shorter by far.
const LIST_LIMIT: usize = 16_384;

/// The lists that tell who a CPU is.
const LISTS: [u16; 2] = [0x0011, 0x001C];

/// One connection with a CPU.
///
/// The owner of the socket hands what it reads to [`hear`](Self::hear), writes [`to_write`](Self::to_write) and says
/// how much the system took by [`wrote`](Self::wrote), and asks [`check`](Self::check) whether the connection may go
/// on. Once [`News::Met`] was heard, it begins a cycle by [`begin`](Self::begin) whenever the dialog
/// [is idle](Self::is_idle); [`News::Done`] ends the cycle.
#[derive(Debug)]
pub struct Dialog {
    terms: Terms,
    phase: Phase,
    /// Bytes that have come and are no whole packet yet.
    inbox: Vec<u8>,
    /// The pieces of a message whose last one has not come.
    pieces: Vec<u8>,
    outbox: Vec<u8>,
    pdu: u16,
    /// Power of two of the longest TPDU.
    size: u8,
    reference: u16,
    /// Since when an answer is awaited.
    asked: Option<Nanos>,
    identity: Identity,
    /// What has come of the list that is being fetched.
    list: Vec<u8>,
    images: Images,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// A transport connection is asked for.
    Connecting,
    /// The length of units is to be agreed.
    Agreeing,
    /// The CPU is asked for the list with this index.
    Asking(usize),
    /// There is nothing to do.
    Idle,
    /// The job with this index is under way.
    Working(usize),
}

/// The images of all stations, and the jobs that carry them.
#[derive(Debug, Default)]
struct Images {
    written: Vec<Image>,
    read: Vec<Image>,
    jobs: Vec<Job>,
    /// The frames of this cycle, by station: those to be written, and those read.
    out: Vec<Box<[u8]>>,
    into: Vec<Box<[u8]>>,
    may_write: bool,
}

impl Dialog {
    /// A dialog that begins at `now`. For each station: what it writes and where, what it reads.
    pub(super) fn new(terms: Terms, now: Nanos, written: Vec<Image>, read: Vec<Image>) -> Self {
        let frames = |images: &[Image]| {
            let stations = images.iter().map(|image| image.station + 1).max();
            let length = |station| {
                let mut own = images.iter().filter(move |image| image.station == station);
                own.next().map_or(0, |image| image.length)
            };
            let all = 0..stations.unwrap_or(0);
            all.map(|station| vec![0; length(station)].into()).collect()
        };
        let images = Images {
            out: frames(&written),
            into: frames(&read),
            written,
            read,
            ..Images::default()
        };
        let mut dialog = Self {
            phase: Phase::Connecting,
            inbox: Vec::new(),
            pieces: Vec::new(),
            outbox: Vec::new(),
            pdu: LONGEST,
            size: TPDU,
            reference: 0,
            asked: Some(now),
            identity: Identity::default(),
            list: Vec::new(),
            images,
            terms,
        };
        let connect = Connect {
            source: REFERENCE,
            destination: 0,
            size: Some(TPDU),
            calling: dialog.terms.calling.as_bytes(),
            called: dialog.terms.called.as_bytes(),
        };
        transport::write_request(&connect, &mut dialog.outbox);
        dialog
    }

    /// Lets images be written from now on, or not. The dialog has to be idle.
    pub fn allow(&mut self, may_write: bool) {
        let images = &mut self.images;
        images.may_write = may_write;
        let limit = usize::from(self.pdu);
        images.jobs.clear();
        if may_write {
            let jobs = plan::jobs(Way::Write, &images.written, limit);
            images.jobs.extend(jobs);
        }
        let jobs = plan::jobs(Way::Read, &images.read, limit);
        images.jobs.extend(jobs);
    }

    /// Whether the CPU is being asked who it is.
    pub fn asks_who(&self) -> bool {
        matches!(self.phase, Phase::Asking(_))
    }

    /// Whether a cycle may begin.
    pub fn is_idle(&self) -> bool {
        self.phase == Phase::Idle
    }

    /// Where the frame of a station goes that the next cycle writes; empty if it writes none.
    pub fn frame_to_write(&mut self, station: usize) -> &mut [u8] {
        let frame = self.images.out.get_mut(station);
        frame.map_or(&mut [], |frame| frame)
    }

    /// The frame of a station that the last cycle read; empty if it reads none.
    pub fn frame_read(&self, station: usize) -> &[u8] {
        let frame = self.images.into.get(station);
        frame.map_or(&[], |frame| frame)
    }

    /// Begins a cycle at `now`; news when there is nothing to be done in one.
    ///
    /// # Panics
    ///
    /// When the dialog is not idle.
    pub fn begin(&mut self, now: Nanos) -> Option<News> {
        assert!(self.is_idle(), "one cycle at a time");
        self.work(now, 0)
    }

    /// What is to be written; empty when there is nothing to send.
    pub fn to_write(&self) -> &[u8] {
        &self.outbox
    }

    /// The system took so many bytes of [`to_write`](Self::to_write).
    pub fn wrote(&mut self, count: usize) {
        self.outbox.drain(..count);
    }

    /// When an answer has taken too long.
    pub fn deadline(&self) -> Nanos {
        self.asked
            .map_or(Nanos::MAX, |asked| asked + self.terms.patience + Nanos(1))
    }

    /// Whether the connection may go on at `now`.
    ///
    /// # Errors
    ///
    /// An answer has taken too long.
    pub fn check(&self, now: Nanos) -> Result<(), End> {
        match self.asked {
            Some(asked) if now - asked > self.terms.patience => {
                Err(End::Silent(self.terms.patience))
            }
            _ => Ok(()),
        }
    }

    /// Takes in what has come, up to the next news; more of it may be waiting, so this is to be called with no bytes
    /// until it gives none.
    ///
    /// # Errors
    ///
    /// Why the connection ends.
    pub fn hear(&mut self, now: Nanos, bytes: &[u8]) -> Result<Option<News>, End> {
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

    fn packet(&mut self, now: Nanos, tpdu: Tpdu<'_>) -> Result<Option<News>, End> {
        match (tpdu, self.phase) {
            (Tpdu::ConnectConfirm(confirm), Phase::Connecting) => {
                self.size = confirm.size.unwrap_or(TPDU).min(TPDU);
                self.agree(now);
                Ok(None)
            }
            (Tpdu::Disconnect(reason), Phase::Connecting) => {
                Err(End::Refused(Refusal::Connection(reason)))
            }
            (Tpdu::Disconnect(reason), _) => Err(Fault::Disconnected(reason).into()),
            (Tpdu::Error(cause), _) => Err(Fault::Rejected(cause).into()),
            (Tpdu::Data { .. }, Phase::Connecting) => Err(Fault::NotConnected.into()),
            (Tpdu::Data { last, bytes }, _) => self.piece(now, last, bytes),
            (Tpdu::ConnectRequest(_) | Tpdu::ConnectConfirm(_), _) => {
                Err(Fault::ConnectedTwice.into())
            }
        }
    }

    fn piece(&mut self, now: Nanos, last: bool, bytes: &[u8]) -> Result<Option<News>, End> {
        if self.pieces.len() + bytes.len() > usize::from(self.pdu) || (bytes.is_empty() && !last) {
            return Err(Fault::Pieces(self.pdu).into());
        }
        if last && self.pieces.is_empty() {
            // An empty message is a sign of life.
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

    fn message(&mut self, now: Nanos, message: &[u8]) -> Result<Option<News>, End> {
        let answer = Pdu::read(message)?;
        if answer.kind == Kind::Job {
            return Err(Fault::Asks.into());
        }
        if self.asked.is_none() || answer.reference != self.reference {
            return Err(Fault::NotAsked.into());
        }
        self.asked = None;
        match self.phase {
            Phase::Agreeing => self.agreed(now, &answer),
            Phase::Asking(index) => self.told(now, index, &answer),
            Phase::Working(job) => self.done(now, job, &answer),
            Phase::Connecting | Phase::Idle => Err(Fault::NotAsked.into()),
        }
    }

    /// Appends a unit of `kind` that `fill` makes, and awaits its answer.
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
        let [high, low] = self.terms.pdu.to_be_bytes();
        self.ask(now, Kind::Job, |_, out| {
            out.extend_from_slice(&[function::SETUP, 0, 0, 1, 0, 1, high, low]);
        });
    }

    fn agreed(&mut self, now: Nanos, answer: &Pdu<'_>) -> Result<Option<News>, End> {
        whole(answer)?;
        let [function::SETUP, _, _, _, _, _, high, low] = *answer.parameters else {
            return Err(Fault::Answer("no agreement on the length of units").into());
        };
        let length = u16::from_be_bytes([high, low]);
        if !(SHORTEST..=LONGEST).contains(&length) {
            return Err(Fault::Agreed(length).into());
        }
        self.pdu = length;
        if self.terms.asks_who {
            self.ask_who(now, 0);
            return Ok(None);
        }
        Ok(Some(self.meet(None)))
    }

    fn meet(&mut self, identity: Option<Identity>) -> News {
        self.phase = Phase::Idle;
        self.allow(false);
        News::Met(self.pdu, identity)
    }

    /// Asks for the list with this index.
    fn ask_who(&mut self, now: Nanos, index: usize) {
        self.phase = Phase::Asking(index);
        self.list.clear();
        let [high, low] = LISTS[index].to_be_bytes();
        self.ask(now, Kind::UserData, |draft, out| {
            out.extend_from_slice(&[0, 1, 0x12, 4, 0x11, 0x44, 1, 0]);
            draft.data(out);
            out.extend_from_slice(&[0xFF, 9, 0, 4, high, low, 0, 0]);
        });
    }

    /// A piece of a list has come, or none.
    fn told(&mut self, now: Nanos, index: usize, answer: &Pdu<'_>) -> Result<Option<News>, End> {
        const WRONG: Fault = Fault::Answer("no system status list");
        // A peer that knows no such questions answers as if they were jobs.
        let mut more = None;
        if answer.kind == Kind::UserData {
            let [_, _, 0x12, 8, _, 0x84, 1, sequence, _, last, e0, e1] = *answer.parameters else {
                return Err(WRONG.into());
            };
            let datum = Data::new(1, answer.data).and_then(|mut data| data.next());
            match datum {
                Some(datum) if datum.code == Code::OK && [e0, e1] == [0, 0] => {
                    if datum.bytes.is_empty() && last != 0 {
                        return Err(WRONG.into());
                    }
                    self.list.extend_from_slice(datum.bytes);
                    more = (last != 0).then_some(sequence);
                }
                // It has no such list.
                _ => self.list.clear(),
            }
        }
        if self.list.len() > LIST_LIMIT {
            return Err(Fault::Answer("a system status list without end").into());
        }
        if let Some(sequence) = more {
            self.ask(now, Kind::UserData, |draft, out| {
                out.extend_from_slice(&[0, 1, 0x12, 8, 0x12, 0x44, 1, sequence, 0, 0, 0, 0]);
                draft.data(out);
                item::write_refusal(Code::MISSING, out);
            });
            return Ok(None);
        }
        lists::learn(&mut self.identity, &self.list);
        if index + 1 < LISTS.len() {
            self.ask_who(now, index + 1);
            return Ok(None);
        }
        let identity = std::mem::take(&mut self.identity);
        Ok(Some(self.meet(Some(identity))))
    }

    /// Asks for the job with this index to be done; news when there is none.
    fn work(&mut self, now: Nanos, index: usize) -> Option<News> {
        if index == self.images.jobs.len() {
            self.phase = Phase::Idle;
            return Some(News::Done);
        }
        self.phase = Phase::Working(index);
        let images = std::mem::take(&mut self.images);
        let Job { way, pieces } = &images.jobs[index];
        let count = u8::try_from(pieces.len()).expect("20 at most");
        self.ask(now, Kind::Job, |draft, out| {
            let code = match way {
                Way::Write => function::WRITE,
                Way::Read => function::READ,
            };
            out.extend_from_slice(&[code, count]);
            for piece in pieces {
                piece.item.write(out);
            }
            draft.data(out);
            if *way == Way::Write {
                write_data(pieces, &images.out, out);
            }
        });
        self.images = images;
        None
    }

    /// A job was done.
    fn done(&mut self, now: Nanos, index: usize, answer: &Pdu<'_>) -> Result<Option<News>, End> {
        whole(answer)?;
        let Images { jobs, into, .. } = &mut self.images;
        let Job { way, pieces } = &jobs[index];
        let count = u8::try_from(pieces.len()).expect("20 at most");
        let asked = match way {
            Way::Write => [function::WRITE, count],
            Way::Read => [function::READ, count],
        };
        if answer.parameters != asked {
            return Err(Fault::Answer("another function, or another number of items").into());
        }
        match way {
            Way::Write => {
                if answer.data.len() != pieces.len() {
                    return Err(Fault::Answer("another number of codes").into());
                }
                for (piece, code) in pieces.iter().zip(answer.data) {
                    good(*way, piece, Code(*code))?;
                }
            }
            Way::Read => {
                let data = Data::new(count, answer.data);
                let data = data.ok_or(Fault::Answer("data that do not add up"))?;
                for (piece, datum) in pieces.iter().zip(data) {
                    good(*way, piece, datum.code)?;
                    let place = &mut into[piece.station][piece.frame.clone()];
                    if datum.bytes.len() != place.len() {
                        return Err(Fault::Answer("another number of bytes").into());
                    }
                    place.copy_from_slice(datum.bytes);
                }
            }
        }
        Ok(self.work(now, index + 1))
    }
}

fn write_data(pieces: &[Piece], frames: &[Box<[u8]>], out: &mut Vec<u8>) {
    let begin = out.len();
    for piece in pieces {
        if (out.len() - begin) % 2 == 1 {
            out.push(0);
        }
        let bytes = &frames[piece.station][piece.frame.clone()];
        item::write_header(Code(0), piece.item.element, bytes.len(), out);
        out.extend_from_slice(bytes);
    }
}

/// An answer to a job that was done as a whole.
fn whole(answer: &Pdu<'_>) -> Result<(), End> {
    match (answer.kind, answer.error) {
        (Kind::Ack | Kind::AckData, error::NONE) => Ok(()),
        (Kind::Ack | Kind::AckData, code) => Err(End::Refused(Refusal::Job(code))),
        _ => Err(Fault::Answer("a system function").into()),
    }
}

fn good(way: Way, piece: &Piece, code: Code) -> Result<(), End> {
    if code == Code::OK {
        Ok(())
    } else {
        Err(End::Refused(Refusal::item(way, piece.item, code)))
    }
}

#[cfg(test)]
mod tests;
