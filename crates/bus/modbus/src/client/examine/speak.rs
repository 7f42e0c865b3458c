//! The step `protocol`: whether a unit answers as Modbus does, and if not, what answers instead.

use super::super::{ClientOptions, Region, Request};
use super::USUAL_UNITS;
use super::ask::{Frame, Miss, Talk, protocol, speaks_tls};
use crate::tls::{self, ClientSide};
use crate::{Exception, Span, Table};
use tickbus_fieldbus::examine::{Examination, Peer, WireEnd};

/// The next thing to try if the device speaks TLS and the file does not.
const TLS_EXPECTED: &str = "the device speaks TLS on this port: add tls = { ... } (Modbus/TCP Security), or use its port without \
                            TLS (502)";

/// A device that is reached, and how.
pub(super) struct Reached<'a> {
    pub(super) peer: &'a Peer,
    pub(super) frame: Frame,
    pub(super) tls: Option<ClientSide>,
}

impl Reached<'_> {
    /// Another connection with the same framing.
    pub(super) fn again(&self) -> Option<Talk> {
        let wire = self.peer.dial().ok()?;
        let wire = match &self.tls {
            Some(side) => tls::open(side, wire).ok()?,
            None => wire,
        };
        Some(Talk::new(wire, self.frame))
    }
}

impl ClientOptions {
    /// The step `protocol` for a station: whether its unit answers as Modbus does.
    pub(super) fn speaks(
        &self,
        examination: &mut Examination<'_>,
        reached: &Reached<'_>,
        talk: &mut Talk,
        station: usize,
    ) -> bool {
        let unit = self.unit(station);
        let probe = self.probe(examination, station);
        let answered = answers(talk, unit, &probe);
        let Err(miss) = answered else {
            examination.ok("protocol", format!("unit {unit} answers as Modbus does"));
            return true;
        };
        talk.hang_up();
        let peer = reached.peer.address;
        let told = format!("{peer}, unit {unit}, {miss}");
        match &miss {
            Miss::Alien(bytes) => {
                let (cause, next) = match protocol(bytes) {
                    Some("TLS") => ("tls-expected", TLS_EXPECTED.to_owned()),
                    Some(other) => (
                        "not-modbus",
                        format!(
                            "the device speaks {other} here: correct the port, or the kind of bus"
                        ),
                    ),
                    None if answers_as(reached, other_frame(reached.frame), unit, &probe) => {
                        return wrong_frame(examination, reached.frame, told);
                    }
                    None => (
                        "not-modbus",
                        "correct the port: Modbus TCP usually has 502".to_owned(),
                    ),
                };
                examination.fail("protocol", cause, told, &next);
                return false;
            }
            Miss::End(WireEnd::Broken(why)) if why.contains("certificate") => {
                let next = "let the device trust the authority of certificate_file";
                examination.fail("tls", "certificate-refused", format!("{peer}: {why}"), next);
                return false;
            }
            Miss::End(WireEnd::Closed | WireEnd::Broken(_)) if reached.tls.is_some() => {
                let next =
                    "let the device trust the authority of certificate_file, and see its log";
                examination.fail("tls", "certificate-refused", told, next);
                return false;
            }
            _ => {}
        }
        let others = USUAL_UNITS.into_iter().filter(|other| *other != unit);
        let other = others
            .into_iter()
            .find(|other| answers_as_unit(reached, *other, &probe));
        if let Some(other) = other {
            examination.fail(
                "protocol",
                "wrong-unit",
                format!("{told}, and unit {other} answers"),
                &format!("write unit = {other}"),
            );
            return false;
        }
        if answers_as(reached, other_frame(reached.frame), unit, &probe) {
            return wrong_frame(examination, reached.frame, told);
        }
        if reached.tls.is_none() && reached.peer.dial().is_ok_and(speaks_tls) {
            examination.fail("protocol", "tls-expected", told, TLS_EXPECTED);
            return false;
        }
        let (cause, next) = match miss {
            Miss::End(WireEnd::Silent) => (
                "silent",
                "the port is open, but nothing answers: see whether the Modbus server of the PLC runs, whether \
                 another client occupies it, and whether the unit is right",
            ),
            Miss::End(_) => (
                "connection-limit",
                "the device lets nobody in: another client may hold its only connection (end it), or the device \
                 accepts listed addresses only (add that of this computer)",
            ),
            Miss::Refused(_) => (
                "gateway-no-answer",
                "the gateway answers, and the unit behind it does not: check the unit, its supply and its line",
            ),
            _ => ("not-modbus", "see what the device is"),
        };
        examination.fail("protocol", cause, told, next);
        false
    }

    /// A request that reads one element which the file uses.
    pub(super) fn probe(&self, examination: &Examination<'_>, station: usize) -> Request {
        let mut signals = examination.signals(station);
        let region = signals.find_map(|(_, signal)| {
            let piece = self.pieces_of(examination, signal).first().copied()?;
            let Span { first, .. } = piece.span();
            Some(Region::new(piece.table, Span { first, count: 1 }))
        });
        let first = Region::new(Table::HoldingRegisters, Span { first: 0, count: 1 });
        Request::Read(region.unwrap_or(first))
    }
}

fn wrong_frame(examination: &mut Examination<'_>, own: Frame, told: String) -> bool {
    let next = match own {
        Frame::Tcp => "the device speaks RTU over TCP: write framing = \"rtu\"",
        _ => "the device speaks Modbus TCP: remove framing = \"rtu\"",
    };
    examination.fail("protocol", "wrong-framing", told, next);
    false
}

const fn other_frame(frame: Frame) -> Frame {
    match frame {
        Frame::Tcp => Frame::Rtu,
        _ => Frame::Tcp,
    }
}

/// Checks that a unit answers: with data, or with an exception of its own and not of a gateway.
pub(super) fn answers(talk: &mut Talk, unit: u8, probe: &Request) -> Result<(), Miss> {
    let mut receives = [0; 2];
    match talk.read(unit, probe, &mut receives) {
        Err(Miss::Refused(
            Exception::GATEWAY_PATH_UNAVAILABLE | Exception::GATEWAY_TARGET_FAILED,
        )) => talk.read(unit, probe, &mut receives),
        Err(Miss::Refused(_)) => Ok(()),
        answered => answered,
    }
}

fn answers_as_unit(reached: &Reached<'_>, unit: u8, probe: &Request) -> bool {
    let talk = reached.again();
    talk.is_some_and(|mut talk| answers(&mut talk, unit, probe).is_ok())
}

fn answers_as(reached: &Reached<'_>, frame: Frame, unit: u8, probe: &Request) -> bool {
    let wire = reached.peer.dial().ok().filter(|_| reached.tls.is_none());
    wire.is_some_and(|wire| answers(&mut Talk::new(wire, frame), unit, probe).is_ok())
}
