//! Learning who a device is, before anything is written into it.

use crate::fieldbus::modbus::identification::{READ_DEVICE_IDENTIFICATION, Taken};
use crate::fieldbus::modbus::rtu;
use crate::fieldbus::modbus::{Exception, Function, Identification};
use crate::fieldbus::{BusError, Port};
use crate::time::Nanos;

use super::super::query::{Fault, expect};
use super::{Asked, Asking, Poll};

/// So many requests are made at most to learn who a device is.
const IDENTIFYING: usize = 8;

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
        self.ask(station, what, rtu::ADU_LIMIT, now, |_, pdu| {
            let code = Function::DeviceIdentification.code();
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
            // A device that is busy or away says who it is another time.
            Err(Fault::Refused(
                exception @ (Exception::SERVER_DEVICE_BUSY
                | Exception::GATEWAY_PATH_UNAVAILABLE
                | Exception::GATEWAY_TARGET_FAILED),
            )) => {
                self.asking = Some(Asking {
                    station,
                    what: Asked::Identity { so_far, requests },
                    limit: now,
                });
                return self.give_up(&format!("gave {exception}"), now, port);
            }
            Ok(None) | Err(_) => so_far = Identification::default(),
        }
        let mut identity = so_far.line();
        if identity.is_empty() {
            let unit = self.stations[station].unit;
            identity = format!("modbus device at {}, unit {unit}", self.peer);
        }
        self.guards[station].meet(port, &identity);
        self.stations[station].identified = true;
        self.prepare(station);
        self.begin(station, now, port)
    }
}
