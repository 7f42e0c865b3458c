//! The units of a server: each a station of the driver.

use std::ops::Range;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::{Port, Role};
use tickbus_image::signal::{SignalTable, fail_safe_frame};

use super::ServerOptions;
use crate::{Done, Exception, Function, Identification, Map, Tables, answer};

/// The units of a server, and what clients have written to them.
#[derive(Debug)]
pub(super) struct UnitSet {
    identification: Identification,
    /// Whether a write is an event even where it changes nothing.
    every_write: bool,
    units: Box<[Unit]>,
}

#[derive(Debug)]
struct Unit {
    /// Its number; `None` for any.
    number: Option<u8>,
    map: Map,
    /// What clients have written, from the fail-safe values on; one byte more where that makes the last register
    /// whole.
    holds: Box<[u8]>,
    holds_len: usize,
    /// The frame that an answer was made of last, and how many different ones there were before it.
    shown: Vec<u8>,
    generation: u64,
    /// Whether anybody has ever written.
    has_writer: bool,
}

/// What an answer carries of the frame of a station; it counts once the client has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Carried {
    station: usize,
    generation: u64,
    bits: Range<usize>,
}

impl UnitSet {
    pub(super) fn new(
        options: &ServerOptions,
        table: &SignalTable,
        role: Role,
        driver: &str,
    ) -> Self {
        let (_, held) = role.areas();
        let unit = |station: usize| {
            let mut holds = fail_safe_frame(table, station, held).into_vec();
            let holds_len = holds.len();
            holds.resize(holds_len.next_multiple_of(2), 0);
            Unit {
                number: options.stations.unit(station),
                map: options.map(table.stations[station].output_bytes),
                holds: holds.into(),
                holds_len,
                shown: Vec::new(),
                generation: 0,
                has_writer: false,
            }
        };
        Self {
            identification: Identification::of_driver(driver),
            every_write: options.every_write,
            units: (0..table.stations.len()).map(unit).collect(),
        }
    }

    /// How many units there are.
    pub(super) fn len(&self) -> usize {
        self.units.len()
    }

    /// The station that the unit with this number is.
    pub(super) fn station(&self, number: u8) -> Option<usize> {
        self.units
            .iter()
            .position(|unit| unit.number.is_none_or(|own| own == number))
    }

    /// Answers a request to a station that came at `now`, and appends the answer's PDU to `reply`. `writes` says of
    /// each station whether this client has written to it.
    pub(super) fn answer(
        &mut self,
        station: usize,
        now: Nanos,
        pdu: &[u8],
        writes: &mut [bool],
        reply: &mut Vec<u8>,
        port: &mut Port,
    ) -> Option<Carried> {
        let unit = &mut self.units[station];
        let writes_only = Function::of(pdu[0])
            .is_some_and(|function| function.writes() && function != Function::ReadWriteRegisters);
        // An injected fault may swallow what goes out: then the answer is lost on its way.
        let is_lost = !writes_only && !port.sends_of(station..station + 1, now);
        let before = reply.len();
        let sends = if writes_only {
            &unit.shown
        } else {
            let frame = port.outgoing(station, now);
            if frame != unit.shown {
                unit.generation += 1;
                unit.shown.clear();
                unit.shown.extend_from_slice(frame);
            }
            frame
        };
        let mut tables = Tables {
            map: unit.map,
            sends,
            holds: &mut unit.holds,
            holds_len: unit.holds_len,
        };
        let Done {
            wrote,
            read,
            refused,
        } = answer(pdu, &mut tables, &self.identification, reply);
        if is_lost {
            reply.truncate(before);
        }
        match (refused, wrote) {
            (Some(exception), _) => {
                port.count(counted(exception));
                return None;
            }
            (None, Some(bits)) => {
                unit.has_writer = true;
                writes[station] = true;
                let frame = &unit.holds[..unit.holds_len];
                if self.every_write {
                    port.received_part(station, now, frame, bits);
                } else {
                    port.received(station, now, frame);
                }
            }
            // Whoever only looks does not make the values of another one younger.
            (None, None) if writes[station] || !unit.has_writer => port.touch(station, now),
            (None, None) => {}
        }
        read.filter(|_| !is_lost).map(|bits| Carried {
            station,
            generation: unit.generation,
            bits,
        })
    }

    /// A client has an answer that carries this.
    pub(super) fn carried(&self, carried: Carried, port: &mut Port) {
        let Carried {
            station,
            generation,
            bits,
        } = carried;
        // After an answer with another frame nobody knows what of this one was news; it is told again.
        if self.units[station].generation == generation {
            port.sent_bits(station, bits);
        }
    }
}

/// What a refusal counts as.
fn counted(exception: Exception) -> &'static str {
    match exception {
        Exception::ILLEGAL_FUNCTION => "modbus-server.illegal_function",
        Exception::ILLEGAL_DATA_ADDRESS => "modbus-server.illegal_data_address",
        Exception::ILLEGAL_DATA_VALUE => "modbus-server.illegal_data_value",
        _ => "modbus-server.refused",
    }
}
