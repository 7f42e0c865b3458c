//! The data written to and read from a CPU, signal by signal.

use std::fmt::Write as _;

use super::ClientOptions;
use super::plan::{self, Field, Job, JobDirection};
use crate::item::Item;
use crate::length::LEAST;
use tickbus_fieldbus::Role;
use tickbus_image::signal::SignalTable;

/// The data written to and read from a CPU, and their places.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FrameFields {
    pub(super) written: Vec<Field>,
    pub(super) read: Vec<Field>,
    /// Sizes of each station's frames in bytes: the written one and the read one.
    pub(super) lengths: Vec<[usize; 2]>,
}

impl FrameFields {
    /// The frames of the end with `role`.
    pub fn new(options: &ClientOptions, table: &SignalTable, role: Role) -> Self {
        let (sends, receives) = role.areas();
        let fields = |area| {
            let signals = table.signals.iter().filter(|signal| signal.area == area);
            let field = |signal| {
                let variable = options.variable(signal)?;
                let (first, bits) = variable.bits();
                Some(Field {
                    station: signal.station,
                    frame: signal.byte * 8 + usize::from(signal.bit),
                    object: variable.object,
                    first,
                    bits,
                })
            };
            signals.filter_map(field).collect()
        };
        let stations = table.stations.iter();
        Self {
            written: fields(sends),
            read: fields(receives),
            lengths: stations
                .map(|station| [sends, receives].map(|area| station.bytes(area)))
                .collect(),
        }
    }

    /// True if any data of a station are written, and if any are read.
    pub(super) fn has(&self, station: usize) -> [bool; 2] {
        let any = |fields: &[Field]| fields.iter().any(|field| field.station == station);
        [any(&self.written), any(&self.read)]
    }

    /// The transfers of one cycle, for people: the items, and the number of jobs with PDUs of at most `longest` bytes
    /// and with the shortest possible ones.
    pub fn summary(&self, longest: u16) -> [String; 2] {
        let one = |way, fields: &[Field]| {
            let jobs = |limit: u16| plan::jobs(way, fields, usize::from(limit));
            let (few, many) = (jobs(longest), jobs(LEAST));
            if few.is_empty() {
                return "nothing".to_owned();
            }
            let count = |jobs: &[Job]| match jobs.len() {
                1 => "1 job".to_owned(),
                count => format!("{count} jobs"),
            };
            let mut text = items(&few);
            // Writing to a string cannot fail.
            let _ = write!(text, "; {} a cycle", count(&few));
            if few.len() != many.len() {
                let many = count(&many);
                let _ = write!(text, " with units of {longest} bytes, {many} with {LEAST}");
            }
            text
        };
        [
            one(JobDirection::Write, &self.written),
            one(JobDirection::Read, &self.read),
        ]
    }
}

impl ClientOptions {
    /// The transfers of one cycle, for people.
    pub fn shown_requests(&self, table: &SignalTable) -> Vec<String> {
        let frames = FrameFields::new(self, table, self.role);
        let writes = match (self.role, &self.write_to) {
            (_, Some(_)) | (Role::Observer, _) => "writes",
            (_, None) => "would write",
        };
        let ways = [writes, "reads"].into_iter();
        ways.zip(frames.summary(self.pdu))
            .map(|(way, what)| format!("{way} {what}"))
            .collect()
    }
}

/// Items as text, adjacent ones merged: `DB11 bytes 0 to 3 and 8, bits 4.0 and 4.3; %M bit 0.1`.
fn items(jobs: &[Job]) -> String {
    let pieces = jobs.iter().flat_map(|job| &job.pieces);
    let mut all: Vec<Item> = pieces.map(|piece| piece.item).collect();
    all.sort_by_key(|item| (item.object, item.bit().is_some(), item.byte, item.bit));
    let of_object = |items: &[Item]| {
        let kind = |items: &[Item]| {
            let each: Vec<String> = items.iter().map(span).collect();
            let is_one = items.len() == 1 && items[0].range().len() == 1;
            let word = match (items[0].bit(), is_one) {
                (Some(_), true) => "bit",
                (Some(_), false) => "bits",
                (None, true) => "byte",
                (None, false) => "bytes",
            };
            format!("{word} {}", listed(&each))
        };
        let kinds = items.chunk_by(|a, b| a.bit().is_some() == b.bit().is_some());
        let kinds: Vec<String> = kinds.map(kind).collect();
        format!("{} {}", items[0].object, kinds.join(", "))
    };
    let objects = all.chunk_by(|a, b| a.object == b.object);
    objects.map(of_object).collect::<Vec<_>>().join("; ")
}

fn span(item: &Item) -> String {
    let range = item.range();
    match (item.bit(), range.len()) {
        (Some(bit), _) => format!("{}.{bit}", item.byte),
        (None, 1) => format!("{}", item.byte),
        (None, _) => format!("{} to {}", range.start, range.end - 1),
    }
}

fn listed(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
