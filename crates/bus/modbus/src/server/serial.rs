//! The units of a server on a serial line.

use std::io;

use crate::coding::Framer;
use crate::function::EXCEPTION_BIT;
use crate::line::Serial;
use crate::rtu::Echo;
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::tcp::{Call, Caller};
use tickbus_fieldbus::{BusError, Medium, Port, Renewal};
use tickbus_net::serial::{gone, open};

use super::units::{BROADCAST, Carried, ServedUnits, Source};

/// After this many consecutive requests that equal the previous answer, the log explains the setting for a
/// line with echo. (A client that writes one value repeatedly looks the same, and is answered as usual.)
const ECHOES: u32 = 20;

/// Serves the units until `stop`.
///
/// # Errors
///
/// The serial port does not exist or has disappeared.
pub(super) fn serve(
    line: &Serial,
    units: &mut ServedUnits,
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    let mut call = Call::new(open(&line.device, line.settings)?);
    port.carried_by(Medium::Serial {
        character: line.settings.character(),
    });
    port.tell("device", &line.device);
    port.opening(&format!("listening on {}", line.device));
    let mut server = Server {
        line,
        // A line has a single client.
        source: Source {
            renewals: vec![Renewal::of_only_client(); units.len()].into(),
            writer: None,
            may_write: true,
        },
        units,
        framer: Framer::new(line.coding, line.silence),
        echo: line.new_echo(),
        suspicion: Suspicion::default(),
        reply: Vec::new(),
        written: 0,
        carried: None,
        held_until: Nanos(i64::MIN),
        late: Vec::new(),
        turned: Nanos(i64::MIN),
    };
    call.run(&mut server, port, stop)
}

struct Server<'a> {
    line: &'a Serial,
    units: &'a mut ServedUnits,
    source: Source,
    framer: Framer,
    /// The echo of sent bytes, if the line is known to have one.
    echo: Option<Echo>,
    suspicion: Suspicion,
    /// The answer being sent, and how much of it the system has accepted.
    reply: Vec<u8>,
    written: usize,
    carried: Option<Carried>,
    /// Until when a fault holds the answer back.
    held_until: Nanos,
    /// The stations that answer late.
    late: Vec<usize>,
    /// The time of the last turn.
    turned: Nanos,
}

impl Server<'_> {
    /// Answers the telegram that silence has ended, if it is complete and addressed to a unit here.
    fn attend(&mut self, now: Nanos, port: &mut Port) {
        let Self {
            line,
            units,
            source,
            framer,
            suspicion,
            reply,
            written,
            carried,
            held_until,
            late,
            ..
        } = self;
        framer.take(now, |telegram| {
            port.read_telegrams(1);
            let Some((number, pdu)) = telegram.and_then(|telegram| line.coding.parse(telegram)) else {
                port.count("modbus-server.damaged");
                units.damaged(telegram.is_none());
                return;
            };
            units.heard();
            if !port.is_up(now) {
                Renewal::lost_all(&mut source.renewals, now, port.max_age());
                return;
            }
            // Requests never have this bit: it is another unit's answer, or the echo of an answer.
            if pdu[0] & EXCEPTION_BIT != 0 {
                port.count("modbus-server.answers_heard");
                return;
            }
            let is_last_answer = telegram.is_some_and(|bytes| line.coding.is_of(reply, bytes));
            if suspicion.is_confirmed(is_last_answer) {
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
                if units.broadcast(now, pdu, source, port) {
                    port.running("a client is talking");
                }
                return;
            }
            // With other units on the line, a unit must not answer unless it is addressed.
            let Some(station) = units.station(number) else {
                port.count("modbus-server.unknown_unit");
                return;
            };
            *carried = line.coding.append(number, reply, |reply| {
                units.answer(station, now, pdu, source, reply, port)
            });
            if let Some(wrong) = port.take_wrong() {
                line.coding.spoil(reply, 0, wrong);
                *carried = None;
            }
            let lateness = port.take_lateness();
            *held_until = now + lateness;
            *late = if lateness > Nanos::ZERO {
                port.take_late_stations()
            } else {
                Vec::new()
            };
            port.running("a client is talking");
        });
    }
}

impl Caller for Server<'_> {
    fn hear(&mut self, now: Nanos, bytes: &[u8], port: &mut Port) -> Result<(), BusError> {
        // Silence may have ended a telegram before these bytes arrived.
        self.attend(now, port);
        let own = self.echo.as_mut();
        let own = own.map_or(0, |echo| echo.strip(now, bytes));
        port.not_from_peer(own);
        let mut rest = &bytes[own..];
        while !rest.is_empty() {
            self.framer.arrived(now, &mut rest);
            self.attend(now, port);
        }
        Ok(())
    }

    fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        self.turned = now;
        self.attend(now, port);
        // What would go out over a line that is down is lost, and a dead station sends nothing.
        let is_due = self.written == 0 && !self.reply.is_empty() && now >= self.held_until;
        let mut late = self.late.iter();
        if is_due && !(port.is_up(now) && late.all(|at| port.is_station_up(*at, now))) {
            self.reply.clear();
            self.carried = None;
        }
        Ok(())
    }

    fn to_write(&self, now: Nanos) -> &[u8] {
        if now < self.held_until {
            return &[];
        }
        &self.reply[self.written..]
    }

    fn wrote(&mut self, now: Nanos, count: usize, port: &mut Port) {
        if let Some(echo) = &mut self.echo {
            echo.sent(now, &self.reply[self.written..][..count]);
        }
        self.written += count;
        if self.written == self.reply.len()
            && let Some(carried) = self.carried.take()
        {
            self.units.carried(&carried, port);
        }
    }

    fn deadline(&self, port: &Port) -> Nanos {
        let stale = port.stale_at(port.clock().now());
        // Once it is due, an answer that the system does not accept waits for the system, and not for a time.
        let is_held = self.written < self.reply.len() && self.turned < self.held_until;
        let held = if is_held { self.held_until } else { Nanos::MAX };
        self.framer.deadline().min(stale).min(held)
    }

    fn left(&mut self) -> BusError {
        gone(&self.line.device, "it was closed").into()
    }

    fn broke(&mut self, error: &io::Error) -> BusError {
        gone(&self.line.device, error).into()
    }
}

/// Detects answers that return as requests: those of functions 5, 6 and 22 look like requests.
#[derive(Debug, Default)]
struct Suspicion(u32);

impl Suspicion {
    /// Another request arrived; `is_last_answer` if it equals the last answer. Returns whether that has now happened
    /// often enough.
    fn is_confirmed(&mut self, is_last_answer: bool) -> bool {
        self.0 = if is_last_answer { self.0 + 1 } else { 0 };
        self.0 >= ECHOES && self.0.is_multiple_of(ECHOES)
    }
}
