//! Stations that do not answer, or refuse: they are skipped for a while, and polling of the others continues.

use crate::Exception;
use tickbus_base::time::Nanos;
use tickbus_fieldbus::{BusError, Port};

use super::super::request::Request;
use super::{Asked, Asking, ClientSession, Framing};

/// How long a refusing station is skipped.
const REST: Nanos = Nanos::from_secs(1);

/// The longest time that a silent station is skipped while others answer, as a multiple of that: each attempt makes the
/// others wait.
const LONGEST: i64 = 8;

/// The trouble of a station.
#[derive(Debug, Default)]
pub(super) struct Trouble {
    kind: Option<Kind>,
    /// The end of the time for which the station is skipped.
    pub(super) rests_until: Nanos,
    /// How long the station is skipped next time, if it is silent again.
    rest: i64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Silent,
    Refused,
}

impl ClientSession<'_> {
    /// The answer did not arrive in time.
    pub(super) fn give_up(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let Some(asking) = &self.asking else {
            return Ok(());
        };
        let station = asking.station;
        match asking.what {
            // The next answer may come from another device.
            Asked::Data(_) => self.doubt(station),
            Asked::Identity { .. } => self.says_nothing(station, now, port),
        }
        let within = self.timeout;
        self.miss(&format!("did not answer within {within}"), now, port)
    }

    /// There is no valid answer to the request: continues with the next station, unless none of them answers.
    pub(super) fn miss(&mut self, what: &str, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let Some(Asking {
            station,
            what: asked,
            ..
        }) = self.asking.take()
        else {
            return Ok(());
        };
        port.count("modbus-client.unanswered");
        self.clear();
        self.request.clear();
        self.written = 0;
        let Asked::Data(index) = asked else {
            return self.ask_later(station, now, port);
        };
        let query = &self.stations[station].queries[index];
        let error = BusError::Link(format!(
            "{}, asked to {query}, {what}; see whether the device runs, and whether \"unit\" is its number",
            self.named(station)
        ));
        let trouble = &mut self.stations[station].trouble;
        trouble.kind = Some(Kind::Silent);
        trouble.rest = (trouble.rest * 2).clamp(1, LONGEST);
        trouble.rests_until = now + REST.times(trouble.rest);
        let rest = REST.times(trouble.rest);
        let mut stations = self.stations.iter();
        if stations.all(|polled| polled.trouble.kind == Some(Kind::Silent)) {
            if !matches!(self.framing, Framing::Serial { .. }) {
                return Err(error);
            }
            // All stations are silent, so none keeps another waiting; retry them at once to notice a repaired line.
            for polled in &mut *self.stations {
                polled.trouble.rests_until = now;
            }
            self.lose(&error, "it is asked again every cycle", port);
        } else {
            tell(&error, rest, port);
        }
        self.begin(station + 1, now, port)
    }

    /// A station refused the query with this index.
    pub(super) fn refused(
        &mut self,
        station: usize,
        index: usize,
        exception: Exception,
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        if self.adapts(station, index, exception, port) {
            self.stations[station].forget_queries();
            return self.begin(station, now, port);
        }
        let query = &self.stations[station].queries[index];
        if query.is_look() && exception.is_about_the_request() {
            // The device is alive, and the element of this check need not exist.
            return self.go_on(station, index + 1, now, port);
        }
        let right = match (exception, query) {
            (Exception::ILLEGAL_FUNCTION, _) => {
                "choose another table with \"inputs\", \"outputs\" or [fieldbus.at]"
            }
            (Exception::ILLEGAL_DATA_ADDRESS, _) => {
                "correct \"inputs\", \"outputs\" or [fieldbus.at]; offsets count from 0"
            }
            _ if exception.passes() => {
                "see whether the device runs, and whether \"unit\" is its number"
            }
            _ => "see what the device's manual says of it",
        };
        let error = BusError::Refused(format!(
            "{} refused to {query}: {exception}; {right}",
            self.named(station)
        ));
        if matches!(
            exception,
            Exception::GATEWAY_PATH_UNAVAILABLE | Exception::GATEWAY_TARGET_FAILED
        ) {
            // The gateway refuses, not the device: the next answer may come from another device.
            port.count("modbus-client.unanswered");
            self.doubt(station);
        }
        self.declined(station, error, now, port)?;
        if matches!(
            exception,
            Exception::ACKNOWLEDGE | Exception::SERVER_DEVICE_BUSY
        ) {
            // The device may be ready in the next cycle.
            self.stations[station].trouble.rests_until = now;
        }
        Ok(())
    }

    /// True if the device can be asked in another way; if so, that is used from now on.
    fn adapts(&mut self, station: usize, index: usize, exception: Exception, port: &Port) -> bool {
        let unit = self.named(station);
        let polled = &mut self.stations[station];
        let (query, able) = (&polled.queries[index], &mut polled.able);
        let is_unknown = exception == Exception::ILLEGAL_FUNCTION;
        let instead = match query {
            // Some servers lack this function, or have it only for some registers.
            Request::Both { .. } if !exception.passes() => {
                able.combine = false;
                "it is asked in two requests"
            }
            // Some report a failure for an address that does not exist.
            Request::Read(read)
                if read.joined
                    && (exception.is_about_the_request()
                        || exception == Exception::SERVER_DEVICE_FAILURE) =>
            {
                able.gap = 0;
                "it is asked without what lies between the signals"
            }
            Request::Write(write) if is_unknown && write.table.is_bits() => {
                able.many_coils = false;
                "its coils are written one by one"
            }
            // Reading does no harm, nor does writing the rest.
            Request::Mask(_) if is_unknown => {
                able.masks = false;
                port.tell(
                    "refused",
                    &format!("{unit} refused to {query}: {exception}"),
                );
                port.log(
                    log::Level::Warn,
                    "refused",
                    format_args!(
                        "{unit} refused to {query}: {exception}; it cannot write single bits of a register, and none is \
                         written any more: let signals have all 16 of it, or the PLC's program take the bit from a coil"
                    ),
                );
                return true;
            }
            Request::Write(_) if is_unknown => {
                able.many_registers = false;
                "its registers are written one by one, so that a value of several may be seen half written"
            }
            _ => return false,
        };
        port.log(
            log::Level::Info,
            "adapted",
            format_args!("{unit} refused to {query}: {exception}; {instead}"),
        );
        true
    }

    /// A station answered, but not with the requested data.
    pub(super) fn declined(
        &mut self,
        station: usize,
        error: BusError,
        now: Nanos,
        port: &mut Port,
    ) -> Result<(), BusError> {
        if matches!(error, BusError::Protocol(_)) && self.stations.len() == 1 {
            return Err(error);
        }
        port.count("modbus-client.refused");
        self.stations[station].trouble = Trouble {
            kind: Some(Kind::Refused),
            rests_until: now + REST,
            rest: 0,
        };
        if self
            .stations
            .iter()
            .all(|polled| polled.trouble.kind.is_some())
        {
            self.lose(&error, "it is asked again every second", port);
        } else {
            tell(&error, REST, port);
        }
        self.begin(station + 1, now, port)
    }

    /// A station works.
    pub(super) fn recovered(&mut self, station: usize) {
        self.stations[station].trouble = Trouble::default();
        self.lost = false;
    }

    fn lose(&mut self, error: &BusError, next: &str, port: &mut Port) {
        if !std::mem::replace(&mut self.lost, true) {
            port.lost(error, next);
        }
    }
}

/// Logs that a station has trouble while others work.
fn tell(error: &BusError, rest: Nanos, port: &Port) {
    port.log(
        log::Level::Warn,
        "station",
        format_args!("{error}; it is asked again in {rest}, and the other stations go on"),
    );
}
