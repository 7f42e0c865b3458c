//! The polling of a server's units, without I/O: time and bytes are handed in, bytes and the next deadline come
//! out.

mod identify;

use crate::fieldbus::identity::Guard;
use crate::fieldbus::modbus::identification;
use crate::fieldbus::modbus::mbap::{self, Telegram};
use crate::fieldbus::modbus::rtu;
use crate::fieldbus::modbus::{Exception, Identification};
use crate::fieldbus::{BusError, Port};
use crate::time::{Nanos, Pace};

use super::query::{Block, Fault, Query, length, queries};

/// A station, as it is polled.
#[derive(Debug)]
pub(super) struct Station {
    pub(super) unit: u8,
    pub(super) reads: Vec<Block>,
    pub(super) writes: Vec<Block>,
    pub(super) combine: bool,
    pub(super) sends: Vec<u8>,
    pub(super) receives: Vec<u8>,
    pub(super) identified: bool,
    pub(super) queries: Vec<Query>,
}

/// How telegrams are told apart.
#[derive(Debug)]
pub(super) enum Framing {
    /// By their header.
    Tcp {
        /// The last one's number.
        transaction: u16,
        /// What has come of the next one.
        inbox: Vec<u8>,
    },
    /// By their length, and silence between them.
    #[cfg_attr(
        not(unix),
        expect(dead_code, reason = "no serial ports are used there")
    )]
    Rtu {
        /// What has come of an answer.
        inbox: Vec<u8>,
        /// How long one character takes.
        character: Nanos,
        silence: Nanos,
        /// Until when nothing may be sent.
        quiet_until: Nanos,
    },
}

/// What the server is asked.
#[derive(Clone, Debug)]
enum Asked {
    /// Who it is.
    Identity {
        so_far: Identification,
        requests: usize,
    },
    /// The query with this index of the station's.
    Query(usize),
}

#[derive(Clone, Debug)]
struct Asking {
    station: usize,
    what: Asked,
    /// Until when it has to answer.
    limit: Nanos,
}

/// The polling of all stations, over one connection.
#[derive(Debug)]
pub(super) struct Poll<'a> {
    stations: &'a mut [Station],
    guards: &'a mut [Guard],
    framing: Framing,
    timeout: Nanos,
    /// What messages call the server.
    peer: String,
    cycle: Nanos,
    pace: Pace,
    /// When it was last looked at what is due.
    looked: Nanos,
    asking: Option<Asking>,
    request: Vec<u8>,
    written: usize,
    /// Stations in a row that gave no answer.
    unanswered: usize,
    /// Whether the line is said to be lost for that.
    lost: bool,
}

impl<'a> Poll<'a> {
    pub(super) fn new(
        stations: &'a mut [Station],
        guards: &'a mut [Guard],
        framing: Framing,
        (cycle, timeout): (Nanos, Nanos),
        peer: String,
        now: Nanos,
    ) -> Self {
        for (station, guard) in stations.iter_mut().zip(&mut *guards) {
            station.identified = false;
            guard.part();
        }
        Self {
            stations,
            guards,
            framing,
            timeout,
            peer,
            cycle,
            pace: Pace::new(now, cycle),
            looked: now,
            asking: None,
            request: Vec::new(),
            written: 0,
            unanswered: 0,
            lost: false,
        }
    }

    /// Until when the owner of the line may wait, if nothing comes and nothing can be written.
    pub(super) fn deadline(&self) -> Nanos {
        let Some(asking) = &self.asking else {
            return self.pace.due();
        };
        // An answer that takes its time is waited for cycle by cycle, so that its age is looked at.
        let deadline = asking.limit.min(self.looked + self.cycle);
        match self.framing {
            Framing::Rtu { quiet_until, .. } if self.written < self.request.len() => {
                deadline.min(quiet_until)
            }
            _ => deadline,
        }
    }

    /// What is to be written at `now`.
    pub(super) fn to_write(&self, now: Nanos) -> &[u8] {
        match self.framing {
            Framing::Rtu { quiet_until, .. } if now < quiet_until => &[],
            _ => &self.request[self.written..],
        }
    }

    /// The system took so many bytes of it.
    pub(super) fn wrote(&mut self, count: usize) {
        self.written += count;
    }

    /// Does what is due at `now`: begins a cycle, gives up what is not answered.
    pub(super) fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        self.looked = now;
        match &self.asking {
            Some(asking) if now >= asking.limit => {
                let within = self.timeout;
                let what = format!("did not answer within {within}");
                self.give_up(&what, now, port)
            }
            None if self.pace.take(now) && port.sends(now) => self.begin(0, now, port),
            _ => Ok(()),
        }
    }

    /// These bytes came at `now`.
    pub(super) fn arrived(
        &mut self,
        now: Nanos,
        bytes: &[u8],
        port: &mut Port,
    ) -> Result<(), BusError> {
        match &mut self.framing {
            Framing::Tcp { inbox, .. } => {
                let mut all = std::mem::take(inbox);
                all.extend_from_slice(bytes);
                let rest = self.read_telegrams(&all, now, port)?;
                all.drain(..rest);
                if let Framing::Tcp { inbox, .. } = &mut self.framing {
                    *inbox = all;
                }
                Ok(())
            }
            Framing::Rtu {
                inbox,
                silence,
                quiet_until,
                ..
            } => {
                *quiet_until = now + *silence;
                let room = rtu::ADU_LIMIT - inbox.len();
                inbox.extend_from_slice(&bytes[..bytes.len().min(room)]);
                let Some(asking) = &self.asking else {
                    port.count("modbus-client.unasked");
                    self.clear();
                    return Ok(());
                };
                // A client knows how long an answer is. So pauses within one, which some adapters make, do no
                // harm, and none has to be waited for.
                let expected = inbox.get(1..).and_then(|pdu| match asking.what {
                    Asked::Query(index) => {
                        let queries = &self.stations[asking.station].queries;
                        length(queries.get(index).copied(), pdu)
                    }
                    Asked::Identity { .. } => identification::length(pdu),
                });
                match expected.map(|pdu| 1 + pdu + 2) {
                    Some(expected) if inbox.len() >= expected => {
                        let telegram = inbox.clone();
                        self.hear(&telegram, now, port)
                    }
                    _ => Ok(()),
                }
            }
        }
    }

    /// A telegram of RTU came.
    fn hear(&mut self, telegram: &[u8], now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let Some(asking) = &self.asking else {
            return Ok(());
        };
        let unit = self.stations[asking.station].unit;
        match rtu::parse(telegram) {
            Some((from, pdu)) if from == unit => {
                self.clear();
                self.answered(pdu, now, port)
            }
            Some(_) => {
                port.count("modbus-client.unasked");
                self.clear();
                Ok(())
            }
            None => {
                port.count("modbus-client.damaged");
                self.give_up("gave a damaged answer", now, port)
            }
        }
    }

    fn clear(&mut self) {
        if let Framing::Rtu { inbox, .. } = &mut self.framing {
            inbox.clear();
        }
    }

    /// Takes all whole telegrams of TCP; gives how many bytes they had.
    fn read_telegrams(
        &mut self,
        bytes: &[u8],
        now: Nanos,
        port: &mut Port,
    ) -> Result<usize, BusError> {
        let mut taken = 0;
        loop {
            let parsed = Telegram::parse(&bytes[taken..]);
            let parsed =
                parsed.map_err(|error| BusError::Protocol(format!("of {}: {error}", self.peer)))?;
            let Some((telegram, length)) = parsed else {
                return Ok(taken);
            };
            taken += length;
            let Framing::Tcp { transaction, .. } = &self.framing else {
                return Ok(taken);
            };
            if self.asking.is_none() || telegram.transaction != *transaction {
                // Too late, or never asked for.
                port.count("modbus-client.unasked");
                continue;
            }
            self.answered(telegram.pdu, now, port)?;
        }
    }

    /// The answer to what is asked came.
    fn answered(&mut self, pdu: &[u8], now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let Some(Asking { station, what, .. }) = self.asking.take() else {
            return Ok(());
        };
        match what {
            Asked::Identity { so_far, requests } => {
                self.identified(station, so_far, requests, pdu, now, port)
            }
            Asked::Query(index) => {
                let Station {
                    queries, receives, ..
                } = &mut self.stations[station];
                let query = queries[index];
                match query.take(pdu, receives) {
                    Ok(()) => self.go_on(station, index + 1, now, port),
                    Err(Fault::Malformed(what)) => {
                        let unit = self.named(station);
                        Err(BusError::Protocol(format!(
                            "{unit} was asked to {query}; {what}; check that it is a Modbus server"
                        )))
                    }
                    Err(Fault::Refused(exception)) => {
                        self.refused(station, query, exception, now, port)
                    }
                }
            }
        }
    }

    fn refused(
        &mut self,
        station: usize,
        query: Query,
        exception: Exception,
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        let unit = self.named(station);
        if matches!(query, Query::Both { .. }) {
            // Many a server does not know it, or knows it for some registers alone.
            port.log(
                log::Level::Info,
                "refused",
                format_args!("{unit} refused to {query}: {exception}; it is asked in two requests"),
            );
            self.stations[station].combine = false;
            self.prepare(station);
            return self.begin(station, now, port);
        }
        match exception {
            Exception::ACKNOWLEDGE
            | Exception::SERVER_DEVICE_BUSY
            | Exception::GATEWAY_PATH_UNAVAILABLE
            | Exception::GATEWAY_TARGET_FAILED => {
                self.asking = Some(Asking {
                    station,
                    what: Asked::Query(0),
                    limit: now,
                });
                self.give_up(&format!("gave {exception}"), now, port)
            }
            _ => Err(BusError::Refused(format!(
                "{unit} refused to {query}: {exception}; {}",
                match exception {
                    Exception::ILLEGAL_FUNCTION =>
                        "choose another table with \"inputs\" or \"outputs\"",
                    Exception::ILLEGAL_DATA_ADDRESS =>
                        "correct \"inputs\" or \"outputs\", or the sizes of the image; offsets count from 0",
                    _ => "see what the device's manual says of it",
                }
            ))),
        }
    }

    /// The unit as messages call it.
    fn named(&self, station: usize) -> String {
        format!("unit {} of {}", self.stations[station].unit, self.peer)
    }

    /// There is no answer to what is asked: goes on with the next station, unless nobody answers at all.
    fn give_up(&mut self, what: &str, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let Some(Asking {
            station,
            what: asked,
            ..
        }) = self.asking.take()
        else {
            return Ok(());
        };
        port.count("modbus-client.unanswered");
        // Whoever answers next may be another device.
        self.stations[station].identified = false;
        self.guards[station].part();
        self.clear();
        self.request.clear();
        self.written = 0;
        self.unanswered += 1;
        if self.unanswered >= self.stations.len() {
            let to = match asked {
                Asked::Identity { .. } => "say who it is (function 43)".to_owned(),
                Asked::Query(index) => match self.stations[station].queries.get(index) {
                    Some(query) => query.to_string(),
                    None => "answer".to_owned(),
                },
            };
            let error = BusError::Link(format!(
                "{}, asked to {to}, {what}; see whether the device runs, and whether \"unit\" is its number",
                self.named(station)
            ));
            if matches!(self.framing, Framing::Tcp { .. }) {
                return Err(error);
            }
            if !std::mem::replace(&mut self.lost, true) {
                port.lost(&error, "it is asked again every cycle");
            }
        }
        self.begin(station + 1, now, port)
    }

    /// Makes the requests of a station anew.
    fn prepare(&mut self, station: usize) {
        let may_write = self.guards[station].may_write();
        let station = &mut self.stations[station];
        let writes: &[Block] = if may_write { &station.writes } else { &[] };
        station.queries = queries(&station.reads, writes, station.combine);
        if station.queries.is_empty() {
            // Whether it lives is to be known all the same.
            let look = |block: &Block| Block {
                byte: 0,
                bytes: 0,
                ..*block
            };
            let look = station.writes.first().map(look);
            station.queries.extend(look.map(Query::Read));
        }
    }

    /// Begins with a station in this cycle, or ends the cycle behind the last one.
    fn begin(&mut self, station: usize, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let Some(polled) = self.stations.get_mut(station) else {
            return Ok(());
        };
        if !polled.identified {
            if !polled.writes.is_empty() {
                let so_far = Identification::default();
                self.ask_identity(station, so_far, 0, 0, now);
                return Ok(());
            }
            polled.identified = true;
            self.prepare(station);
        }
        let polled = &mut self.stations[station];
        polled.sends.clear();
        polled.sends.extend_from_slice(port.outgoing(station, now));
        self.go_on(station, 0, now, port)
    }

    /// Makes the request with this index, or ends the station's part of the cycle behind the last one.
    fn go_on(
        &mut self,
        station: usize,
        index: usize,
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        let polled = &self.stations[station];
        if let Some(query) = polled.queries.get(index).copied() {
            let answer = query.read().map_or(8, |read| read.bytes + 6);
            self.ask(station, Asked::Query(index), answer, now, |polled, pdu| {
                query.append(&polled.sends, pdu);
            });
            return Ok(());
        }
        if polled.receives.is_empty() {
            port.touch(station, now);
        } else {
            port.received(station, now, &polled.receives);
        }
        if self.guards[station].may_write() {
            port.sent(station);
        }
        self.unanswered = 0;
        self.lost = false;
        port.running(&format!("polling {}", self.peer));
        self.begin(station + 1, now, port)
    }

    /// Makes a request, whose PDU `write` appends, and to which an answer of so many bytes is expected.
    fn ask(
        &mut self,
        station: usize,
        what: Asked,
        answer: usize,
        now: Nanos,
        write: impl FnOnce(&Station, &mut Vec<u8>),
    ) {
        let polled = &self.stations[station];
        let request = &mut self.request;
        request.clear();
        self.written = 0;
        let mut limit = now + self.timeout;
        match &mut self.framing {
            Framing::Tcp { transaction, .. } => {
                *transaction = transaction.wrapping_add(1);
                mbap::append(*transaction, polled.unit, request, |pdu| write(polled, pdu));
            }
            Framing::Rtu {
                inbox,
                character,
                quiet_until,
                ..
            } => {
                inbox.clear();
                rtu::append(polled.unit, request, |pdu| write(polled, pdu));
                // The line needs its time for both.
                let characters = i64::try_from(request.len() + answer).unwrap_or(i64::MAX);
                limit = limit.max(*quiet_until + self.timeout) + character.times(characters);
            }
        }
        self.asking = Some(Asking {
            station,
            what,
            limit,
        });
    }
}

#[cfg(test)]
mod tests;
