//! Recordings of a run: the values that are read in each step.
//!
//! A row has the number and the time of a step, and what all clients can read in it: the first one has the initial
//! values, and the row of step *n* + 1 those written in step *n*. The last row has the values at the end of the run.
//! A variable's station is the client that writes it; variables of the server's logic have none. The last column is the
//! trace hash in the first row, in every thousandth, and in the last one of a run whose length is known; in between it
//! stays the same, because it would double the file.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use tickbus_base::time::{Clock, Nanos};
use tickbus_image::signal::{DataType, Slot};
use tickbus_record::{
    Column, Columns, MOST_COLUMNS, Options, Recorder, RecorderCounters, RecorderError,
};

use crate::members::Members;
use crate::{Logic, slot_of};

/// The role in the header of these recordings.
pub(crate) const ROLE: &str = "sync";

/// The name of the last column.
pub(crate) const HASH: &str = "trace hash";

/// How many rows have the same trace hash.
pub(crate) const BLOCK: u64 = 1000;

/// A run that is recorded. The file is complete when the server's logic has been dropped.
#[derive(Clone, Debug, Default)]
pub struct RecordedRun(Arc<OnceLock<Arc<RecorderCounters>>>);

impl RecordedRun {
    /// Lets `logic` record its run of `steps` steps, if they are known, to the file of `options`, under the name `run`.
    /// The run waits for the file: no step is left out. The file changes when the run starts.
    ///
    /// # Errors
    ///
    /// The file cannot be created, or is in use.
    pub fn attach<'l>(
        logic: Logic<'l>,
        options: &Options,
        run: &str,
        steps: Option<u64>,
        clock: &Arc<dyn Clock>,
    ) -> Result<(Logic<'l>, Self), RecorderError> {
        // Reported now, and not when all clients have joined.
        let is_new = options.file.symlink_metadata().is_err();
        drop(Recorder::claim(&options.file)?);
        if is_new {
            let _ = std::fs::remove_file(&options.file);
        }
        let recorded = Self::default();
        let counters = Arc::clone(&recorded.0);
        let (options, run, clock) = (options.clone(), run.to_owned(), Arc::clone(clock));
        let mut recorder = None;
        let logic = logic.on_commit(move |commit| {
            let (recorder, slots) = match &mut recorder {
                Some(begun) => begun,
                none => {
                    let begun = begin(&options, &run, commit.members(), &clock)?;
                    let _ = counters.set(Arc::clone(begun.0.counters()));
                    none.insert(begun)
                }
            };
            let step = commit.step();
            let variables = commit.members().variables.iter();
            for ((slot, variable), value) in slots.iter_mut().zip(variables).zip(commit.values()) {
                *slot = slot_of(variable.data_type, *value);
            }
            if step.sequence % BLOCK == 0 || Some(step.sequence) == steps {
                *slots.last_mut().expect("the hash") = Slot::from_unsigned(commit.hash().0);
            }
            let time = Nanos(step.time.0.saturating_add(commit.length().0));
            recorder.record(step.sequence + 1, time, 0, std::iter::empty(), slots);
            Ok(())
        });
        Ok((logic, recorded))
    }

    /// Why the recording ended before the run, if so.
    pub fn error(&self) -> Option<String> {
        self.0.get().and_then(|counters| counters.error())
    }
}

fn begin(
    options: &Options,
    run: &str,
    members: &Members,
    clock: &Arc<dyn Clock>,
) -> Result<(Recorder, Vec<Slot>), String> {
    let columns = columns(run, members);
    let count = columns.columns.len();
    if count > MOST_COLUMNS {
        return Err(format!(
            "the run cannot be recorded: it has {} variables, and a recording has {} at most",
            count - 1,
            MOST_COLUMNS - 1
        ));
    }
    let recorder = Recorder::start(options, Path::new(""), columns.into(), true, clock);
    let recorder = recorder.map_err(|error| format!("the run cannot be recorded: {error}"))?;
    Ok((recorder, vec![Slot::default(); count]))
}

fn columns(run: &str, members: &Members) -> Columns {
    let column = |name: &str, data_type, station: &str| {
        Column::plain(name.to_owned(), data_type, station.to_owned())
    };
    let variables = members.variables.iter().enumerate().map(|(at, variable)| {
        let writer = members.clients.get(members.writer(at));
        let station = writer.map_or("", |client| &client.name);
        column(&variable.name, variable.data_type, station)
    });
    let hash = column(HASH, DataType::Lword, "");
    Columns {
        driver: run.to_owned(),
        role: ROLE.to_owned(),
        stations: Vec::new(),
        columns: variables.chain([hash]).collect(),
    }
}
