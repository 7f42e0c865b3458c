//! The steps of an examination that are Modbus' own: TLS, protocol, units, identity, and each signal's elements.

mod ask;
mod speak;

use tickbus_base::time::Nanos;
use tickbus_fieldbus::examine::{Examination, Neighbours, Peer, Round, Wire};
use tickbus_image::signal::{Signal, SignalTable};
use tickbus_net::Address;

use super::{ClientOptions, Region, Request};
use crate::tls::{self, ClientSide};
use crate::{ElementAddress, Exception, Line, Piece, Span, Table};

pub(super) use ask::{Frame, Miss, Talk, legible};
use speak::{Reached, answers};

/// The units that devices usually have, to be tried if the one of the file does not answer.
pub(super) const USUAL_UNITS: [u8; 5] = [1, 255, 0, 2, 3];

/// The most requests for single signals: a table of thousands is not read element by element.
const SINGLES: usize = 200;

impl ClientOptions {
    /// Examines the line.
    pub(crate) fn examine(&self, examination: &mut Examination<'_>) {
        let (address, frame) = match &self.line {
            Line::Tcp(address) => (address, Frame::Tcp),
            Line::RtuOverTcp(address) => (address, Frame::Rtu),
            Line::Udp(_) => return examination.unexamined("Modbus over UDP"),
            Line::Serial(_) => return examination.unexamined("a serial line"),
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
        for station in 0..examination.setup.table.stations.len() {
            self.identify(examination, &reached, &mut talk, station);
        }
        let requests = self.reads(examination);
        examination.sizes(&format!("{} requests read all of it", requests.len()));
        if !self.read_each(examination, &mut talk) {
            return;
        }
        second_client(examination, &reached, self.unit(0));
        let pieces = self.pieces_of_signals(examination);
        examination.watch_values(|| round(&mut talk, &peer, &requests, &pieces));
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
        reached: &Reached<'_>,
        talk: &mut Talk,
        station: usize,
    ) {
        let unit = self.unit(station);
        let write_to = self.stations.write_to(station);
        let identity = talk.identity(unit);
        if matches!(identity, Err(Miss::End(_) | Miss::Alien(_))) {
            // Some devices close the connection, or are out of step, after this question.
            talk.hang_up();
            if let Some(again) = reached.again() {
                *talk = again;
            }
        }
        // The polling client knows devices by function 43 alone.
        let line = identity
            .as_ref()
            .map(crate::Identification::line)
            .unwrap_or_default();
        if line.is_empty() {
            let usual = format!("modbus device at {}, unit {unit}", reached.peer.address);
            examination.compare_identity(&usual, write_to);
        } else {
            examination.compare_identity(&line, write_to);
        }
    }

    /// The steps `addresses` and `values`. False if the device refuses everything.
    fn read_each(&self, examination: &mut Examination<'_>, talk: &mut Talk) -> bool {
        let mut refused: Vec<(usize, Miss, [bool; 2])> = Vec::new();
        let mut values = Vec::new();
        let count = examination.setup.table.signals.len();
        for index in 0..count.min(SINGLES) {
            let signal = &examination.setup.table.signals[index];
            let unit = self.unit(signal.station);
            let pieces = self.pieces_of(examination, signal);
            let bytes = signal.data_type.size_bytes();
            let mut read = |shift: isize| read_shifted(talk, unit, &pieces, shift, bytes);
            match read(0) {
                Some(Ok(here)) if bytes > 1 => {
                    let at = |shift: isize| place(&pieces, shift);
                    values.push(Neighbours {
                        signal: index,
                        here,
                        below: read(-1).and_then(Result::ok),
                        above: read(1).and_then(Result::ok),
                        places: [at(0), at(-1), at(1)],
                    });
                }
                Some(Ok(_)) | None => {}
                Some(Err(miss @ (Miss::End(_) | Miss::Alien(_)))) => {
                    let name = &signal.name;
                    let next = "see whether the device closes connections at this request: read less, or from \
                                another table";
                    let why = format!(
                        "the device {miss} when \"{name}\" at {} is read",
                        place(&pieces, 0)
                    );
                    examination.fail("addresses", "connection-lost", why, next);
                    return false;
                }
                Some(Err(miss)) => {
                    let can = [-1, 1].map(|shift| matches!(read(shift), Some(Ok(_))));
                    refused.push((index, miss, can));
                }
            }
        }
        if refused.is_empty() {
            let rest = if count > SINGLES {
                format!("; the first {SINGLES} were read one by one")
            } else {
                String::new()
            };
            examination.ok("addresses", format!("all signals can be read{rest}"));
        } else {
            self.tell_refused(examination, &refused);
        }
        examination.judge_values(&values);
        !refused.len().eq(&count.min(SINGLES)) || count == 0
    }

    fn tell_refused(
        &self,
        examination: &mut Examination<'_>,
        refused: &[(usize, Miss, [bool; 2])],
    ) {
        let signals = &examination.setup.table.signals;
        let details: Vec<String> = refused
            .iter()
            .take(10)
            .map(|(index, miss, _)| {
                let pieces = self.pieces_of(examination, &signals[*index]);
                format!(
                    "\"{}\" at {}: the device {miss}",
                    signals[*index].name,
                    place(&pieces, 0)
                )
            })
            .collect();
        let is = |exception| {
            refused
                .iter()
                .all(|(_, miss, _)| *miss == Miss::Refused(exception))
        };
        let all = |side: usize| refused.iter().all(|(_, _, can)| can[side]);
        let (cause, next) = if is(Exception::ILLEGAL_FUNCTION) {
            (
                "function-refused",
                "the device does not have this table: place the signals in another one, such as \
                 \"holding-register:0\", in [fieldbus.at], \"inputs\" or \"outputs\"",
            )
        } else if all(0) || all(1) {
            (
                "off-by-one",
                if all(0) {
                    "one element lower each can be read: many manuals count from 1, and the wire counts from 0"
                } else {
                    "one element higher each can be read: the device counts from 1"
                },
            )
        } else {
            (
                "address-refused",
                "the device has no such elements: correct the addresses, or enlarge the area in the PLC",
            )
        };
        let evidence = format!(
            "{} of {} signals cannot be read",
            refused.len(),
            signals.len()
        );
        examination.fail("addresses", cause, evidence, next).details = details;
    }
}

/// Reads the pieces of a signal, moved by `shift` elements; `None` if they would leave the table.
fn read_shifted(
    talk: &mut Talk,
    unit: u8,
    pieces: &[Piece],
    shift: isize,
    bytes: usize,
) -> Option<Result<Vec<u8>, Miss>> {
    let mut receives = vec![0; bytes];
    for piece in pieces {
        let width = isize::try_from(piece.table.width()).ok()?;
        let wire = piece.wire.checked_add_signed(shift * width)?;
        let piece = Piece { wire, ..*piece };
        if piece.span().end() > crate::table::ADDRESSES {
            return None;
        }
        for request in super::queries(&[piece], &[], &super::Capabilities::new(false, 0)) {
            if let Err(miss) = talk.read(unit, &request, &mut receives) {
                return Some(Err(miss));
            }
        }
    }
    Some(Ok(receives))
}

/// The first element of a signal, moved by `shift` elements.
fn place(pieces: &[Piece], shift: isize) -> String {
    let first = pieces.first().and_then(|piece| {
        let offset = piece.span().first.checked_add_signed(shift)?;
        let table = piece.table;
        Some(ElementAddress { table, offset }.to_string())
    });
    first.unwrap_or_default()
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
    peer: &Peer,
    requests: &[(u8, Request)],
    pieces: &[(u8, Vec<Piece>)],
) -> Option<Round> {
    let begin = peer.now();
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
    let took: Nanos = peer.now() - begin;
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
