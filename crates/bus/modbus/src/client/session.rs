//! Polling a server's units, without I/O: time and received bytes go in, bytes to send and the next deadline
//! come out.

mod identify;
mod station;
mod trouble;

use std::fmt;
use std::io;

use crate::function::EXCEPTION_BIT;
use crate::mbap::{self, Telegram};
use crate::{Coding, Function, Identification, ascii, rtu};
use tickbus_base::time::{Nanos, Pace};
use tickbus_fieldbus::WriteGuard;
use tickbus_fieldbus::tcp::Caller;
use tickbus_fieldbus::{BusError, Port};
use tickbus_net::serial::gone;

use super::plan::Capabilities;
use super::request::{AnswerError, length};
use identify::Identity;
pub(super) use station::Station;

/// How often a request over UDP is sent, at equal intervals, until its time-out has passed.
const TRIES: i64 = 4;

/// The framing of telegrams.
#[derive(Debug)]
pub(super) enum Framing {
    /// By their header.
    Tcp {
        /// The last transaction number.
        transaction: u16,
        /// The received part of the next telegram.
        inbox: Vec<u8>,
    },
    /// By their length alone: RTU in a TCP stream.
    RtuOverTcp {
        /// The received part of the next telegram.
        inbox: Vec<u8>,
    },
    /// One in each datagram, with the header of TCP.
    Udp {
        /// The last transaction number.
        transaction: u16,
        /// When the request goes out once more.
        again: Nanos,
    },
    /// On a serial line: by their length, or as its characters delimit them.
    Serial {
        coding: Coding,
        /// The received part of an answer, as RTU.
        inbox: Vec<u8>,
        /// The same as ASCII.
        ascii: ascii::Framer,
        /// Duration of one character.
        character: Nanos,
        /// The silence before a request.
        silence: Nanos,
        /// Nothing may be sent before this.
        quiet_until: Nanos,
        /// The line's echo of what is sent, if it has one.
        echo: Option<rtu::Echo>,
    },
}

/// A request to the server.
#[derive(Clone, Debug)]
enum Asked {
    /// For the identity.
    Identity {
        so_far: Identification,
        requests: usize,
    },
    /// The station's query with this index.
    Data(usize),
}

#[derive(Clone, Debug)]
struct Asking {
    station: usize,
    what: Asked,
    /// The function code.
    code: u8,
    /// When the time-out of the answer ends.
    limit: Nanos,
}

/// Polls all stations over one connection.
#[derive(Debug)]
pub(super) struct ClientSession<'a> {
    stations: &'a mut [Station],
    guards: &'a mut [WriteGuard],
    framing: Framing,
    timeout: Nanos,
    /// The server's name in messages.
    peer: String,
    cycle: Nanos,
    pace: Pace,
    /// When the session last checked for due work.
    looked: Nanos,
    asking: Option<Asking>,
    /// The PDU of the request, the request in the line's format, and how much of that the system has accepted.
    pdu: Vec<u8>,
    request: Vec<u8>,
    written: usize,
    /// True if the line is reported as lost because no station works.
    lost: bool,
}

impl<'a> ClientSession<'a> {
    pub(super) fn new(
        stations: &'a mut [Station],
        guards: &'a mut [WriteGuard],
        framing: Framing,
        able: Capabilities,
        (cycle, timeout): (Nanos, Nanos),
        peer: String,
        now: Nanos,
    ) -> Self {
        for (station, guard) in stations.iter_mut().zip(&mut *guards) {
            guard.part();
            station.connect(able);
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
            pdu: Vec::new(),
            request: Vec::new(),
            written: 0,
            lost: false,
        }
    }
}

impl Caller for ClientSession<'_> {
    fn deadline(&self, _port: &Port) -> Nanos {
        let Some(asking) = &self.asking else {
            return self.pace.due();
        };
        // While an answer is slow, wake up every cycle to check the age of the data.
        let deadline = asking.limit.min(self.looked + self.cycle);
        match self.framing {
            Framing::Serial { quiet_until, .. } if self.written < self.request.len() => {
                deadline.min(quiet_until)
            }
            Framing::Udp { again, .. } => deadline.min(again),
            _ => deadline,
        }
    }

    fn to_write(&self, now: Nanos) -> &[u8] {
        match self.framing {
            Framing::Serial { quiet_until, .. } if now < quiet_until => &[],
            _ => &self.request[self.written..],
        }
    }

    fn wrote(&mut self, now: Nanos, count: usize, _port: &mut Port) {
        if let Framing::Serial {
            echo: Some(echo), ..
        } = &mut self.framing
        {
            echo.sent(now, &self.request[self.written..][..count]);
        }
        self.written += count;
    }

    fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        self.looked = now;
        match &self.asking {
            Some(asking) if now >= asking.limit => self.give_up(now, port),
            None if self.pace.take(now) && port.take_all(now).is_some() => self.begin(0, now, port),
            Some(_) => {
                self.repeat(now, port);
                Ok(())
            }
            None => Ok(()),
        }
    }

    fn hear(&mut self, now: Nanos, bytes: &[u8], port: &mut Port) -> Result<(), BusError> {
        match &mut self.framing {
            Framing::Tcp { inbox, .. } | Framing::RtuOverTcp { inbox } => {
                let mut all = std::mem::take(inbox);
                all.extend_from_slice(bytes);
                let rest = match self.framing {
                    Framing::Tcp { .. } => self.read_telegrams(&all, now, port)?,
                    _ => self.read_rtu_telegrams(&all, now, port)?,
                };
                all.drain(..rest);
                if let Framing::Tcp { inbox, .. } | Framing::RtuOverTcp { inbox } =
                    &mut self.framing
                {
                    *inbox = all;
                }
                Ok(())
            }
            Framing::Udp { .. } => self.datagram(bytes, now, port),
            Framing::Serial {
                coding,
                inbox,
                silence,
                quiet_until,
                echo,
                ..
            } => {
                let coding = *coding;
                *quiet_until = now + *silence;
                let bytes = match echo {
                    Some(echo) => {
                        let own = echo.strip(now, bytes);
                        port.not_from_peer(own);
                        &bytes[own..]
                    }
                    None => bytes,
                };
                if bytes.is_empty() {
                    return Ok(());
                }
                if coding == Coding::Ascii {
                    return self.characters(bytes, now, port);
                }
                let room = rtu::ADU_LIMIT - inbox.len();
                inbox.extend_from_slice(&bytes[..bytes.len().min(room)]);
                if self.asking.is_none() {
                    port.count("modbus-client.unasked");
                    self.clear();
                    return Ok(());
                }
                // The beginning of an answer determines its length. So pauses within an answer, as some adapters make,
                // do no harm, and there is no silence to wait for. Noise after the answer, when the transmitter is
                // switched off, does no harm either.
                let expected = inbox.get(1..).and_then(length);
                match expected.map(|pdu| 1 + pdu + rtu::CHECKSUM) {
                    Some(expected) if inbox.len() >= expected => {
                        let telegram = inbox[..expected].to_vec();
                        port.read_telegrams(1);
                        self.telegram(&telegram, now, port)
                    }
                    _ => Ok(()),
                }
            }
        }
    }

    fn left(&mut self) -> BusError {
        let asked_identity = self.hung_up();
        let peer = &self.peer;
        match self.framing {
            Framing::Serial { .. } => gone(peer, "it was closed").into(),
            _ if asked_identity => BusError::Left(format!(
                "{peer} closed the connection when it was asked who it is (function 43); if it does so again, it is \
                 not asked for some time"
            )),
            _ => BusError::Left(format!(
                "{peer} closed the connection; if it serves one client at a time, end the other one"
            )),
        }
    }

    fn broke(&mut self, error: &io::Error) -> BusError {
        // A device is not blamed for a question that it has not received.
        if self.written == self.request.len() && !matches!(self.framing, Framing::Udp { .. }) {
            self.hung_up();
        }
        let peer = &self.peer;
        match self.framing {
            Framing::Serial { .. } => gone(peer, error).into(),
            Framing::Udp { .. } => BusError::Link(format!(
                "{peer} takes no datagrams ({error}); start the program that serves there, or correct \"address\""
            )),
            _ => BusError::Link(format!(
                "the connection with {peer} broke ({error}); see whether the server still runs"
            )),
        }
    }
}

impl ClientSession<'_> {
    /// Sends the request once more, if the answer to a datagram is late.
    fn repeat(&mut self, now: Nanos, port: &Port) {
        if let Framing::Udp { again, .. } = &mut self.framing
            && now >= *again
            && self.written == self.request.len()
        {
            *again = now + Nanos(self.timeout.0 / TRIES);
            self.written = 0;
            port.count("modbus-client.repeated");
        }
    }

    /// A datagram arrived: a telegram, or nothing of use.
    fn datagram(&mut self, bytes: &[u8], now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let Ok(Some((telegram, length))) = Telegram::parse(bytes) else {
            port.count("modbus-client.damaged");
            return Ok(());
        };
        if length < bytes.len() {
            port.count("modbus-client.damaged");
            return Ok(());
        }
        self.read_telegram(telegram, now, port)
    }

    /// Characters of ASCII arrived.
    fn characters(
        &mut self,
        mut characters: &[u8],
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        while !characters.is_empty() {
            let Framing::Serial { ascii, .. } = &mut self.framing else {
                return Ok(());
            };
            ascii.arrived(now, &mut characters);
            let whole = ascii.take(now, |bytes| bytes.unwrap_or_default().to_vec());
            let Some(telegram) = whole else {
                continue;
            };
            if self.asking.is_none() {
                port.count("modbus-client.unasked");
                continue;
            }
            port.read_telegrams(1);
            self.telegram(&telegram, now, port)?;
        }
        Ok(())
    }

    /// A telegram arrived over a serial line.
    fn telegram(&mut self, telegram: &[u8], now: Nanos, port: &mut Port) -> Result<(), BusError> {
        self.clear();
        let coding = match &self.framing {
            Framing::Serial { coding, .. } => *coding,
            _ => Coding::Rtu,
        };
        if let Some((from, pdu)) = coding.parse(telegram) {
            return self.undamaged(from, pdu, now, port);
        }
        port.count("modbus-client.damaged");
        let what = "gave a damaged answer";
        if let Some(Asking {
            station,
            what: Asked::Identity { .. },
            ..
        }) = self.asking
        {
            self.is_unclear(station, what, port);
        }
        self.miss(what, now, port)
    }

    /// An undamaged RTU telegram arrived.
    fn undamaged(
        &mut self,
        from: u8,
        pdu: &[u8],
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        let asked = self.asking.as_ref();
        let asked = asked.map(|asking| (asking.station, asking.code));
        let asked = asked.filter(|(station, _)| self.stations[*station].unit == from);
        match asked {
            Some((_, code)) if pdu[0] & !EXCEPTION_BIT == code => {
                return self.answered(pdu, now, port);
            }
            Some((station, _)) if pdu[0] == Function::DeviceIdentification.code() => {
                self.doubt(station);
            }
            _ => {}
        }
        // A late answer to an earlier request; the expected one may still arrive.
        port.count("modbus-client.unasked");
        Ok(())
    }

    /// Takes all complete RTU telegrams of a TCP stream; returns their number of bytes.
    fn read_rtu_telegrams(
        &mut self,
        bytes: &[u8],
        now: Nanos,
        port: &mut Port,
    ) -> Result<usize, BusError> {
        let mut taken = 0;
        loop {
            match rtu::split(&bytes[taken..], length) {
                Ok(Some((from, pdu, length))) => {
                    taken += length;
                    self.undamaged(from, pdu, now, port)?;
                }
                Ok(None) => return Ok(taken),
                Err(error) => return Err(self.violated(error)),
            }
        }
    }

    /// Bytes that are no telegram arrived over TCP. This end now closes the connection; if it was asking for the
    /// identity, that counts as if the device had closed it.
    fn violated(&mut self, error: impl fmt::Display) -> BusError {
        self.hung_up();
        BusError::Protocol(format!("of {}: {error}", self.peer))
    }

    fn clear(&mut self) {
        if let Framing::Serial { inbox, .. } = &mut self.framing {
            inbox.clear();
        }
    }

    /// Takes all complete TCP telegrams; returns their number of bytes.
    fn read_telegrams(
        &mut self,
        bytes: &[u8],
        now: Nanos,
        port: &mut Port,
    ) -> Result<usize, BusError> {
        let mut taken = 0;
        loop {
            let (telegram, length) = match Telegram::parse(&bytes[taken..]) {
                Ok(Some(parsed)) => parsed,
                Ok(None) => return Ok(taken),
                Err(error) => return Err(self.violated(error)),
            };
            taken += length;
            self.read_telegram(telegram, now, port)?;
        }
    }

    /// A telegram with the header of TCP arrived.
    fn read_telegram(
        &mut self,
        telegram: Telegram<'_>,
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        let asked = match &self.framing {
            Framing::Tcp { transaction, .. } | Framing::Udp { transaction, .. } => *transaction,
            _ => return Ok(()),
        };
        if self.asking.is_none() || telegram.transaction != asked {
            // Too late, repeated, or never requested.
            port.count("modbus-client.unasked");
            return Ok(());
        }
        self.answered(telegram.pdu, now, port)
    }

    /// The answer to the current request arrived.
    fn answered(&mut self, pdu: &[u8], now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let Some(Asking { station, what, .. }) = self.asking.take() else {
            return Ok(());
        };
        match what {
            Asked::Identity { so_far, requests } => {
                self.identified(station, so_far, requests, pdu, now, port)
            }
            Asked::Data(index) => {
                let polled = &mut self.stations[station];
                let taken = polled.queries[index].take(&self.pdu, pdu, &mut polled.receives);
                match taken {
                    Ok(()) => self.go_on(station, index + 1, now, port),
                    Err(AnswerError::Malformed(what)) => {
                        let query = &self.stations[station].queries[index];
                        let error = BusError::Protocol(format!(
                            "{} was asked to {query}; {what}; check that it is a Modbus server",
                            self.named(station)
                        ));
                        self.declined(station, error, now, port)
                    }
                    Err(AnswerError::Refused(exception)) => {
                        self.refused(station, index, exception, now, port)
                    }
                }
            }
        }
    }

    /// The unit's name in messages.
    fn named(&self, station: usize) -> String {
        format!("unit {} of {}", self.stations[station].unit, self.peer)
    }

    /// Begins with the first station, from this one on, that is not resting in this cycle, or ends the cycle.
    fn begin(&mut self, station: usize, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let mut rest = station..self.stations.len();
        // A station that refuses to be read may still take the last values.
        let is_ending = port.is_ending();
        let Some(next) = rest.find(|station| {
            (is_ending || !self.stations[*station].rests(now)) && port.is_station_up(*station, now)
        }) else {
            return Ok(());
        };
        let Some(mut frames) = port.look(next..next + 1, now) else {
            return Ok(());
        };
        let polled = &mut self.stations[next];
        polled.prepare(self.guards[next].may_write());
        polled.sends.clear();
        polled.sends.extend_from_slice(frames.frame(next));
        polled.receipt = Some(frames.receipt());
        self.go_on(next, 0, now, port)
    }

    /// Sends the request with this index, or ends the station's part of the cycle after the last one.
    fn go_on(
        &mut self,
        station: usize,
        index: usize,
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        let polled = &self.stations[station];
        if let Some(query) = polled.queries.get(index) {
            if polled.is_to_be_prepared() {
                // The identity of the device is in doubt now: nothing more is written.
                return self.begin(station + 1, now, port);
            }
            let (code, answer) = (query.function().code(), query.answer_length());
            self.ask(
                station,
                Asked::Data(index),
                code,
                answer,
                now,
                |polled, pdu| polled.queries[index].append(&polled.sends, pdu),
            );
            return Ok(());
        }
        if polled.receives.is_empty() {
            port.touch(station, now);
        } else {
            port.received(station, now, &polled.receives);
        }
        if self.guards[station].may_write()
            && let Some(receipt) = &polled.receipt
        {
            port.sent(receipt);
        }
        self.recovered(station);
        port.running(&format!("polling {}", self.peer));
        if self.stations[station].wants_identity(now) && self.may_ask(station, now, port) {
            self.ask_identity(station, Identification::default(), 0, 0, now);
            return Ok(());
        }
        self.begin(station + 1, now, port)
    }

    /// Sends a request with this function code, whose PDU `write` appends; the expected answer has `answer` bytes.
    fn ask(
        &mut self,
        station: usize,
        what: Asked,
        code: u8,
        answer: usize,
        now: Nanos,
        write: impl FnOnce(&Station, &mut Vec<u8>),
    ) {
        let polled = &self.stations[station];
        self.pdu.clear();
        write(polled, &mut self.pdu);
        let pdu = &self.pdu;
        let copy = |to: &mut Vec<u8>| to.extend_from_slice(pdu);
        let request = &mut self.request;
        request.clear();
        self.written = 0;
        let mut limit = now + self.timeout;
        match &mut self.framing {
            Framing::Tcp { transaction, .. } => {
                *transaction = transaction.wrapping_add(1);
                mbap::append(*transaction, polled.unit, request, copy);
            }
            Framing::Udp { transaction, again } => {
                *transaction = transaction.wrapping_add(1);
                mbap::append(*transaction, polled.unit, request, copy);
                *again = now + Nanos(self.timeout.0 / TRIES);
            }
            Framing::RtuOverTcp { .. } => rtu::append(polled.unit, request, copy),
            Framing::Serial {
                coding,
                inbox,
                ascii,
                character,
                quiet_until,
                ..
            } => {
                inbox.clear();
                ascii.clear();
                coding.append(polled.unit, request, copy);
                // Request and answer need their time on the line.
                let characters = request.len() + coding.characters(answer);
                let characters = i64::try_from(characters).unwrap_or(i64::MAX);
                limit = limit.max(*quiet_until + self.timeout) + character.times(characters);
            }
        }
        self.asking = Some(Asking {
            station,
            what,
            code,
            limit,
        });
    }
}

#[cfg(test)]
mod tests;
