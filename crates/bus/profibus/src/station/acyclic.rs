//! A station's acyclic services, at their service access points.

use tickbus_base::time::Nanos;

use super::{Process, State, Station};
use crate::acyclic::{Machine, Peer, Refusal, Reply, sap};
use crate::event::Event;
use crate::telegram::{Control, Frame, append_short_ack};

/// The machine of a station, for a request of one master.
struct Bound<'p, P> {
    process: &'p mut P,
    station: u8,
    master: u8,
    now: Nanos,
}

impl<P: Process> Machine for Bound<'_, P> {
    fn read(&mut self, record: usize, octets: &mut [u8]) {
        self.process
            .read_record(self.station, self.now, record, octets);
    }

    fn written(&mut self, record: usize, octets: &[u8]) {
        self.process
            .wrote_record(self.station, self.now, record, octets);
    }

    fn refused(&mut self, writes: bool, slot: u8, index: u8, why: Refusal) {
        let event = Event::RecordRefused {
            master: self.master,
            writes,
            slot,
            index,
            why,
        };
        self.process.tell(self.station, self.now, event);
    }
}

impl Station {
    /// Puts the next alarm into the diagnosis, while the owner exchanges data.
    pub(super) fn offer_alarm(&mut self) {
        if self.state == State::DataExch {
            self.is_news |= self.acyclic.alarms.offer();
        }
    }

    /// Reports the alarms that the owner's parameters do not enable.
    pub(super) fn tell_dropped_alarms(&mut self, now: Nanos, process: &mut impl Process) {
        for (kind, slot) in self.acyclic.alarms.take_dropped() {
            process.tell(self.address, now, Event::AlarmDropped { kind, slot });
        }
    }

    /// A telegram for the service access point `dsap`, which is none of DP-V0.
    pub(super) fn serve_acyclic(
        &mut self,
        now: Nanos,
        dsap: u8,
        request: &Frame<'_>,
        process: &mut impl Process,
        reply: &mut Vec<u8>,
    ) {
        let peer = Peer {
            address: request.source,
            sap: request.ssap,
        };
        let mut machine = Bound {
            process,
            station: self.address,
            master: request.source,
            now,
        };
        let owner_exchanges = self.state == State::DataExch && self.owner == Some(request.source);
        let own = &mut self.acyclic;
        let answer = match dsap {
            _ if request.ssap.is_none() => Reply::Closed,
            sap::CLASS_1 if owner_exchanges => own.class_1(request.data, &mut machine),
            sap::ALARM if owner_exchanges => own.acknowledge(request.data),
            sap::CLASS_1 | sap::ALARM => Reply::Closed,
            sap::RESOURCE_MANAGER => own.open(now, peer, request.data),
            _ => own.class_2(now, peer, dsap, request.data, &mut machine),
        };
        match answer {
            Reply::Closed => self.append(request, Control::NOT_ACTIVE, &[], reply),
            Reply::Full => self.append(request, Control::NO_RESOURCE, &[], reply),
            Reply::Nothing => append_short_ack(reply),
            Reply::Data(data) => self.answer(request, Control::DATA_LOW, &data, reply),
        }
        self.offer_alarm();
    }
}
