//! Where two recorded runs part.

use std::path::Path;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::{DataType, Slot};
use tickbus_record::{Column, Format, Recording, RecordingError, Tick, ValueKind};

use crate::TraceHash;
use crate::recording::{BLOCK, HASH, ROLE};

/// Two recorded runs, compared up to the first step in which they differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compared {
    /// The differences of their variables, as lines for people. Such runs are not equal; their common variables are
    /// compared.
    pub declared: Vec<String>,
    /// Remarks on the files.
    pub notes: Vec<String>,
    /// The number of steps that both have, with equal values.
    pub steps: u64,
    /// The trace hash at the end of these steps, if the recordings have it.
    pub hash: Option<TraceHash>,
    /// The first difference.
    pub parting: Option<Parting>,
}

/// The first difference of two runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Parting {
    /// The values that were written in a step.
    Values {
        /// The step; 0 for the initial values.
        step: u64,
        /// The virtual time of this step.
        time: Nanos,
        /// The variables that differ, in the order of the first recording; at least one.
        differences: Vec<Difference>,
    },
    /// The first (0) or the second recording (1) ends before the other one, after this number of steps.
    End {
        /// The shorter recording.
        shorter: usize,
        /// The number of its steps.
        steps: u64,
    },
    /// Neither recording was closed, and both end after this number of steps, equal so far: whether the runs part later is
    /// unknown.
    Cut {
        /// The number of steps.
        steps: u64,
    },
    /// All values that both have are equal, and the trace hashes are not: there are other clients, or they have other
    /// multiples or another order, or values are NaN with other bits, which a recording does not keep.
    Hash {
        /// The first step with other hashes.
        step: u64,
    },
}

/// A variable that differs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The variable.
    pub variable: String,
    /// The client that writes it; `None` for the server's logic.
    pub client: Option<String>,
    /// The values in the two recordings.
    pub values: [String; 2],
}

/// Compares two recordings that `tickbus sync --record` has made.
///
/// # Errors
///
/// A file cannot be read or is no such recording, or the runs have no variable or another step in common.
pub fn compare(paths: [&Path; 2]) -> Result<Compared, RecordingError> {
    let [mut a, mut b] = [Side::open(paths[0])?, Side::open(paths[1])?];
    let mut are_over;
    let mut declared = Vec::new();
    let common = common(&a, &b, &mut declared);
    if common.is_empty() {
        return Err(RecordingError::of_file(
            paths[1],
            format!(
                "this run has no variable in common with {}",
                paths[0].display()
            ),
            "compare recordings of the same clients",
        ));
    }
    let mut compared = Compared {
        declared,
        notes: Vec::new(),
        steps: 0,
        hash: None,
        parting: None,
    };
    let mut time = None;
    // The first step with equal values and other hashes. Values, or the times of steps, may part later.
    let mut unequal = None;
    // The hash of the last row that has one in any case.
    let mut block = TraceHash(0);
    loop {
        let more = [a.next()?, b.next()?];
        are_over = more.map(|more| !more);
        // The first row has the initial values.
        let step = a.tick.number.max(b.tick.number).saturating_sub(1);
        if more != [true, true] {
            for (side, path) in [&a, &b].into_iter().zip(paths) {
                if side.tick.number == 0 {
                    return Err(RecordingError::of_file(
                        path,
                        "this recording has not even the initial values",
                        "record again",
                    ));
                }
            }
            let steps = compared.steps;
            if more[0] != more[1] {
                let shorter = usize::from(more[0]);
                compared.parting = Some(Parting::End { shorter, steps });
            } else if compared.declared.is_empty() && compared.hash.is_none() && unequal.is_none() {
                // A run that was stopped has no hash in its last row.
                let ends =
                    [a.hash(), b.hash()].map(|hash| Some(hash).filter(|hash| *hash != block));
                compared.hash = ends[0].or(ends[1]);
                if ends[0].zip(ends[1]).is_some_and(|(one, two)| one != two) {
                    compared.parting = Some(Parting::Hash { step: steps });
                }
            }
            if let Some(step) = unequal {
                compared.parting = Some(Parting::Hash { step });
            }
            break;
        }
        check_times(&a, &b, paths)?;
        let differences = differences(&a, &b, &common);
        let hashes = [a.hash(), b.hash()];
        if !differences.is_empty() {
            // Step n runs at the time at which the values of the step before it are read.
            let time = time.unwrap_or(Nanos::ZERO);
            if let Some(from) = unequal {
                compared.notes.push(format!(
                    "the trace hashes differ from step {from} on: there are other clients, multiples or orders, \
                     or a NaN has other bits"
                ));
            }
            compared.parting = Some(Parting::Values {
                step,
                time,
                differences,
            });
            break;
        }
        compared.steps = step;
        if step % BLOCK == 0 && compared.declared.is_empty() {
            if hashes[0] == hashes[1] {
                block = hashes[0];
                compared.hash = Some(block);
            } else {
                unequal.get_or_insert(step);
                compared.hash = None;
            }
        } else {
            compared.hash = None;
        }
        time = Some(a.tick.time);
    }
    // A recording that was closed has its counts; one whose disk was full says so.
    let is_closed = |side: &Side| side.recording.ending().starts_with("ticks=");
    if compared.parting.is_none() && !is_closed(&a) && !is_closed(&b) {
        let steps = compared.steps;
        compared.parting = Some(Parting::Cut { steps });
    }
    for ((side, path), is_over) in [&a, &b].into_iter().zip(paths).zip(are_over) {
        let ending = side.recording.ending();
        if is_over && !is_closed(side) {
            compared.notes.push(format!("{}: {ending}", path.display()));
        }
    }
    Ok(compared)
}

/// Checks that the current rows have the same number and time.
fn check_times(a: &Side, b: &Side, paths: [&Path; 2]) -> Result<(), RecordingError> {
    if (a.tick.number, a.tick.time) == (b.tick.number, b.tick.time) {
        return Ok(());
    }
    let Tick { number, time, .. } = b.tick;
    Err(RecordingError::of_file(
        paths[1],
        format!(
            "row {number} is at {time}, and in {} row {} is at {}",
            paths[0].display(),
            a.tick.number,
            a.tick.time
        ),
        "compare runs with the same step",
    ))
}

/// The variables that differ in the current rows; `common` has the columns of each in both.
fn differences(a: &Side, b: &Side, common: &[(usize, usize)]) -> Vec<Difference> {
    let differs = |(one, two): &&(usize, usize)| a.tick.values[*one] != b.tick.values[*two];
    let differences = common.iter().filter(differs).map(|(one, two)| {
        let column = &a.columns()[*one];
        Difference {
            variable: column.name.clone(),
            client: Some(column.station.clone()).filter(|client| !client.is_empty()),
            values: [(a, *one), (b, *two)]
                .map(|(side, at)| text(&side.columns()[at], side.tick.values[at])),
        }
    });
    differences.collect()
}

/// A recording and its current row.
struct Side {
    recording: Recording,
    tick: Tick,
}

impl Side {
    fn open(path: &Path) -> Result<Self, RecordingError> {
        if Format::of(path) == Ok(Format::Csv) {
            return Err(RecordingError::of_file(
                path,
                "a CSV file does not name the clients of a run",
                "record the run to a file that ends in .vcd",
            ));
        }
        let recording = Recording::open(path, None)?;
        let columns = recording.columns();
        let has_hash = columns.columns.last().is_some_and(|column| {
            column.name == HASH && column.station.is_empty() && column.kind == ValueKind::Unsigned
        });
        if columns.role != ROLE || !has_hash {
            return Err(RecordingError::of_file(
                path,
                "this is no recording of a run on virtual time",
                "make one by tickbus sync --record; tickbus compare is for recordings of drivers",
            ));
        }
        let tick = Tick::new(columns);
        Ok(Self { recording, tick })
    }

    /// The variables, without the trace hash.
    fn columns(&self) -> &[Column] {
        let columns = &self.recording.columns().columns;
        &columns[..columns.len() - 1]
    }

    fn hash(&self) -> TraceHash {
        let hash = self.tick.values.last().expect("it has the hash");
        TraceHash(hash.unsigned())
    }

    fn next(&mut self) -> Result<bool, RecordingError> {
        self.recording.next(&mut self.tick)
    }
}

/// The places of the variables that both have in the same way; `declared` gets the others.
fn common(a: &Side, b: &Side, declared: &mut Vec<String>) -> Vec<(usize, usize)> {
    use std::collections::HashMap;

    let by_name = |side: &Side| -> HashMap<String, usize> {
        let columns = side.columns().iter().enumerate();
        columns
            .map(|(at, column)| (column.name.clone(), at))
            .collect()
    };
    let (in_a, in_b) = (by_name(a), by_name(b));
    let mut common = Vec::new();
    for (at, column) in a.columns().iter().enumerate() {
        let name = shown(&column.name);
        let Some(other) = in_b.get(&column.name) else {
            declared.push(format!(
                "the variable \"{name}\" of {} is in the first run alone",
                writer(column)
            ));
            continue;
        };
        let there = &b.columns()[*other];
        if column.data_type != there.data_type {
            declared.push(format!(
                "the variable \"{name}\" is of type {} in the first run, and of type {} in the second",
                type_of(column),
                type_of(there)
            ));
            continue;
        }
        if column.station != there.station {
            declared.push(format!(
                "the variable \"{name}\" is written by {} in the first run, and by {} in the second",
                writer(column),
                writer(there)
            ));
        }
        common.push((at, *other));
    }
    for column in b.columns() {
        if !in_a.contains_key(&column.name) {
            declared.push(format!(
                "the variable \"{}\" of {} is in the second run alone",
                shown(&column.name),
                writer(column)
            ));
        }
    }
    common
}

fn writer(column: &Column) -> String {
    match &*column.station {
        "" => "the server's logic".to_owned(),
        client => format!("client \"{}\"", shown(client)),
    }
}

fn type_of(column: &Column) -> &'static str {
    column.data_type.map_or("unknown", DataType::name)
}

/// A value for people, exact.
fn text(column: &Column, slot: Slot) -> String {
    match (column.kind, column.data_type) {
        (ValueKind::Signed, _) => slot.signed().to_string(),
        (ValueKind::Unsigned, _) => slot.unsigned().to_string(),
        (_, Some(DataType::Real)) => {
            #[expect(clippy::cast_possible_truncation, reason = "made from a REAL")]
            let value = slot.real() as f32;
            value.to_string()
        }
        _ => slot.real().to_string(),
    }
}
