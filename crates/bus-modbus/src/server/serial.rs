//! The units of a server on a serial line.

use std::io::{Read as _, Write as _};

use crate::Function;
use crate::function::EXCEPTION_BIT;
use crate::line::{Serial, gone};
use crate::rtu::{self, Echo, Framer};
use crate::serial::open;
use tickbus_base::os::{Interest, Poller, SerialPort, Source};
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::tcp::{is_for_later, no_wait};
use tickbus_fieldbus::{BusError, Port};

use super::units::{Carried, UnitSet};

/// The unit number that addresses all units.
const BROADCAST: u8 = 0;

/// After this many consecutive requests that equal the previous answer, the log explains the setting for a
/// line with echo. (A client that writes one value repeatedly looks the same, and is answered as usual.)
const ECHOES: u32 = 20;

/// Serves the units until `stop`.
///
/// # Errors
///
/// The serial port does not exist, or is gone.
pub(super) fn serve(
    line: &Serial,
    units: &mut UnitSet,
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    let serial = open(line)?;
    port.tell("device", &line.device);
    port.opening(&format!("listening on {}", line.device));
    let mut poller = Poller::new(stop).map_err(|error| no_wait(&error))?;
    let mut server = Server {
        line,
        serial,
        // A line has a single client.
        writes: vec![true; units.len()].into(),
        units,
        framer: Framer::new(line.silence),
        echo: line.new_echo(),
        suspicion: Suspicion::default(),
        reply: Vec::new(),
        written: 0,
        carried: None,
    };
    while !stop.is_stopped() {
        server.turn(&mut poller, port)?;
    }
    Ok(())
}

struct Server<'a> {
    line: &'a Serial,
    serial: SerialPort,
    units: &'a mut UnitSet,
    /// The stations that the client has written to.
    writes: Box<[bool]>,
    framer: Framer,
    /// The echo of what is sent, if the line is known to have one.
    echo: Option<Echo>,
    suspicion: Suspicion,
    /// The answer being sent, and how much of it the system has accepted.
    reply: Vec<u8>,
    written: usize,
    carried: Option<Carried>,
}

impl Server<'_> {
    fn turn(&mut self, poller: &mut Poller, port: &mut Port) -> Result<(), BusError> {
        let interest = if self.written < self.reply.len() {
            Interest::ReadWrite
        } else {
            Interest::Read
        };
        let mut sources = [Source::new(&self.serial, interest)];
        let clock = port.clock();
        let now = clock.now();
        // Data are stale when older than the limit, not when equal.
        let age = port.silence(now);
        let stale = if age <= port.max_age() {
            now + (port.max_age() - age) + Nanos(1)
        } else {
            Nanos::MAX
        };
        let deadline = self.framer.deadline().min(port.due()).min(stale);
        poller
            .wait(&**clock, deadline, &mut sources)
            .map_err(|error| no_wait(&error))?;
        let (readable, writable) = (sources[0].is_readable(), sources[0].is_writable());
        let now = port.clock().now();
        if readable {
            self.read(now, port)?;
        }
        self.attend(now, port);
        if writable || interest == Interest::Read {
            self.write(port)?;
        }
        port.observe(now);
        Ok(())
    }

    fn read(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let mut bytes = [0; rtu::ADU_LIMIT];
        let count = match self.serial.read(&mut bytes) {
            Ok(0) => return Err(gone(&self.line.device, "it was closed")),
            Ok(count) => count,
            Err(error) if is_for_later(&error) => return Ok(()),
            Err(error) => return Err(gone(&self.line.device, &error)),
        };
        // Silence may have ended a telegram before these bytes arrived.
        self.attend(now, port);
        let own = self.echo.as_mut();
        let own = own.map_or(0, |echo| echo.strip(now, &bytes[..count]));
        self.framer.arrived(now, &bytes[own..count]);
        Ok(())
    }

    /// Answers the telegram that silence has ended, if it is complete and addressed to a unit here.
    fn attend(&mut self, now: Nanos, port: &mut Port) {
        let Self {
            line,
            units,
            writes,
            framer,
            suspicion,
            reply,
            written,
            carried,
            ..
        } = self;
        framer.take(now, |telegram| {
            let Some((number, pdu)) = telegram.and_then(rtu::parse) else {
                port.count("modbus-server.damaged");
                return;
            };
            if port.is_down(now) {
                return;
            }
            // Requests never have this bit: it is another unit's answer, or an echo of one.
            if pdu[0] & EXCEPTION_BIT != 0 {
                port.count("modbus-server.answers_heard");
                return;
            }
            if suspicion.is_confirmed(telegram == Some(&reply[..])) {
                port.log(
                    log::Level::Warn,
                    "echo",
                    format_args!(
                        "on {} each answer comes back as if it were a request; if the adapter echoes what it sends, \
                         write echo = true into [fieldbus]",
                        line.device
                    ),
                );
            }
            // A client that sends a new request no longer waits for the previous answer.
            reply.clear();
            *written = 0;
            *carried = None;
            if number == BROADCAST {
                if Function::of(pdu[0]).is_some_and(Function::writes) {
                    let mut nobody_hears = Vec::new();
                    for station in 0..units.len() {
                        units.answer(station, now, pdu, writes, &mut nobody_hears, port);
                    }
                    port.running("a client is talking");
                }
                return;
            }
            // With other units on the line, silence is the rule for units that are not addressed.
            let Some(station) = units.station(number) else {
                port.count("modbus-server.unknown_unit");
                return;
            };
            *carried = rtu::append(number, reply, |reply| {
                units.answer(station, now, pdu, writes, reply, port)
            });
            port.running("a client is talking");
        });
    }

    fn write(&mut self, port: &mut Port) -> Result<(), BusError> {
        if self.written == self.reply.len() {
            return Ok(());
        }
        let rest = &self.reply[self.written..];
        match self.serial.write(rest) {
            Ok(count) => {
                if let Some(echo) = &mut self.echo {
                    echo.sent(port.clock().now(), &rest[..count]);
                }
                self.written += count;
            }
            Err(error) if is_for_later(&error) => return Ok(()),
            Err(error) => return Err(gone(&self.line.device, &error)),
        }
        if self.written == self.reply.len()
            && let Some(carried) = self.carried.take()
        {
            self.units.carried(carried, port);
        }
        Ok(())
    }
}

/// Detects answers that come back as requests: those of functions 5, 6 and 22 look like requests.
#[derive(Debug, Default)]
struct Suspicion(u32);

impl Suspicion {
    /// Another request arrived, equal to the last answer or not; returns whether that has now happened often
    /// enough.
    fn is_confirmed(&mut self, is_last_answer: bool) -> bool {
        self.0 = if is_last_answer { self.0 + 1 } else { 0 };
        self.0 >= ECHOES && self.0.is_multiple_of(ECHOES)
    }
}
