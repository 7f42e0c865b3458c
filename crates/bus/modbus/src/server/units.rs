//! The units of a server: each a station of the driver.

use std::ops::Range;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::faults::{Elements, Request};
use tickbus_fieldbus::tcp::{Writer, Writers};
use tickbus_fieldbus::{BusSetup, Events, Port, Receipt, Renewal};
use tickbus_image::signal::fail_safe_frame;

use super::ServerOptions;
use super::diagnostics::Diagnostics;
use super::files::Files;
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
    /// The station, the side and the bits of each signal, in the order of the signal table.
    signals: Box<[(usize, Side, Range<usize>)]>,
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
    files: Files,
    /// `None` for a device without functions 8, 11 and 12.
    diagnostics: Option<Box<Diagnostics>>,
}

/// The source of requests.
#[derive(Debug)]
pub(super) struct Source {
    /// Per station, whether its requests keep the values young.
    pub(super) renewals: Box<[Renewal]>,
    /// The client; `None` on a line that has one master.
    pub(super) writer: Option<Writer>,
    /// False if requests that change anything are refused with exception 01.
    pub(super) may_write: bool,
}

/// The values of a station's frame in an answer: they count as sent once the client has the answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Carried {
    pub(super) station: usize,
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
                files: Files::new(&options.files),
                diagnostics: options.has_diagnostics().then(Box::default),
            }
        };
        Self {
            every_write: setup.events == Events::Writes,
            signals: (table.signals.iter())
                .map(|signal| {
                    let bits = signal.address().bits();
                    (signal.station, options.side(signal.area), bits)
                })
                .collect(),
            all: (0..table.stations.len()).map(unit).collect(),
        }
    }

    /// An undamaged telegram was on the line, for any unit.
    pub(super) fn heard(&mut self) {
        for unit in &mut self.all {
            if let Some(diagnostics) = &mut unit.diagnostics {
                diagnostics.heard();
            }
        }
    }

    /// A damaged telegram was on the line; with `is_overlong` longer than any can be.
    pub(super) fn damaged(&mut self, is_overlong: bool) {
        for unit in &mut self.all {
            if let Some(diagnostics) = &mut unit.diagnostics {
                diagnostics.damaged(is_overlong);
            }
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
            // A station that is cut off hears and answers nothing, and no fault of an answer counts.
            if !port.is_station_up(station, now) {
                return self.carry_out(station, now, pdu, source, reply, port);
            }
            let begin = reply.len();
            if !self.begin(station, pdu, false) {
                return None;
            }
            let forbidden = !source.may_write && changes(pdu[0]);
            let forbidden = forbidden.then_some(Exception::ILLEGAL_FUNCTION.0);
            let request = Request {
                station,
                function: pdu[0],
                names: &|elements| self.names(station, pdu, elements),
            };
            let spoilt = || port.answer_request(request, now);
            let carried = match forbidden.or_else(spoilt) {
                Some(code) => {
                    let exception = Exception(code);
                    refuse(pdu[0], exception, reply);
                    port.count(counted(exception));
                    None
                }
                None => self.carry_out(station, now, pdu, source, reply, port),
            };
            self.end(station, pdu, &reply[begin..], false);
            carried
        })
    }

    /// Returns true if a request to a station names these elements: as many as it reads or writes at once, and bits of the
    /// signal among them.
    fn names(&self, station: usize, pdu: &[u8], elements: Elements) -> bool {
        answer::named(pdu).any(|(table, span)| {
            let counts = elements
                .quantity
                .is_none_or(|number| usize::from(number) == span.count);
            let has_signal = elements.signal.is_none_or(|signal| {
                let (of, side, own) = &self.signals[signal];
                let mut bits = self.all[station].map.bits(*side, (table, span));
                *of == station && bits.any(|bits| bits.start < own.end && own.start < bits.end)
            });
            counts && has_signal
        })
    }

    /// A station gets a request. Returns true if its unit does not only listen.
    fn begin(&mut self, station: usize, pdu: &[u8], is_broadcast: bool) -> bool {
        let diagnostics = self.all[station].diagnostics.as_mut();
        diagnostics.is_none_or(|diagnostics| diagnostics.begin(pdu, is_broadcast))
    }

    /// A station has answered a request, with an empty `answer` if not at all.
    fn end(&mut self, station: usize, pdu: &[u8], answer: &[u8], is_broadcast: bool) {
        if let Some(diagnostics) = &mut self.all[station].diagnostics {
            diagnostics.end(pdu, answer, is_broadcast);
        }
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
        let function = Function::of(pdu[0]);
        let writes_only = function
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
        let own = function.and_then(|function| unit.answer(function, pdu, reply));
        let Done {
            wrote,
            read,
            refused,
        } = own.unwrap_or_else(|| {
            let mut tables = Tables {
                map: &unit.map,
                sends: &unit.shown,
                holds: &mut unit.holds,
            };
            answer(pdu, &mut tables, &unit.identification, reply)
        });
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
                nobody_hears.clear();
                let is_up = port.is_station_up(station, now);
                if is_up && !self.begin(station, pdu, true) {
                    continue;
                }
                self.carry_out(station, now, pdu, source, &mut nobody_hears, port);
                if is_up {
                    self.end(station, pdu, &nobody_hears, true);
                }
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

/// Returns true if requests with this function code change values, files or the state of the unit.
fn changes(code: u8) -> bool {
    Function::of(code).is_some_and(|function| {
        function.writes() || matches!(function, Function::WriteFileRecord | Function::Diagnostics)
    })
}

impl Unit {
    /// Answers a request of a function that needs more than the tables; `None` for the other functions, and those that the
    /// device does not have.
    fn answer(&mut self, function: Function, pdu: &[u8], reply: &mut Vec<u8>) -> Option<Done> {
        let begin = reply.len();
        reply.push(pdu[0]);
        let data = &pdu[1..];
        let answered = match (function, &mut self.diagnostics) {
            (
                Function::Diagnostics | Function::CommEventCounter | Function::CommEventLog,
                Some(diagnostics),
            ) => diagnostics.answer(function, data, reply),
            (Function::ReadFileRecord | Function::WriteFileRecord, _) => {
                self.files.answer(function, data, reply)
            }
            _ => {
                reply.truncate(begin);
                return None;
            }
        };
        let refused = answered.err();
        if let Some(exception) = refused {
            reply.truncate(begin);
            refuse(pdu[0], exception, reply);
        }
        Some(Done {
            refused,
            ..Done::default()
        })
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
