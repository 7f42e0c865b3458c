//! The units of a server: each a station of the driver.

use tickbus_base::time::Nanos;
use tickbus_fieldbus::tcp::{Writer, Writers};
use tickbus_fieldbus::{BusSetup, Events, Port, Receipt, Renewal};
use tickbus_image::signal::fail_safe_frame;

use super::ServerOptions;
use crate::table::{Span, Table};
use crate::{Done, Exception, Function, Identification, Map, Side, Tables, answer, refuse};

/// The unit number that addresses all units, with RTU.
pub(super) const BROADCAST: u8 = 0;

/// The units of a server, and the values that clients have written to them.
#[derive(Debug)]
pub(super) struct ServedUnits {
    /// True if a write is an event even without a change.
    every_write: bool,
    all: Box<[Unit]>,
}

#[derive(Debug)]
struct Unit {
    /// The number; `None` for any.
    number: Option<u8>,
    identification: Identification,
    map: Map,
    /// The values written by clients, initially the fail-safe values; with an additional byte if the size is
    /// odd, to complete the last register.
    holds: Box<[u8]>,
    holds_len: usize,
    /// The frame in the last answer, and the number of different frames before it.
    shown: Box<[u8]>,
    generation: u64,
    /// True if any client has ever written.
    has_writer: bool,
    writers: Writers,
}

/// The source of requests.
#[derive(Debug)]
pub(super) struct Source {
    /// Per station, whether its requests keep the values young.
    pub(super) renewals: Box<[Renewal]>,
    /// The client; `None` on a line that has one master.
    pub(super) writer: Option<Writer>,
}

/// The values of a station's frame in an answer: they count as sent once the client has the answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Carried {
    station: usize,
    generation: u64,
    receipt: Receipt,
    elements: (Table, Span),
}

impl ServedUnits {
    pub(super) fn new(options: &ServerOptions, setup: &BusSetup<'_>) -> Self {
        let table = setup.table;
        let (sent, held) = setup.role.areas();
        let unit = |station: usize| {
            let mut holds = fail_safe_frame(table, station, held).into_vec();
            let holds_len = holds.len();
            holds.resize(holds_len.next_multiple_of(2), 0);
            Unit {
                number: options.stations.unit(station),
                identification: (options.stations.identity(station).cloned())
                    .unwrap_or_else(|| Identification::of_driver(setup.name)),
                map: options.map(table, station),
                holds: holds.into(),
                holds_len,
                shown: vec![0; table.stations[station].bytes(sent)].into(),
                generation: 0,
                has_writer: false,
                writers: Writers::new(options.is_single_writer),
            }
        };
        Self {
            every_write: setup.events == Events::Writes,
            all: (0..table.stations.len()).map(unit).collect(),
        }
    }

    /// The number of units.
    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    /// The station of the unit with this number.
    pub(super) fn station(&self, number: u8) -> Option<usize> {
        self.all
            .iter()
            .position(|unit| unit.number.is_none_or(|own| own == number))
    }

    /// Answers a request to a station that arrived at `now`, and appends the answer's PDU to `reply`.
    pub(super) fn answer(
        &mut self,
        station: usize,
        now: Nanos,
        pdu: &[u8],
        source: &mut Source,
        reply: &mut Vec<u8>,
        port: &mut Port,
    ) -> Option<Carried> {
        // A fault that begins meanwhile meets the whole request or nothing of it.
        port.together(|port| {
            // A station that is cut off answers nothing, and no fault of an answer counts.
            if port.is_station_up(station, now)
                && let Some(code) = port.answer(station, pdu[0], now)
            {
                let exception = Exception(code);
                refuse(pdu[0], exception, reply);
                port.count(counted(exception));
                return None;
            }
            self.carry_out(station, now, pdu, source, reply, port)
        })
    }

    fn carry_out(
        &mut self,
        station: usize,
        now: Nanos,
        pdu: &[u8],
        source: &mut Source,
        reply: &mut Vec<u8>,
        port: &mut Port,
    ) -> Option<Carried> {
        let unit = &mut self.all[station];
        let writes_only = Function::of(pdu[0])
            .is_some_and(|function| function.writes() && function != Function::ReadWriteRegisters);
        // A station that is cut off hears and answers nothing, as if its client were silent.
        if !port.is_station_up(station, now) {
            source.renewals[station].lost(now, port.max_age());
            return None;
        }
        let receipt = if writes_only {
            None
        } else {
            port.take(station..station + 1, now).map(|mut frames| {
                let frame = frames.frame(station);
                if *frame != *unit.shown {
                    unit.generation += 1;
                    unit.shown.copy_from_slice(frame);
                }
                frames.receipt()
            })
        };
        let is_lost = !writes_only && receipt.is_none();
        let before = reply.len();
        // Only refused writes are undone.
        let held = unit.writers.is_single().then(|| unit.holds.clone());
        let mut tables = Tables {
            map: &unit.map,
            sends: &unit.shown,
            holds: &mut unit.holds,
        };
        let Done {
            wrote,
            read,
            refused,
        } = answer(pdu, &mut tables, &unit.identification, reply);
        if is_lost {
            reply.truncate(before);
        }
        match (refused, wrote) {
            (Some(exception), _) => {
                port.count(counted(exception));
                return None;
            }
            (None, Some(elements)) => {
                let found = (&*port, "modbus-server.second_writer");
                let may_write = source.writer.as_ref().is_none_or(|writer| {
                    let bits = unit.map.numbers(elements);
                    unit.writers.may_write(writer, bits, now, found)
                });
                if let (false, Some(held)) = (may_write, held) {
                    unit.holds = held;
                    if !is_lost {
                        reply.truncate(before);
                        refuse(pdu[0], Exception::SERVER_DEVICE_BUSY, reply);
                    }
                    return None;
                }
                unit.has_writer = true;
                source.renewals[station].wrote(now);
                let frame = &unit.holds[..unit.holds_len];
                if self.every_write {
                    let bits = unit.map.bits(Side::Holds, elements);
                    port.received_parts(station, now, frame, bits);
                } else {
                    let (table, span) = elements;
                    let octets = (span.count * table.width()).div_ceil(8);
                    port.received_with(station, now, frame, octets);
                }
            }
            // A client that only reads must not make the values of one that writes look recent.
            (None, None) => {
                let counts = source.renewals[station].counts(now, port.max_age());
                if counts || !unit.has_writer {
                    port.touch(station, now);
                }
            }
        }
        let elements = read?;
        let carries = unit.map.carries(Side::Sends, elements);
        carries.then_some(Carried {
            station,
            generation: unit.generation,
            receipt: receipt?,
            elements,
        })
    }

    /// Carries out a broadcast that arrived at `now`, for all units, and returns whether its function may be broadcast;
    /// there is no answer.
    pub(super) fn broadcast(
        &mut self,
        now: Nanos,
        pdu: &[u8],
        source: &mut Source,
        port: &mut Port,
    ) -> bool {
        if !Function::of(pdu[0]).is_some_and(Function::writes) {
            return false;
        }
        let mut nobody_hears = Vec::new();
        port.together(|port| {
            for station in 0..self.len() {
                self.carry_out(station, now, pdu, source, &mut nobody_hears, port);
            }
        });
        true
    }

    /// A client has received an answer with these values.
    pub(super) fn carried(&self, carried: &Carried, port: &mut Port) {
        // If another frame has been answered since, the new bits of this one are unknown; they are sent again.
        let unit = &self.all[carried.station];
        if unit.generation == carried.generation {
            for bits in unit.map.bits(Side::Sends, carried.elements) {
                port.sent(&carried.receipt.bits(carried.station, bits));
            }
        }
    }
}

/// The counter of refusals with this exception.
fn counted(exception: Exception) -> &'static str {
    match exception {
        Exception::ILLEGAL_FUNCTION => "modbus-server.illegal_function",
        Exception::ILLEGAL_DATA_ADDRESS => "modbus-server.illegal_data_address",
        Exception::ILLEGAL_DATA_VALUE => "modbus-server.illegal_data_value",
        _ => "modbus-server.refused",
    }
}
