//! The steps of an examination that are S7's own: transport, protocol, identity, each signal's bytes, and the operating
//! state.

mod causes;
mod talk;

use super::plan::Field;
use super::{ClientOptions, End, FrameFields, Refusal};
use crate::{ProtocolError, Tsap, Variable};
use causes::{item_refusal, whole_refusal};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::PlcState;
use tickbus_fieldbus::examine::{Examination, Neighbours, Peer, Round, WireEnd};
use tickbus_image::signal::SignalTable;

pub(super) use talk::{Miss, SLOTS, Talk, meets};

/// How far the neighbours of a number lie, in bytes: a WORD.
const STEP: usize = 2;

/// How often a CPU is tried that has just served a connection: it may need a while to give it free.
const AGAIN: usize = 3;

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
            Err(miss) => {
                talk.hang_up();
                return self.strange(examination, &peer, &miss);
            }
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
        talk.hang_up();
        let whole = self.everything(table);
        for again in 0..AGAIN {
            if again > 0 {
                let clock = peer.clock();
                clock.wait_until(peer.now() + peer.patience(), examination.stop);
            }
            let Ok(wire) = peer.dial() else {
                continue;
            };
            let mut talk = Talk::new(wire, &peer, &whole, ends, self.pdu, false);
            if talk.meet().is_ok() {
                return examination.watch_values(|| round(&mut talk, table));
            }
            talk.hang_up();
        }
        examination.fail(
            "age",
            "connection-lost",
            format!("{} does not accept another connection", peer.address),
            "see whether the CPU restarts, and whether other clients take its connections",
        );
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
