//! The frames of all stations, and the jobs that transfer them.

use super::plan::{self, Field, Job, JobDirection, Piece};
use super::{FrameFields, Refusal};
use crate::item::{self, ReturnCode};
use crate::pdu::function;

/// The frames of all stations, and the jobs that transfer them.
#[derive(Debug)]
pub(super) struct Traffic {
    fields: FrameFields,
    pub(super) jobs: Vec<Job>,
    /// The frames of this cycle by station: those to be written, and those read.
    pub(super) out: Vec<Box<[u8]>>,
    pub(super) into: Vec<Box<[u8]>>,
    /// The CPU's refusals in this cycle, by station.
    pub(super) refused: Vec<Option<Refusal>>,
    /// Stations that are excluded from the cycles.
    pub(super) suspended: Vec<bool>,
    pub(super) may_write: bool,
    /// Each job has one item: the CPU answers only the first of several.
    pub(super) one_by_one: bool,
}

impl Traffic {
    pub(super) fn new(fields: FrameFields) -> Self {
        let frames = |side: usize| {
            let lengths = fields.lengths.iter();
            lengths.map(|length| vec![0; length[side]].into()).collect()
        };
        let stations = fields.lengths.len();
        Self {
            out: frames(0),
            into: frames(1),
            refused: vec![None; stations],
            suspended: vec![false; stations],
            jobs: Vec::new(),
            may_write: false,
            one_by_one: false,
            fields,
        }
    }

    /// Plans the jobs, with PDUs of at most `limit` bytes.
    pub(super) fn plan(&mut self, limit: usize) {
        let active = |fields: &[Field]| -> Vec<Field> {
            let fields = fields.iter();
            let fields = fields.filter(|field| !self.suspended[field.station]);
            fields.copied().collect()
        };
        let mut jobs = Vec::new();
        if self.may_write {
            jobs = plan::jobs(JobDirection::Write, &active(&self.fields.written), limit);
        }
        jobs.extend(plan::jobs(
            JobDirection::Read,
            &active(&self.fields.read),
            limit,
        ));
        if self.one_by_one {
            let each = |Job { way, pieces }: Job| {
                let pieces = pieces.into_iter();
                pieces.map(move |piece| Job {
                    way,
                    pieces: vec![piece],
                })
            };
            jobs = jobs.into_iter().flat_map(each).collect();
        }
        self.jobs = jobs;
    }

    /// Records the CPU's answer to a piece; returns whether it was accepted.
    pub(super) fn judge(&mut self, job: usize, piece: usize, code: ReturnCode) -> bool {
        let Job { way, pieces } = &self.jobs[job];
        let piece = &pieces[piece];
        if code != ReturnCode::OK {
            let refusal = Refusal::item(*way, piece.item, code);
            self.refused[piece.station].get_or_insert(refusal);
        }
        code == ReturnCode::OK
    }
}

/// The function of a job, and the number of its items.
pub(super) fn function_of(way: JobDirection, pieces: &[Piece]) -> [u8; 2] {
    let code = match way {
        JobDirection::Write => function::WRITE,
        JobDirection::Read => function::READ,
    };
    [code, u8::try_from(pieces.len()).expect("20 at most")]
}

/// Appends the data of these items, taken from the frames.
pub(super) fn write_data(pieces: &[Piece], frames: &[Box<[u8]>], out: &mut Vec<u8>) {
    let begin = out.len();
    for piece in pieces {
        if (out.len() - begin) % 2 == 1 {
            out.push(0);
        }
        let length = piece.item.range().len();
        item::write_header(ReturnCode(0), piece.item.element, length, out);
        let data = out.len();
        out.resize(data + length, 0);
        piece.gather(&frames[piece.station], &mut out[data..]);
    }
}
