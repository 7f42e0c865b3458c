//! Learning who a device is, before anything is written into it.

use crate::identification::{READ_DEVICE_IDENTIFICATION, Taken};
use crate::rtu;
use crate::{Function, Identification};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::{BusError, Port};

use super::super::query::{Fault, expect};
use super::{Asked, Poll};

/// So many requests are made at most to learn who a device is.
const IDENTIFYING: usize = 8;

/// How long it is until a device is asked again that did not say who it is.
const PAUSE: Nanos = Nanos::from_secs(1);

/// So many times in a row a device is silent, fails or hangs up when it is asked who it is, until that counts as its
/// answer. Each time it has answered something else before, so it is there.
const SILENCES: u8 = 2;

/// What is known of who a device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Identity {
    /// It is still to be asked, not before then.
    Unknown { silences: u8, not_before: Nanos },
    /// It said it, or said nothing.
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

impl Poll<'_> {
    /// Asks a station who it is, from this object on.
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

    /// Who the device is came, or that it does not say.
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
            Err(Fault::Refused(exception)) if exception.is_about_the_request() => {
                so_far = Identification::default();
            }
            // A device that is busy or away says who it is another time.
            Err(Fault::Refused(exception)) => {
                if !exception.passes() {
                    self.says_nothing(station, port);
                }
                return self.ask_later(station, now, port);
            }
            Ok(None) | Err(Fault::Malformed(_)) => {
                self.is_unclear(station, "gave a malformed answer", port);
                return self.ask_later(station, now, port);
            }
        }
        self.stations[station].hang_ups = 0;
        self.meet(station, &so_far, port);
        self.begin(station + 1, now, port)
    }

    /// The device gave no answer when it was asked who it is, or has failed at it.
    pub(super) fn says_nothing(&mut self, station: usize, port: &mut Port) {
        if let Identity::Unknown { silences, .. } = &mut self.stations[station].identity {
            *silences += 1;
            if *silences >= SILENCES {
                self.meet(station, &Identification::default(), port);
            }
        }
    }

    /// The device gave an answer that cannot be understood when it was asked who it is. As it does answer, it does not
    /// count as nameless.
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

    /// Goes on with the next station, and asks this one another time who it is, if that is not known yet.
    pub(super) fn ask_later(
        &mut self,
        station: usize,
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        if let Identity::Unknown { not_before, .. } = &mut self.stations[station].identity {
            *not_before = now + PAUSE;
        }
        self.begin(station + 1, now, port)
    }

    fn meet(&mut self, station: usize, said: &Identification, port: &mut Port) {
        let mut identity = said.line();
        if identity.is_empty() {
            let unit = self.stations[station].unit;
            identity = format!("modbus device at {}, unit {unit}", self.peer);
        }
        self.guards[station].meet(port, &identity);
        self.stations[station].identity = Identity::Known;
    }

    /// Who the device is may not be true any more: nothing is written until it has said it again.
    pub(super) fn doubt(&mut self, station: usize) {
        self.guards[station].part();
        self.stations[station].identity = Identity::default();
        self.stations[station].forget_queries();
    }

    /// Whether a station is to be asked who it is. After it hung up for that too often, that is its answer, for this
    /// connection.
    pub(super) fn may_ask(&mut self, station: usize, port: &mut Port) -> bool {
        if self.stations[station].hang_ups < SILENCES {
            return true;
        }
        self.stations[station].hang_ups = 0;
        self.meet(station, &Identification::default(), port);
        false
    }

    /// The connection has ended: tells whether that was when a device was asked who it is.
    pub(in super::super) fn hung_up(&mut self) -> bool {
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
