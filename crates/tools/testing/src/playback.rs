//! A recording in place of the machine: the sensors show their recorded values.

use std::path::{Path, PathBuf};

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{nearest, shown};
use tickbus_image::signal::{Area, Signal, SignalTable, Slot};
use tickbus_record::{Recording, RecordingError, Tick, ValueKind};

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
                && let Some(column) = column(&recording, signal)?
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
        let Some(column) = column(&recording, signal)? else {
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

/// The column of a signal, if the recording has one of the same kind.
pub(super) fn column(recording: &Recording, signal: &Signal) -> Result<Option<usize>, Mistake> {
    let columns = recording.columns();
    let Some(index) = columns.position(&signal.name, false) else {
        return Ok(None);
    };
    let column = &columns.columns[index];
    let moved = column.address.is_some_and(|was| was.area != signal.area);
    if moved || column.kind != kind(signal) {
        return Err(Mistake::new(
            format!(
                "\"{}\" ({} {}) is another signal in this recording",
                shown(&signal.name),
                signal.address(),
                signal.data_type
            ),
            "use a recording of a driver with this signal table",
        ));
    }
    Ok(Some(index))
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
    tape: &'a MachineRecording,
    recording: Recording,
    next: Tick,
    more: bool,
    present: Tick,
    /// True if a recorded tick was applied in this tick.
    taken: bool,
    offset: Option<Nanos>,
}

impl<'a> Playback<'a> {
    pub(super) fn start(
        tape: &'a MachineRecording,
        table: &SignalTable,
    ) -> Result<Self, RecordingError> {
        let mut recording = Recording::open(&tape.file, Some(table))?;
        let mut next = Tick::new(recording.columns());
        let more = recording.next(&mut next)?;
        Ok(Self {
            tape,
            present: next.clone(),
            recording,
            next,
            more,
            taken: false,
            offset: None,
        })
    }

    /// One tick that ends at `now`: sets the sensors. The first call applies the first recorded tick.
    pub(super) fn step(&mut self, now: Nanos, slots: &mut [Slot]) -> Result<(), RecordingError> {
        let offset = *self.offset.get_or_insert(now - self.next.time);
        self.taken = false;
        while self.more && self.next.time + offset <= now {
            self.present.clone_from(&self.next);
            self.taken = true;
            self.more = self.recording.next(&mut self.next)?;
        }
        if self.taken {
            for (column, signal) in &self.tape.sent {
                slots[*signal] = self.present.values[*column];
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
            kept != self.present.values[*column]
        };
        let (column, signal) = self.tape.compared.iter().find(differs)?;
        Some(Difference {
            signal: *signal,
            expected: self.present.values[*column],
            tick: self.present.number,
        })
    }
}
