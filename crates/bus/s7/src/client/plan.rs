//! Plans the jobs of a cycle: as few as the negotiated PDU length permits.
//!
//! A read may include bytes between signals. A write covers exactly the bits of signals: a byte that signals cover only
//! in part is written bit by bit, each bit a separate item.

use std::ops::Range;

use tickbus_fieldbus::copy_bits;

use crate::item::{self, Item, Object};
use crate::pdu;

/// The most items per job that every CPU accepts.
const ITEMS: usize = 20;

/// Bytes before the items of a job and of an answer: header, function, number of items.
const JOB: usize = pdu::JOB_HEADER + 2;
const ANSWER: usize = pdu::ANSWER_HEADER + 2;

/// Gaps, in bytes, that may be read over. The first costs less than a separate item; the longer ones are used if that
/// saves a job.
const GAPS: [usize; 4] = [item::DATA_HEADER, 16, 64, 128];

/// The direction of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum JobDirection {
    Write,
    Read,
}

/// A signal: its place in its station's frame, and in the CPU, in bits. Signals of more than one bit occupy
/// whole bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Field {
    pub(super) station: usize,
    pub(super) frame: usize,
    pub(super) object: Object,
    pub(super) first: usize,
    pub(super) bits: usize,
}

/// One job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Job {
    pub(super) way: JobDirection,
    pub(super) pieces: Vec<Piece>,
}

/// One item of a job, and the bits of a station's frame in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    pub(super) station: usize,
    pub(super) item: Item,
    runs: Vec<Run>,
}

/// Consecutive bits, in the frame and in the data of an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    frame: usize,
    data: usize,
    bits: usize,
}

impl Piece {
    /// Fills the item's `data` from a frame.
    pub(super) fn gather(&self, frame: &[u8], data: &mut [u8]) {
        for run in &self.runs {
            copy_bits(frame, run.frame, run.bits, data, run.data);
        }
    }

    /// Copies the item's `data` into a frame.
    pub(super) fn scatter(&self, data: &[u8], frame: &mut [u8]) {
        for run in &self.runs {
            copy_bits(data, run.data, run.bits, frame, run.frame);
        }
    }
}

/// An indivisible unit: the bytes of a value, or of adjacent BOOLs, or one bit.
struct Cell {
    station: usize,
    object: Object,
    bytes: Range<usize>,
    bit: Option<u8>,
    fields: Vec<Field>,
}

/// The jobs that transfer `fields`; neither a job nor its answer is longer than `limit`.
pub(super) fn jobs(way: JobDirection, fields: &[Field], limit: usize) -> Vec<Job> {
    let cells = cells(way, fields);
    let plan = |gap| pack(way, pieces(way, &cells, gap, limit), limit);
    match way {
        JobDirection::Write => plan(0),
        JobDirection::Read => {
            let plans = GAPS.map(plan).into_iter();
            plans.min_by_key(Vec::len).unwrap_or_default()
        }
    }
}

fn cells(way: JobDirection, fields: &[Field]) -> Vec<Cell> {
    let mut sorted = fields.to_vec();
    // Keeps the BOOLs of a byte adjacent, even if the byte is also part of a word.
    sorted.sort_by_key(|field| {
        let Field { first, bits, .. } = *field;
        (field.station, field.object, first / 8, bits > 1, first)
    });
    let same = |a: &Field, b: &Field| {
        let byte = |field: &Field| (field.station, field.object, field.first / 8);
        (a.bits, b.bits) == (1, 1) && byte(a) == byte(b)
    };
    let mut cells = Vec::new();
    for group in sorted.chunk_by(same) {
        let [Field { first, bits, .. }, ..] = *group else {
            continue;
        };
        let cell = |fields: &[Field], bit| Cell {
            station: fields[0].station,
            object: fields[0].object,
            bytes: first / 8..first / 8 + bits.div_ceil(8),
            bit,
            fields: fields.to_vec(),
        };
        let covered = group
            .iter()
            .fold(0, |bits, field| bits | 1 << (field.first % 8));
        if way == JobDirection::Read || bits > 1 || covered == 0xFF_u32 {
            cells.push(cell(group, None));
        } else {
            let one = |field: &Field| {
                let bit = u8::try_from(field.first % 8).expect("below 8");
                cell(std::slice::from_ref(field), Some(bit))
            };
            cells.extend(group.iter().map(one));
        }
    }
    cells
}

/// Adjacent cells, or cells with a gap of at most `gap` bytes, become one item.
fn pieces(way: JobDirection, cells: &[Cell], gap: usize, limit: usize) -> Vec<Piece> {
    let room = room(way, [JOB, ANSWER], limit);
    let mut pieces: Vec<Piece> = Vec::new();
    for cell in cells {
        let open = pieces.last_mut().filter(|piece| {
            let range = piece.item.range();
            (piece.station, piece.item.object, piece.item.bit())
                == (cell.station, cell.object, None)
                && cell.bit.is_none()
                && cell.bytes.start <= range.end + gap
                && cell.bytes.end.max(range.end) - range.start <= room
        });
        let piece = if let Some(piece) = open {
            let range = piece.item.range();
            piece.item = Item::bytes(cell.object, range.start..range.end.max(cell.bytes.end));
            piece
        } else {
            pieces.push(Piece {
                station: cell.station,
                item: match cell.bit {
                    Some(bit) => Item::bit_of(cell.object, cell.bytes.start, bit),
                    None => Item::bytes(cell.object, cell.bytes.clone()),
                },
                runs: Vec::new(),
            });
            pieces.last_mut().expect("it was pushed")
        };
        // The data of a bit are one byte, with the bit as its lowest.
        let begin = piece.item.byte * 8 + usize::from(piece.item.bit);
        for field in &cell.fields {
            let run = Run {
                frame: field.frame,
                data: field.first - begin,
                bits: field.bits,
            };
            match piece.runs.last_mut() {
                Some(last) if last.is_followed_by(run) => last.bits += run.bits,
                _ => piece.runs.push(run),
            }
        }
    }
    pieces
}

impl Run {
    /// True if both form one run of whole bytes.
    const fn is_followed_by(self, next: Self) -> bool {
        self.bits > 1
            && next.bits > 1
            && self.frame + self.bits == next.frame
            && self.data + self.bits == next.data
    }
}

/// Puts each piece into the first job that has room for it.
fn pack(way: JobDirection, pieces: Vec<Piece>, limit: usize) -> Vec<Job> {
    // Each with its length and the length of its answer.
    let mut jobs: Vec<(Job, [usize; 2])> = Vec::new();
    for piece in pieces {
        let bytes = piece.item.range().len();
        let has_room = |(job, lengths): &(Job, [usize; 2])| {
            job.pieces.len() < ITEMS && bytes <= room(way, *lengths, limit)
        };
        let open = jobs.iter().position(has_room);
        let index = open.unwrap_or(jobs.len());
        if index == jobs.len() {
            let pieces = Vec::new();
            jobs.push((Job { way, pieces }, [JOB, ANSWER]));
        }
        let (job, lengths) = &mut jobs[index];
        let data = item::DATA_HEADER + bytes.next_multiple_of(2);
        let [job_length, answer] = lengths;
        *job_length += item::ADDRESS;
        match way {
            JobDirection::Write => (*job_length, *answer) = (*job_length + data, *answer + 1),
            JobDirection::Read => *answer += data,
        }
        job.pieces.push(piece);
    }
    jobs.into_iter().map(|(job, _)| job).collect()
}

/// The most data bytes that one more item of a job can have.
fn room(way: JobDirection, [job, answer]: [usize; 2], limit: usize) -> usize {
    let room = match way {
        JobDirection::Write => limit.saturating_sub(job + item::ADDRESS + item::DATA_HEADER),
        JobDirection::Read if job + item::ADDRESS > limit => 0,
        JobDirection::Read => limit.saturating_sub(answer + item::DATA_HEADER),
    };
    // Data of odd length are padded.
    room / 2 * 2
}

#[cfg(test)]
mod tests;
