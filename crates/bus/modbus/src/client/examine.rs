//! The steps of an examination that are Modbus' own: TLS, protocol, units, identity, and each signal's elements.

mod addresses;
mod ask;
mod datagrams;
mod serial;
mod speak;

use tickbus_base::time::{Clock, Nanos};
use tickbus_fieldbus::examine::{Examination, Round, Wire};
use tickbus_image::signal::{Signal, SignalTable};
use tickbus_net::Address;

use super::{ClientOptions, Region, Request};
use crate::tls::{self, ClientSide};
use crate::{Line, Piece, Span, Table};

pub(super) use ask::{Frame, Miss, Talk, legible};
use speak::{Reached, answers};

/// The units that devices usually have, to be tried if the one of the file does not answer.
pub(super) const USUAL_UNITS: [u8; 5] = [1, 255, 0, 2, 3];

impl ClientOptions {
    /// Examines the line.
    pub(crate) fn examine(&self, examination: &mut Examination<'_>) {
        let (address, frame) = match &self.line {
            Line::Tcp(address) => (address, Frame::Tcp),
            Line::RtuOverTcp(address) => (address, Frame::Rtu),
            Line::Udp(address) => return self.examine_datagrams(examination, address),
            Line::Serial(serial) => return self.examine_serial(examination, serial),
        };
        let Some((peer, wire)) = examination.reach(address) else {
            return;
        };
        let Some((side, wire)) = self.encrypt(examination, address, wire) else {
            return;
        };
        let reached = Reached {
            peer: &peer,
            frame,
            tls: side,
        };
        let mut talk = Talk::new(wire, frame);
        for station in 0..examination.setup.table.stations.len() {
            if !self.speaks(examination, &reached, &mut talk, station) {
                return;
            }
        }
        let device = peer.address.to_string();
        let served = |examination: &mut Examination<'_>| {
            second_client(examination, &reached, self.unit(0));
        };
        self.look_at_values(examination, talk, (&device, &|| reached.again()), served);
    }

    /// The steps from `identity` on, with a device that speaks Modbus. `again` is another connection with it, if it has
    /// more than one; `before_values` is a step before the values are watched.
    fn look_at_values(
        &self,
        examination: &mut Examination<'_>,
        mut talk: Talk,
        (device, again): (&str, &dyn Fn() -> Option<Talk>),
        before_values: impl FnOnce(&mut Examination<'_>),
    ) {
        for station in 0..examination.setup.table.stations.len() {
            self.identify(examination, device, &mut talk, station, again);
        }
        let requests = self.reads(examination);
        examination.sizes(&format!("{} requests read all of it", requests.len()));
        if !self.read_each(examination, &mut talk) {
            return;
        }
        before_values(examination);
        let pieces = self.pieces_of_signals(examination);
        let clock = examination.setup.clock;
        examination.watch_values(|| round(&mut talk, &**clock, &requests, &pieces));
    }

    /// Begins TLS, if the file asks for it; `None` if that has failed.
    fn encrypt(
        &self,
        examination: &mut Examination<'_>,
        address: &Address,
        wire: Wire,
    ) -> Option<(Option<ClientSide>, Wire)> {
        let Some(own) = &self.tls else {
            return Some((None, wire));
        };
        let side = match ClientSide::load(own, address, examination.setup.folder) {
            Ok(side) => side,
            Err(error) => {
                let why = match error {
                    tickbus_fieldbus::OpenError::Config(mistake) => mistake.to_string(),
                    tickbus_fieldbus::OpenError::Unsupported(why) => why,
                };
                examination.fail(
                    "tls",
                    "tls-files",
                    why,
                    "correct the keys of [fieldbus.tls]",
                );
                return None;
            }
        };
        match tls::open(&side, wire) {
            Ok(wire) => {
                examination.ok("tls", "the certificates are accepted so far");
                Some((Some(side), wire))
            }
            Err((cause, why)) => {
                let next = match cause {
                    "tls-missing" => {
                        "remove \"tls\", or switch on Modbus/TCP Security in the device (port 802)"
                    }
                    _ => "exchange the certificates: each end needs the authority of the other one",
                };
                examination.fail("tls", cause, why, next);
                None
            }
        }
    }

    /// The pieces of one signal, whose bits count from the signal's own first byte.
    fn pieces_of(&self, examination: &Examination<'_>, signal: &Signal) -> Vec<Piece> {
        let alone = SignalTable {
            stations: examination.setup.table.stations.clone(),
            signals: vec![signal.clone()],
            structures: Vec::new(),
        };
        let pieces = self.pieces(&alone, signal.station, signal.area).into_iter();
        pieces
            .map(|piece| Piece {
                bit: piece.bit - signal.byte * 8,
                ..piece
            })
            .collect()
    }

    fn pieces_of_signals(&self, examination: &Examination<'_>) -> Vec<(u8, Vec<Piece>)> {
        let signals = examination.setup.table.signals.iter();
        let of = |signal: &Signal| {
            (
                self.unit(signal.station),
                self.pieces_of(examination, signal),
            )
        };
        signals.map(of).collect()
    }

    /// The requests that read all signals, of both areas, with their units.
    fn reads(&self, examination: &Examination<'_>) -> Vec<(u8, Request)> {
        let table = examination.setup.table;
        let mut all = Vec::new();
        for station in 0..table.stations.len() {
            let (written, read) = examination.setup.role.areas();
            let mut pieces = self.pieces(table, station, read);
            if written != read {
                pieces.extend(self.pieces(table, station, written));
            }
            let requests = super::queries(&pieces, &[], &self.capabilities());
            all.extend(
                requests
                    .into_iter()
                    .map(|request| (self.unit(station), request)),
            );
        }
        all
    }

    /// The step `identity` of a station.
    fn identify(
        &self,
        examination: &mut Examination<'_>,
        device: &str,
        talk: &mut Talk,
        station: usize,
        again: &dyn Fn() -> Option<Talk>,
    ) {
        let unit = self.unit(station);
        let write_to = self.stations.write_to(station);
        let identity = talk.identity(unit);
        if matches!(identity, Err(Miss::End(_) | Miss::Alien(_))) {
            // Some devices close the connection, or are out of step, after this question.
            talk.hang_up();
            if let Some(again) = again() {
                *talk = again;
            }
        }
        // The polling client knows devices by function 43 alone.
        let line = identity
            .as_ref()
            .map(crate::Identification::line)
            .unwrap_or_default();
        if line.is_empty() {
            let usual = format!("modbus device at {device}, unit {unit}");
            examination.compare_identity(&usual, write_to);
        } else {
            examination.compare_identity(&line, write_to);
        }
    }
}

/// The step `clients`: whether the device serves a second client beside this one.
fn second_client(examination: &mut Examination<'_>, reached: &Reached<'_>, unit: u8) {
    let first = Region::new(Table::HoldingRegisters, Span { first: 0, count: 1 });
    let served = reached
        .again()
        .is_some_and(|mut talk| answers(&mut talk, unit, &Request::Read(first)).is_ok());
    if served {
        examination.ok("clients", "a second connection is served as well");
    } else {
        let step = examination.ok("clients", "a second connection is not served");
        "the device serves one client at a time: end this examination, and others, before the driver starts"
            .clone_into(&mut step.next);
    }
}

/// Reads everything with as few requests as the driver makes.
fn round(
    talk: &mut Talk,
    clock: &dyn Clock,
    requests: &[(u8, Request)],
    pieces: &[(u8, Vec<Piece>)],
) -> Option<Round> {
    let begin = clock.now();
    let mut regions = Vec::new();
    for (unit, request) in requests {
        let Some(region) = request.read() else {
            continue;
        };
        // The bytes of the elements themselves, and not of a frame.
        let bits = region.span.count * region.table.width();
        let mut whole = Region::new(region.table, region.span);
        whole.pieces.push(Piece {
            table: region.table,
            wire: region.span.first * region.table.width(),
            bit: 0,
            bits,
            fills: false,
        });
        let mut bytes = vec![0; bits.div_ceil(8)];
        match talk.read(*unit, &Request::Read(whole), &mut bytes) {
            Ok(()) => regions.push((*unit, region.table, region.span, bytes)),
            Err(Miss::Refused(_)) => {}
            Err(_) => return None,
        }
    }
    let took: Nanos = clock.now() - begin;
    let value = |(unit, pieces): &(u8, Vec<Piece>)| {
        let mut value = Vec::new();
        for piece in pieces {
            let span = piece.span();
            let found = regions.iter().find(|(of, table, region, _)| {
                (of, *table) == (unit, piece.table)
                    && region.first <= span.first
                    && span.end() <= region.end()
            });
            let Some((_, table, region, bytes)) = found else {
                return Vec::new();
            };
            let from = piece.wire - region.first * table.width();
            let mut own = vec![0; piece.bits.div_ceil(8)];
            tickbus_fieldbus::copy_bits(bytes, from, piece.bits, &mut own, 0);
            value.extend(own);
        }
        value
    };
    Some(Round {
        begin,
        took,
        values: pieces.iter().map(value).collect(),
    })
}
