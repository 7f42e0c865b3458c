//! The acyclic services of DP-V1: masters read and write the records of a station.
//!
//! The master that owns a station uses the connection that comes with its parameters (MS1). Any master can open
//! connections of the other kind (MS2), also while nobody exchanges data. Both carry the same requests to the same
//! records.

mod alarms;
mod class2;
mod drive;
mod identification;
mod machine;
mod pdu;
mod records;

use tickbus_base::time::Nanos;

pub use alarms::{Alarm, AlarmSupport};
pub(crate) use alarms::{Alarms, enable_bit};
use class2::Connections;
pub(crate) use drive::{ELEMENT_LIMIT, INDEX as PARAMETERS};
pub use drive::{Format, Parameter};
pub use identification::Nameplate;
pub(crate) use machine::Machine;
pub use pdu::Refusal;
use pdu::function;
pub use records::Record;
use records::{Called, Records};

/// The service access points of a slave for acyclic services; connections of MS2 have those below.
pub(crate) mod sap {
    /// Opens a connection.
    pub(crate) const RESOURCE_MANAGER: u8 = 49;
    /// Acknowledgements of alarms, for the owner.
    pub(crate) const ALARM: u8 = 50;
    /// Records, and acknowledgements of alarms, for the owner.
    pub(crate) const CLASS_1: u8 = 51;
}

/// The most octets of a record.
pub(crate) const RECORD_LIMIT: usize = 240;

/// The acyclic services of a device; by default it has none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Acyclic {
    /// The master that owns the station can read and write records (MS1), if its parameters say so.
    pub class_1: bool,
    /// The alarms that the device can send to that master.
    pub alarms: AlarmSupport,
    /// The connections that other masters can have at a time (MS2).
    pub connections: u8,
    /// The most octets of a record in the device, at most 240; 0 for as many.
    pub max_data: u8,
    /// The time in which a master of MS2 has to fetch an answer, in units of 10 ms. A connection without a request for
    /// twice as long is closed.
    pub send_timeout: u16,
    /// The records, by slot and index, without repetitions.
    pub records: Vec<Record>,
    /// The parameters of a drive, without repetitions.
    pub parameters: Vec<Parameter>,
    /// The nameplate that masters read as record 255 (I&M).
    pub nameplate: Nameplate,
}

impl Acyclic {
    /// True if the device has any acyclic service.
    pub fn is_any(&self) -> bool {
        self.class_1 || self.connections > 0
    }

    /// The most octets of a record.
    pub fn room(&self) -> usize {
        match self.max_data {
            0 => RECORD_LIMIT,
            room => RECORD_LIMIT.min(room.into()),
        }
    }
}

/// The reply to a telegram for an acyclic service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Reply {
    /// The access point is closed.
    Closed,
    /// All connections are in use.
    Full,
    /// A request is received, or the answer to one is not ready.
    Nothing,
    /// An answer.
    Data(Vec<u8>),
}

/// The acyclic services of a station, with the state of their connections.
#[derive(Debug)]
pub(crate) struct Server {
    has_class_1: bool,
    /// The owner's parameters switch its connection on.
    is_enabled: bool,
    /// The answer that the owner has not fetched yet; empty if there is no such answer.
    answer: Vec<u8>,
    called: Called,
    connections: Connections,
    records: Records,
    /// The answer to an acknowledgement at its own access point.
    acknowledgement: Vec<u8>,
    /// The alarms.
    pub(crate) alarms: Alarms,
}

impl Server {
    /// The services that `own` describes, in a device whose slots reach to `slots`.
    pub(crate) fn new(own: &Acyclic, slots: u8) -> Self {
        Self {
            has_class_1: own.class_1,
            is_enabled: false,
            answer: Vec::new(),
            called: Called::default(),
            connections: Connections::new(own.connections, own.send_timeout, own.room()),
            records: Records::new(own, slots),
            acknowledgement: Vec::new(),
            alarms: Alarms::new(own.alarms),
        }
    }

    /// The owner's connection begins anew, or ends with its master.
    pub(crate) fn reset(&mut self, is_enabled: bool) {
        self.is_enabled = is_enabled && self.has_class_1;
        self.answer.clear();
        self.acknowledgement.clear();
        self.called = Called::default();
    }

    /// When a connection of MS2 acts on its own; [`Nanos::MAX`] for never.
    pub(crate) fn deadline(&self) -> Nanos {
        self.connections.deadline()
    }

    /// Closes connections whose masters are silent.
    pub(crate) fn turn(&mut self, now: Nanos) {
        self.connections.turn(now);
    }

    /// A telegram of the owner, which exchanges data: a request, or an empty one that fetches the answer to the last.
    pub(crate) fn class_1(&mut self, request: &[u8], machine: &mut impl Machine) -> Reply {
        if !self.is_enabled {
            return Reply::Closed;
        }
        if request.is_empty() {
            return fetch(&mut self.answer);
        }
        // A master that sends another request no longer waits for the answer to the last one.
        self.answer = if request[0] == function::ALARM_ACK {
            acknowledge(&mut self.alarms, request)
        } else {
            self.records.serve(request, &mut self.called, machine)
        };
        Reply::Nothing
    }

    /// A telegram of the owner, which exchanges data, to the access point for acknowledgements of alarms.
    pub(crate) fn acknowledge(&mut self, request: &[u8]) -> Reply {
        if !self.is_enabled {
            return Reply::Closed;
        }
        if request.is_empty() {
            return fetch(&mut self.acknowledgement);
        }
        self.acknowledgement = acknowledge(&mut self.alarms, request);
        Reply::Nothing
    }

    /// A telegram of any master to the access point of the resource manager: opens a connection.
    pub(crate) fn open(&mut self, now: Nanos, peer: Peer, request: &[u8]) -> Reply {
        self.connections.open(now, peer, request)
    }

    /// A telegram of any master to the access point `sap` of a connection.
    pub(crate) fn class_2(
        &mut self,
        now: Nanos,
        peer: Peer,
        sap: u8,
        request: &[u8],
        machine: &mut impl Machine,
    ) -> Reply {
        let Self {
            connections,
            records,
            ..
        } = self;
        connections.serve(now, peer, sap, request, |request, called| {
            records.serve(request, called, machine)
        })
    }
}

/// The answer that a master fetches.
fn fetch(answer: &mut Vec<u8>) -> Reply {
    match std::mem::take(answer) {
        answer if answer.is_empty() => Reply::Nothing,
        answer => Reply::Data(answer),
    }
}

/// `Alarm_Ack`: the answer repeats the request, or refuses it.
fn acknowledge(alarms: &mut Alarms, request: &[u8]) -> Vec<u8> {
    let mut answer = Vec::new();
    let why = match *request {
        [function::ALARM_ACK, slot, kind, specifier] => {
            if alarms.acknowledge(slot, kind, specifier) {
                return request.to_vec();
            }
            Refusal::State
        }
        [function::ALARM_ACK, ..] => Refusal::Form,
        _ => Refusal::NotSupported,
    };
    pdu::refuse(request[0], why, &mut answer);
    answer
}

/// A master's end of a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Peer {
    /// The master's address.
    pub(crate) address: u8,
    /// The service access point at the master.
    pub(crate) sap: Option<u8>,
}

#[cfg(test)]
mod tests;
