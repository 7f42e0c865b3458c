//! The steps `addresses` and `values`: each signal's elements, and those beside them.

use tickbus_fieldbus::examine::{Examination, Neighbours};

use super::super::{Capabilities, ClientOptions, queries};
use super::ask::{Miss, Talk};
use crate::{ElementAddress, Exception, Piece};

/// The most requests for single signals: a table of thousands is not read element by element.
const SINGLES: usize = 200;

impl ClientOptions {
    /// The steps `addresses` and `values`. False if the device refuses everything.
    pub(super) fn read_each(&self, examination: &mut Examination<'_>, talk: &mut Talk) -> bool {
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
        let all = count.min(SINGLES);
        let is_dead = count > 0 && refused.len() == all;
        // Elements that a program writes need not be readable.
        let written;
        (written, refused) = refused.into_iter().partition(|(index, miss, _)| {
            let signal = &examination.setup.table.signals[*index];
            !examination.is_read(signal) && matches!(miss, Miss::Refused(_))
        });
        if !written.is_empty() {
            self.tell_write_only(examination, &written);
        }
        if refused.is_empty() && written.is_empty() {
            let rest = if count > SINGLES {
                format!("; the first {SINGLES} were read one by one")
            } else {
                String::new()
            };
            examination.ok("addresses", format!("all signals can be read{rest}"));
        } else if !refused.is_empty() {
            self.tell_refused(examination, &refused);
        }
        examination.judge_values(&values);
        !is_dead
    }

    /// Reports signals that this end writes and cannot read.
    fn tell_write_only(
        &self,
        examination: &mut Examination<'_>,
        written: &[(usize, Miss, [bool; 2])],
    ) {
        let evidence = format!(
            "{} signals that the driver writes cannot be read: their elements can only be written, or do not exist",
            written.len()
        );
        let next = "compare their addresses with the PLC's own list: only a write shows whether they exist";
        let details = self.refusals(examination, written);
        examination
            .warn("addresses", "write-only", evidence, next)
            .details = details;
    }

    /// The refused signals, one line each, and not too many.
    fn refusals(
        &self,
        examination: &Examination<'_>,
        refused: &[(usize, Miss, [bool; 2])],
    ) -> Vec<String> {
        let signals = &examination.setup.table.signals;
        let shown = refused.iter().take(10).map(|(index, miss, _)| {
            let pieces = self.pieces_of(examination, &signals[*index]);
            let (name, place) = (&signals[*index].name, place(&pieces, 0));
            format!("\"{name}\" at {place}: the device {miss}")
        });
        shown.collect()
    }

    fn tell_refused(
        &self,
        examination: &mut Examination<'_>,
        refused: &[(usize, Miss, [bool; 2])],
    ) {
        let signals = &examination.setup.table.signals;
        let details = self.refusals(examination, refused);
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
        for request in queries(&[piece], &[], &Capabilities::new(false, 0)) {
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
