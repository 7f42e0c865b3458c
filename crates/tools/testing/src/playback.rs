//! A recording in place of the machine: the sensors show their recorded values.

use std::path::{Path, PathBuf};

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{nearest, shown};
use tickbus_image::signal::{Area, Signal, SignalTable, Slot};
use tickbus_record::{Recording, RecordingError, Tape, ValueKind};

use super::test::TextPosition;

/// A recording that fits a signal table.
#[derive(Clone, Debug)]
pub(super) struct MachineRecording {
    file: PathBuf,
    /// Column and signal of each value that the machine sent.
    sent: Vec<(usize, usize)>,
    /// Column and signal of each value that the PLC must send as recorded.
    compared: Vec<(usize, usize)>,
    /// The recording's position in the test file.
    pub(super) place: TextPosition,
}

impl MachineRecording {
    /// Opens the recording at `file`, which must contain signals of `table`; `own` is the area that the
    /// machine writes.
    pub(super) fn open(
        file: &Path,
        table: &SignalTable,
        own: Area,
        place: TextPosition,
    ) -> Result<Self, Mistake> {
        let recording = Recording::open(file, Some(table)).map_err(|error| {
            let Mistake { what, right } = error.mistake;
            Mistake::new(format!("{}: {what}", file.display()), right)
        })?;
        let mut sent = Vec::new();
        for (index, signal) in table.signals.iter().enumerate() {
            if signal.area == own
                && let Some(column) = recording.columns().of_signal(signal)?
            {
                sent.push((column, index));
            }
        }
        if sent.is_empty() {
            return Err(Mistake::new(
                format!("{} has no signal that the PLC reads", file.display()),
                "use a recording of a driver with this signal table",
            ));
        }
        Ok(Self {
            file: file.to_owned(),
            sent,
            compared: Vec::new(),
            place,
        })
    }

    /// Adds a signal that the PLC must send as recorded.
    pub(super) fn compare(&mut self, index: usize, table: &SignalTable) -> Result<(), Mistake> {
        let signal = &table.signals[index];
        let recording = Recording::open(&self.file, Some(table)).map_err(|error| error.mistake)?;
        let Some(column) = recording.columns().of_signal(signal)? else {
            let names = recording.columns().columns.iter();
            let near = nearest(&signal.name, names.map(|column| column.name.as_str()));
            let right = near.map_or_else(
                || "compare signals that were recorded".to_owned(),
                |near| format!("it has \"{near}\""),
            );
            return Err(Mistake::new(
                format!("the recording has no \"{}\"", shown(&signal.name)),
                right,
            ));
        };
        self.compared.push((column, index));
        Ok(())
    }

    /// The name of the recording's file, for messages.
    pub(super) fn name(&self) -> String {
        self.file.display().to_string()
    }
}

pub(super) fn kind(signal: &Signal) -> ValueKind {
    ValueKind::of(signal.data_type, signal.scale.is_some())
}

/// A signal that differs from the recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Difference {
    pub(super) signal: usize,
    pub(super) expected: Slot,
    /// The number of the recorded tick.
    pub(super) tick: u64,
}

/// A recording that is being played.
#[derive(Debug)]
pub(super) struct Playback<'a> {
    of: &'a MachineRecording,
    tape: Tape,
    /// True if a recorded tick was applied in this tick.
    taken: bool,
}

impl<'a> Playback<'a> {
    pub(super) fn start(
        of: &'a MachineRecording,
        table: &SignalTable,
    ) -> Result<Self, RecordingError> {
        let tape = Tape::start(Recording::open(&of.file, Some(table))?)?;
        let taken = false;
        Ok(Self { of, tape, taken })
    }

    /// One tick that ends at `now`: sets the sensors. The first call applies the first recorded tick.
    pub(super) fn step(&mut self, now: Nanos, slots: &mut [Slot]) -> Result<(), RecordingError> {
        self.taken = false;
        while self.tape.take(now) {
            self.taken = true;
        }
        if let Some(broken) = self.tape.broken() {
            return Err(broken.clone());
        }
        if self.taken {
            for (column, signal) in &self.of.sent {
                slots[*signal] = self.tape.present().values[*column];
            }
        }
        Ok(())
    }

    /// The first signal for which the PLC's value differs from the recording.
    pub(super) fn difference(&self, slots: &[Slot], signals: &[Signal]) -> Option<Difference> {
        if !self.taken {
            return None;
        }
        let differs = |(column, signal): &&(usize, usize)| {
            let kept = kind(&signals[*signal]).kept(slots[*signal]);
            kept != self.tape.present().values[*column]
        };
        let (column, signal) = self.of.compared.iter().find(differs)?;
        Some(Difference {
            signal: *signal,
            expected: self.tape.present().values[*column],
            tick: self.tape.present().number,
        })
    }
}
