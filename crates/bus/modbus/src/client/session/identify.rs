//! Reading the identity of a device before anything is written to it.

use crate::identification::{READ_DEVICE_IDENTIFICATION, Taken};
use crate::rtu;
use crate::{Function, Identification};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::{BusError, Port};

use super::super::request::{AnswerError, expect};
use super::{Asked, ClientSession};

/// The most requests made to read an identity.
const IDENTIFYING: usize = 8;

/// The pause before a device that did not report its identity is asked again.
const PAUSE: Nanos = Nanos::from_secs(1);

/// How many times in a row a device may be silent, fail or close the connection when asked for its identity,
/// before it counts as a device without one. In between the device answers other requests, so it is there.
const SILENCES: u8 = 2;

/// The pause before a device that seemed to have no identity is asked again, if `write_to` names another one: two
/// connections may have broken by chance during the question. Doubled each time, since a device that hangs up loses its
/// connection by the question.
const AGAIN: Nanos = Nanos::from_secs(10);

/// How often that pause is doubled.
const DOUBLINGS: u32 = 8;

/// The state of a device's identity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Identity {
    /// Still to be asked for, but not before this time.
    Unknown { silences: u8, not_before: Nanos },
    /// Reported, or the device has none.
    Known,
}

impl Default for Identity {
    fn default() -> Self {
        Self::Unknown {
            silences: 0,
            not_before: Nanos::ZERO,
        }
    }
}

impl Identity {
    pub(super) fn is_due(self, now: Nanos) -> bool {
        matches!(self, Self::Unknown { not_before, .. } if now >= not_before)
    }
}

impl ClientSession<'_> {
    /// Asks a station for its identity, starting with this object.
    pub(super) fn ask_identity(
        &mut self,
        station: usize,
        so_far: Identification,
        requests: usize,
        object: u8,
        now: Nanos,
    ) {
        const BASIC: u8 = 1;
        let what = Asked::Identity { so_far, requests };
        let code = Function::DeviceIdentification.code();
        self.ask(station, what, code, rtu::ADU_LIMIT, now, |_, pdu| {
            pdu.extend_from_slice(&[code, READ_DEVICE_IDENTIFICATION, BASIC, object]);
        });
    }

    /// An answer to the request for the identity arrived: a part of it, or a refusal.
    pub(super) fn identified(
        &mut self,
        station: usize,
        mut so_far: Identification,
        requests: usize,
        pdu: &[u8],
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        let said = expect(Function::DeviceIdentification, pdu);
        match said.map(|data| so_far.take(data)) {
            Ok(Some(Taken::MoreFrom(next))) if requests + 1 < IDENTIFYING => {
                self.ask_identity(station, so_far, requests + 1, next, now);
                return Ok(());
            }
            Ok(Some(_)) => {}
            Err(AnswerError::Refused(exception)) if exception.is_about_the_request() => {
                so_far = Identification::default();
            }
            // A device that is busy or unreachable may report it later.
            Err(AnswerError::Refused(exception)) => {
                if !exception.passes() {
                    self.says_nothing(station, now, port);
                }
                return self.ask_later(station, now, port);
            }
            Ok(None) | Err(AnswerError::Malformed(_)) => {
                self.is_unclear(station, "gave a malformed answer", port);
                return self.ask_later(station, now, port);
            }
        }
        self.stations[station].hang_ups = 0;
        self.stations[station].presumed = 0;
        self.meet(station, &so_far, port);
        self.begin(station + 1, now, port)
    }

    /// The device did not answer the request for its identity, or failed to.
    pub(super) fn says_nothing(&mut self, station: usize, now: Nanos, port: &mut Port) {
        if let Identity::Unknown { silences, .. } = &mut self.stations[station].identity {
            *silences += 1;
            if *silences >= SILENCES {
                self.presume_none(station, now, port);
            }
        }
    }

    /// The device seems to have no identity. If that prevents this end from writing, the device is asked again later.
    fn presume_none(&mut self, station: usize, now: Nanos, port: &mut Port) {
        self.meet(station, &Identification::default(), port);
        let guard = &self.guards[station];
        if guard.names_one() && !guard.may_write() {
            let station = &mut self.stations[station];
            station.identity = Identity::Unknown {
                silences: 0,
                not_before: now + AGAIN.times(1 << station.presumed),
            };
            station.presumed = DOUBLINGS.min(station.presumed + 1);
        }
    }

    /// The device's answer to the request for its identity cannot be understood. Since the device does answer, it does
    /// not count as one without an identity.
    pub(super) fn is_unclear(&mut self, station: usize, what: &str, port: &Port) {
        if let Identity::Unknown { silences, .. } = &mut self.stations[station].identity {
            *silences = 0;
        }
        port.log(
            log::Level::Warn,
            "identity",
            format_args!(
                "{} {what} when it was asked who it is (function 43); nothing is written before it has said so; it is \
                 asked again in {PAUSE}",
                self.named(station)
            ),
        );
    }

    /// Continues with the next station, and asks this one for its identity later if it is still unknown.
    pub(super) fn ask_later(
        &mut self,
        station: usize,
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        if let Identity::Unknown { not_before, .. } = &mut self.stations[station].identity {
            *not_before = (now + PAUSE).max(*not_before);
        }
        self.begin(station + 1, now, port)
    }

    fn meet(&mut self, station: usize, said: &Identification, port: &mut Port) {
        let mut identity = said.line();
        if identity.is_empty() {
            let unit = self.stations[station].unit;
            identity = format!("modbus device at {}, unit {unit}", self.peer);
        }
        self.guards[station].meet(port, station..station + 1, &identity);
        self.stations[station].identity = Identity::Known;
    }

    /// The known identity may be outdated: nothing is written until the device has reported it again.
    pub(super) fn doubt(&mut self, station: usize) {
        self.guards[station].part();
        self.stations[station].identity = Identity::default();
        self.stations[station].forget_queries();
    }

    /// True if a station is to be asked for its identity. A station that has closed the connection too often when asked
    /// counts as one without an identity.
    pub(super) fn may_ask(&mut self, station: usize, now: Nanos, port: &mut Port) -> bool {
        if self.stations[station].hang_ups < SILENCES {
            return true;
        }
        self.stations[station].hang_ups = 0;
        self.presume_none(station, now, port);
        false
    }

    /// The connection has ended: returns whether it did while a device was being asked for its identity.
    pub(super) fn hung_up(&mut self) -> bool {
        let Some(asking) = &self.asking else {
            return false;
        };
        let asks = matches!(asking.what, Asked::Identity { .. });
        let station = asking.station;
        if asks {
            self.stations[station].hang_ups += 1;
        }
        asks
    }
}
