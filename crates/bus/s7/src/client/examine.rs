//! The steps of an examination that are S7's own: transport, protocol, identity, each signal's bytes, and the operating
//! state; and the search for CPUs.

use super::plan::Field;
use super::{
    ClientOptions, ClientSession, ConnectionParameters, End, FrameFields, Refusal, SessionEvent,
};
use crate::item::{Object, ReturnCode};
use crate::length::LONGEST;
use crate::pdu::error;
use crate::szl::Identity;
use crate::transport::PORT;
use crate::{ProtocolError, Tsap, Variable};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::PlcState;
use tickbus_fieldbus::examine::{
    Examination, Found, Neighbours, Peer, Round, Search, Searching, Wire, WireEnd,
};
use tickbus_image::signal::{Signal, SignalTable};

/// How CPUs are found.
pub(crate) const SEARCH: Search = Search {
    bus: "s7",
    port: PORT,
    ask,
};

/// The racks and slots of CPUs: S7-1200 and S7-1500, S7-300, software controllers, S7-400.
const SLOTS: [(u8, u8); 4] = [(0, 1), (0, 2), (0, 0), (0, 3)];

/// How far the neighbours of a number lie, in bytes: a WORD.
const STEP: usize = 2;

/// Why a conversation ended.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Miss {
    Wire(WireEnd),
    Session(End),
}

/// A session on a connection that blocks.
struct Talk {
    wire: Wire,
    session: ClientSession,
    peer: Peer,
}

impl Talk {
    fn new(
        wire: Wire,
        peer: &Peer,
        fields: &FrameFields,
        (calling, called): (Tsap, Tsap),
        pdu: u16,
        asks_who: bool,
    ) -> Self {
        let terms = ConnectionParameters {
            calling,
            called,
            pdu,
            patience: peer.patience(),
            asks_who,
        };
        Self {
            wire,
            session: fields.session(terms, peer.now()),
            peer: peer.clone(),
        }
    }

    /// Waits for the session's next news.
    fn news(&mut self) -> Result<SessionEvent, Miss> {
        let mut bytes = Vec::new();
        loop {
            let heard = self.session.hear(self.peer.now(), &bytes);
            if let Some(news) = heard.map_err(Miss::Session)? {
                return Ok(news);
            }
            bytes.clear();
            let out = self.session.to_write().to_vec();
            if !out.is_empty() {
                self.wire.send(&out).map_err(Miss::Wire)?;
                self.session.wrote(out.len());
            }
            let deadline = self.wire.deadline();
            self.wire
                .receive(&mut bytes, deadline)
                .map_err(Miss::Wire)?;
        }
    }

    /// The agreed length of a PDU, and the identity.
    fn meet(&mut self) -> Result<(u16, Option<Identity>), Miss> {
        match self.news()? {
            SessionEvent::Met(length, identity) => Ok((length, identity)),
            _ => Ok((0, None)),
        }
    }

    /// Reads all fields of the session.
    fn read(&mut self) -> Result<(), Miss> {
        if self.session.begin(self.peer.now()).is_none() {
            self.news()?;
        }
        Ok(())
    }

    fn state(&mut self) -> Result<Option<PlcState>, Miss> {
        self.session.ask_state(self.peer.now());
        match self.news()? {
            SessionEvent::State(state) => Ok(state),
            _ => Ok(None),
        }
    }
}

/// The fields of an examination: each signal's own bytes, and those before and behind it, each in a frame of its own, so
/// that a refusal is known for each of them. Nothing is written.
fn each(options: &ClientOptions, table: &SignalTable) -> FrameFields {
    let mut fields = FrameFields::default();
    for signal in &table.signals {
        let variable = options.variable(signal);
        let bytes = signal.data_type.size_bytes();
        let own = variable.map(|variable| variable.bits().0);
        for first in [own, below(variable), above(variable)] {
            if let (Some(variable), Some(first)) = (variable, first) {
                fields.read.push(Field {
                    station: fields.lengths.len(),
                    frame: 0,
                    object: variable.object,
                    first,
                    bits: variable.width.bits(),
                });
            }
            fields.lengths.push([0, bytes]);
        }
    }
    fields
}

/// The first bit of the number one WORD before a variable of several bytes, if there can be one.
fn below(variable: Option<Variable>) -> Option<usize> {
    let variable = variable.filter(|variable| variable.width.bits() > 8)?;
    variable.byte.checked_sub(STEP).map(|byte| byte * 8)
}

/// The first bit of the number one WORD behind it.
fn above(variable: Option<Variable>) -> Option<usize> {
    let variable = variable.filter(|variable| variable.width.bits() > 8)?;
    Some((variable.byte + STEP) * 8)
}

impl ClientOptions {
    /// Examines the line.
    pub(crate) fn examine(&self, examination: &mut Examination<'_>) {
        let Some((peer, wire)) = examination.reach(&self.address) else {
            return;
        };
        let table = examination.setup.table;
        let fields = each(self, table);
        let ends = (self.calling, self.called);
        let mut talk = Talk::new(wire, &peer, &fields, ends, self.pdu, true);
        let mut met = talk.meet();
        let is_hang_up = matches!(&met, Err(Miss::Wire(_))) && talk.session.asks_who();
        if is_hang_up && let Ok(wire) = peer.dial() {
            // Some CPUs close the connection, or fall silent, when they are asked who they are.
            talk = Talk::new(wire, &peer, &fields, ends, self.pdu, false);
            met = talk.meet();
        }
        let (length, identity) = match met {
            Ok(met) => met,
            Err(miss) => return self.strange(examination, &peer, &miss),
        };
        examination.ok(
            "protocol",
            format!(
                "a CPU answers at TSAP {}, with PDUs of {length} bytes",
                self.called
            ),
        );
        let line = identity.map(|identity| identity.line()).unwrap_or_default();
        let line = if line.is_empty() {
            format!("S7 CPU at {}, TSAP {}", peer.address, self.called)
        } else {
            line
        };
        examination.compare_identity(&line, self.write_to.as_deref());
        self.sizes(examination, length);
        if !self.read_each(examination, &mut talk) {
            return;
        }
        state(examination, &mut talk);
        self.second_client(examination, &peer);
        let Ok(wire) = peer.dial() else {
            return;
        };
        let whole = self.everything(table);
        let mut talk = Talk::new(wire, &peer, &whole, ends, self.pdu, false);
        if talk.meet().is_ok() {
            examination.watch_values(|| round(&mut talk, table));
        }
    }

    /// The fields that the driver reads and writes, all of them to be read.
    fn everything(&self, table: &SignalTable) -> FrameFields {
        let mut fields = FrameFields::default();
        for signal in &table.signals {
            if let Some(variable) = self.variable(signal) {
                let (first, bits) = variable.bits();
                // All in one frame, so that neighbours are read together.
                let frame = fields.lengths.first().map_or(0, |[_, bytes]| bytes * 8);
                fields.read.push(Field {
                    station: 0,
                    frame,
                    object: variable.object,
                    first,
                    bits,
                });
            }
            let bytes = signal.data_type.size_bytes();
            match fields.lengths.first_mut() {
                Some([_, all]) => *all += bytes,
                None => fields.lengths.push([0, bytes]),
            }
        }
        if fields.lengths.is_empty() {
            fields.lengths.push([0, 0]);
        }
        fields
    }

    fn sizes(&self, examination: &mut Examination<'_>, length: u16) {
        let table = examination.setup.table;
        let requests = self.shown_requests(table).join("; ");
        let asked = self.pdu;
        let short = if length < asked {
            format!(" (asked for {asked})")
        } else {
            String::new()
        };
        examination.sizes(&format!("PDUs of {length} bytes{short}; {requests}"));
    }

    /// The step `protocol`, if there is no session.
    fn strange(&self, examination: &mut Examination<'_>, peer: &Peer, miss: &Miss) {
        let address = peer.address;
        if let Miss::Session(End::Broken(why)) = miss
            && !matches!(
                why,
                ProtocolError::Disconnected(_) | ProtocolError::Rejected(_)
            )
        {
            let (cause, next) = match why {
                ProtocolError::S7CommPlus => (
                    "put-get",
                    "the CPU speaks S7CommPlus only: permit PUT/GET communication in its properties, under Protection & \
                     Security",
                ),
                _ => (
                    "not-s7",
                    "correct the port (S7 has 102), or the kind of bus",
                ),
            };
            examination.fail("protocol", cause, format!("{address}: {why}"), next);
            return;
        }
        let told = match miss {
            Miss::Wire(end) => format!("{address}, TSAP {}, {end}", self.called),
            Miss::Session(end) => end.clone().into_error(address).to_string(),
        };
        let slots = SLOTS
            .into_iter()
            .filter(|(rack, slot)| Tsap::of_slot(*rack, *slot) != self.called);
        let other = slots.into_iter().find(|(rack, slot)| {
            let called = Tsap::of_slot(*rack, *slot);
            meets(peer, (self.calling, called)).is_some()
        });
        if let Some((rack, slot)) = other {
            examination.fail(
                "protocol",
                "wrong-slot",
                format!("{told}; a CPU answers in rack {rack}, slot {slot}"),
                &format!("write rack = {rack} and slot = {slot}"),
            );
            return;
        }
        let (cause, next) = match miss {
            Miss::Wire(WireEnd::Silent) | Miss::Session(End::Silent(_)) => (
                "silent",
                "the port is open, but nothing answers: see what listens there, and whether a firewall looks into the \
                 packets",
            ),
            Miss::Session(End::Refused(Refusal::Job(_))) => (
                "protection-level",
                "allow full access in the properties of the CPU, under Protection & Security",
            ),
            _ => (
                "connection-limit",
                "no rack and slot is let in: all connections of the CPU may be taken (end other clients, or raise their \
                 number in its properties), or it accepts connections of listed partners only",
            ),
        };
        examination.fail("protocol", cause, told, next);
    }

    /// The steps `addresses` and `values`. False if the CPU refuses everything.
    fn read_each(&self, examination: &mut Examination<'_>, talk: &mut Talk) -> bool {
        if let Err(miss) = talk.read() {
            let (cause, told, next) = whole_refusal(&miss);
            examination.fail("addresses", cause, told, &next);
            return false;
        }
        let signals = &examination.setup.table.signals;
        let mut refused = Vec::new();
        let mut values = Vec::new();
        for (index, signal) in signals.iter().enumerate() {
            let variable = self.variable(signal);
            let read = |frame: usize| match talk.session.refusal(frame) {
                Some(refusal) => Err(refusal.clone()),
                None => Ok(talk.session.frame_read(frame).to_vec()),
            };
            match read(3 * index) {
                Err(refusal) => refused.push((signal, refusal)),
                Ok(here) if here.len() > 1 => values.push(Neighbours {
                    signal: index,
                    here,
                    below: below(variable).and_then(|_| read(3 * index + 1).ok()),
                    above: above(variable).and_then(|_| read(3 * index + 2).ok()),
                    places: places(variable),
                }),
                Ok(_) => {}
            }
        }
        if refused.is_empty() {
            examination.ok("addresses", "all signals can be read");
        } else {
            let all = signals.len();
            let (cause, next) = item_refusal(&refused);
            let details = refused.iter().take(10);
            let details: Vec<String> = details
                .map(|(signal, refusal)| format!("\"{}\": the CPU {refusal}", signal.name))
                .collect();
            let evidence = format!("{} of {all} signals cannot be read", refused.len());
            examination.fail("addresses", cause, evidence, next).details = details;
        }
        examination.judge_values(&values);
        refused.len() < signals.len() || signals.is_empty()
    }

    fn second_client(&self, examination: &mut Examination<'_>, peer: &Peer) {
        if meets(peer, (self.calling, self.called)).is_some() {
            examination.ok("clients", "a second connection is served as well");
        } else {
            let step = examination.ok("clients", "a second connection is not served");
            "the CPU has no connection left: end other clients, or raise their number in its properties"
                .clone_into(&mut step.next);
        }
    }
}

/// A short conversation with another end; the length of a PDU, and the identity.
fn meets(peer: &Peer, ends: (Tsap, Tsap)) -> Option<(u16, Option<Identity>)> {
    let fields = FrameFields {
        lengths: vec![[0, 0]],
        ..FrameFields::default()
    };
    let mut talk = Talk::new(peer.dial().ok()?, peer, &fields, ends, LONGEST, false);
    talk.meet().ok()
}

fn state(examination: &mut Examination<'_>, talk: &mut Talk) {
    match talk.state() {
        Ok(Some(PlcState::Run)) => {
            examination.ok("run", "the CPU is in RUN");
        }
        Ok(Some(PlcState::Stop)) => {
            examination.fail(
                "run",
                "plc-stop",
                "the CPU is in STOP: its values do not change, and the driver reports them as stale",
                "switch the CPU to RUN; if it falls back, read its diagnostic buffer",
            );
        }
        Ok(None) | Err(_) => {
            let step = examination.ok("run", "the CPU does not say whether it is in RUN");
            "name a signal that has to change: alive = { signal = \"...\", within = \"500ms\" }"
                .clone_into(&mut step.next);
        }
    }
}

/// The cause if the CPU refused a whole job, the evidence and the next thing to try.
fn whole_refusal(miss: &Miss) -> (&'static str, String, String) {
    match miss {
        Miss::Session(End::Refused(refusal)) => {
            let cause = match refusal {
                Refusal::Job(error::NO_FUNCTION) => "put-get",
                Refusal::Job(0xD241) => "protection-level",
                _ => "job-refused",
            };
            let text = refusal.to_string();
            let (told, next) = text
                .split_once("; ")
                .unwrap_or((&text, "see its diagnostic buffer"));
            (cause, format!("the CPU {told}"), next.to_owned())
        }
        Miss::Session(end) => {
            let why = end.clone().into_error("the CPU").to_string();
            ("not-s7", why, "see what the peer is".to_owned())
        }
        Miss::Wire(end) => (
            "connection-lost",
            format!("the CPU {end} when the signals are read"),
            "write a smaller \"pdu\", and see the diagnostic buffer of the CPU".to_owned(),
        ),
    }
}

/// The cause if the CPU refused single items, and the next thing to try.
fn item_refusal(refused: &[(&Signal, Refusal)]) -> (&'static str, &'static str) {
    let first = refused.first().map(|(_, refusal)| refusal);
    let Some(Refusal::Item { item, code, .. }) = first else {
        return ("job-refused", "see the diagnostic buffer of the CPU");
    };
    match (item.object, *code) {
        (Object::Block(_), ReturnCode::MISSING) => (
            "block-missing",
            "load the block into the CPU; if it is there, it has optimized block access: clear that in its properties, \
             under Attributes, compile and load it",
        ),
        (Object::Block(_), ReturnCode::ADDRESS) => (
            "block-short",
            "the block is shorter than the file assumes: compare the offsets in its declaration, and compile and load it",
        ),
        (_, ReturnCode::ADDRESS | ReturnCode::MISSING) => (
            "address-refused",
            "the CPU has no such addresses: correct \"input\", \"output\" or [fieldbus.at]",
        ),
        (_, ReturnCode::ACCESS) => (
            "access-denied",
            "allow full access and PUT/GET communication in the properties of the CPU; a block must not be protected",
        ),
        _ => ("item-refused", "see the diagnostic buffer of the CPU"),
    }
}

fn places(variable: Option<Variable>) -> [String; 3] {
    let at = |shifted: Option<usize>| {
        let moved = variable
            .zip(shifted)
            .map(|(variable, byte)| Variable { byte, ..variable });
        moved.map(|moved| moved.to_string()).unwrap_or_default()
    };
    let byte = variable.map(|variable| variable.byte);
    [
        at(byte),
        at(below(variable).map(|bit| bit / 8)),
        at(above(variable).map(|bit| bit / 8)),
    ]
}

fn round(talk: &mut Talk, table: &SignalTable) -> Option<Round> {
    let begin = talk.peer.now();
    talk.read().ok()?;
    let took: Nanos = talk.peer.now() - begin;
    let mut frame = talk.session.frame_read(0);
    let mut values = Vec::new();
    for signal in &table.signals {
        let (own, rest) = frame.split_at_checked(signal.data_type.size_bytes())?;
        values.push(own.to_vec());
        frame = rest;
    }
    Some(Round {
        begin,
        took,
        values,
    })
}

/// Asks for the identity, at each of the usual racks and slots until one answers.
fn ask(searching: Searching<'_>) -> Vec<Found> {
    let Searching { peer, wire, .. } = searching;
    let fields = FrameFields {
        lengths: vec![[0, 0]],
        ..FrameFields::default()
    };
    let calling = Tsap::new(&super::options::CALLING);
    let mut first = Some(wire);
    for (rack, slot) in SLOTS {
        let ends = (calling, Tsap::of_slot(rack, slot));
        let Some(wire) = first.take().or_else(|| peer.dial().ok()) else {
            return Vec::new();
        };
        let mut talk = Talk::new(wire, &peer, &fields, ends, LONGEST, true);
        let identity = match talk.meet() {
            Ok((_, identity)) => identity,
            Err(Miss::Session(End::Broken(
                ProtocolError::NoIsoOnTcp(_) | ProtocolError::PacketLength(_),
            ))) => return Vec::new(),
            Err(_) if talk.session.asks_who() => {
                meets(&peer, ends).and_then(|(_, identity)| identity)
            }
            // What falls silent at the first slot is no CPU; a CPU refuses, or closes the connection.
            Err(Miss::Wire(WireEnd::Silent)) => return Vec::new(),
            Err(_) => continue,
        };
        return vec![describe(&peer, (rack, slot), identity.as_ref())];
    }
    Vec::new()
}

fn describe(peer: &Peer, (rack, slot): (u8, u8), identity: Option<&Identity>) -> Found {
    Found {
        identity: identity.map(Identity::line).unwrap_or_default(),
        facts: vec![("rack", rack.to_string()), ("slot", slot.to_string())],
        stanza: format!(
            "[fieldbus]\nkind    = \"s7-client\"\naddress = \"{}\"\nrack    = {rack}\nslot    = {slot}\n",
            peer.address
        ),
    }
}
