//! Reading recordings tick by tick, in constant memory.

mod csv;
mod foreign;
mod lines;
mod vcd;

use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

use self::csv::CsvReader;
use self::foreign::ForeignReader;
pub use self::vcd::MOST_COLUMNS;
use self::vcd::VcdReader;
use super::{Columns, Format, Tick};
use tickbus_base::Mistake;
use tickbus_image::signal::SignalTable;

/// Why a recording cannot be read, or not any further.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}{}: {mistake}", line.map(|line| format!(":{line}")).unwrap_or_default())]
pub struct RecordingError {
    /// The file.
    pub file: String,
    /// The line, from 1, if a single line is at fault.
    pub line: Option<u64>,
    /// The mistake and its remedy.
    pub mistake: Mistake,
}

impl RecordingError {
    /// The file as a whole is at fault.
    pub fn of_file(path: &Path, what: impl Into<String>, right: impl Into<String>) -> Self {
        Self {
            file: path.display().to_string(),
            line: None,
            mistake: Mistake::new(what, right),
        }
    }
}

/// A mistake at the reader's current line.
#[derive(Debug)]
struct ReadError {
    mistake: Mistake,
    /// No single line is at fault.
    of_file: bool,
}

impl ReadError {
    fn new(what: impl Into<String>, right: impl Into<String>) -> Self {
        Self {
            mistake: Mistake::new(what, right),
            of_file: false,
        }
    }

    fn of_file(what: impl Into<String>, right: impl Into<String>) -> Self {
        Self {
            of_file: true,
            ..Self::new(what, right)
        }
    }

    fn io(error: &io::Error) -> Self {
        Self::new(
            format!("the recording cannot be read: {error}"),
            "check the file and the disk",
        )
    }
}

/// The remedy for a damaged recording.
const RECORD_AGAIN: &str = "record again, or take a copy that is whole";

enum Reader {
    Vcd(VcdReader<Box<dyn BufRead + Send>>),
    Csv(CsvReader<Box<dyn BufRead + Send>>),
    Foreign(ForeignReader<Box<dyn BufRead + Send>>),
}

/// A recording that is being read.
pub struct Recording {
    file: String,
    columns: Columns,
    reader: Reader,
}

impl std::fmt::Debug for Recording {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recording")
            .field("file", &self.file)
            .field("columns", &self.columns)
            .finish_non_exhaustive()
    }
}

impl Recording {
    /// Opens the recording at `path` and reads its header.
    ///
    /// A CSV file does not contain the types of its columns: `table` provides them; without it all columns
    /// are numbers.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is not a recording.
    pub fn open(path: &Path, table: Option<&SignalTable>) -> Result<Self, RecordingError> {
        let (file, format, from) = source(path)?;
        Self::read(&file, format, from, table)
    }

    /// Like [`open`](Self::open), and reads VCD of other programs as well: each time is a tick, and each variable a signal
    /// called by its scopes and name.
    ///
    /// # Errors
    ///
    /// The file cannot be read, or is neither a recording nor VCD.
    pub fn open_any(path: &Path, table: Option<&SignalTable>) -> Result<Self, RecordingError> {
        let (file, format, from) = source(path)?;
        Self::read_any(&file, format, from, table)
    }

    /// Like [`open_any`](Self::open_any), for a file from another source; errors call it `file`.
    ///
    /// # Errors
    ///
    /// The source is neither a recording nor VCD.
    pub fn read_any(
        file: &str,
        format: Format,
        mut from: Box<dyn BufRead + Send>,
        table: Option<&SignalTable>,
    ) -> Result<Self, RecordingError> {
        // A reader reports a source that cannot be read.
        let is_own = from.fill_buf().map_or(true, foreign::is_own);
        if is_own || format != Format::Vcd {
            return Self::read(file, format, from, table);
        }
        let opened = ForeignReader::open(from);
        let (reader, columns) = opened.map_err(|(fault, line)| error(file, fault, line))?;
        Ok(Self {
            file: file.to_owned(),
            columns,
            reader: Reader::Foreign(reader),
        })
    }

    /// Like [`open`](Self::open), for a recording from another source; errors call it `file`.
    ///
    /// # Errors
    ///
    /// The source is not a recording.
    pub fn read(
        file: &str,
        format: Format,
        from: Box<dyn BufRead + Send>,
        table: Option<&SignalTable>,
    ) -> Result<Self, RecordingError> {
        let placed = |(fault, line): (ReadError, u64)| error(file, fault, line);
        let (reader, columns) = match format {
            Format::Vcd => {
                let (reader, columns) = VcdReader::open(from).map_err(placed)?;
                (Reader::Vcd(reader), columns)
            }
            Format::Csv => {
                let (reader, columns) = CsvReader::open(from, table).map_err(placed)?;
                (Reader::Csv(reader), columns)
            }
        };
        Ok(Self {
            file: file.to_owned(),
            columns,
            reader,
        })
    }

    /// The contents of every tick.
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// Reads the next tick into `tick`, which must have been made for these columns and must hold the
    /// previous tick; false at the end.
    ///
    /// # Errors
    ///
    /// The file's next part is not a tick.
    pub fn next(&mut self, tick: &mut Tick) -> Result<bool, RecordingError> {
        let (read, line) = match &mut self.reader {
            Reader::Vcd(reader) => (reader.next(tick), reader.line()),
            Reader::Csv(reader) => (reader.next(tick, &self.columns), reader.line()),
            Reader::Foreign(reader) => (reader.next(tick), reader.line()),
        };
        read.map_err(|fault| error(&self.file, fault, line))
    }

    /// Why the recording ends at its last tick, as far as known, once it has ended: the recorder's last comment, or
    /// that it was truncated.
    pub fn ending(&self) -> String {
        match &self.reader {
            Reader::Vcd(reader) => reader.ending(),
            Reader::Csv(reader) => reader.ending(),
            Reader::Foreign(_) => "the file has no more times".to_owned(),
        }
    }

    /// True if the recording ends without an end mark, as after a power failure: known once it has ended, and in a CSV
    /// file only if the cut is within a line.
    pub fn is_cut(&self) -> bool {
        match &self.reader {
            Reader::Vcd(reader) => reader.is_cut(),
            Reader::Csv(reader) => reader.is_cut(),
            Reader::Foreign(_) => false,
        }
    }
}

/// Opens a file: its name for errors, and its format.
fn source(path: &Path) -> Result<(String, Format, Box<dyn BufRead + Send>), RecordingError> {
    let format = Format::of(path)
        .map_err(|Mistake { what, right }| RecordingError::of_file(path, what, right))?;
    let opened = File::open(path).and_then(|file| {
        if file.metadata()?.is_dir() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        Ok(file)
    });
    let opened = opened.map_err(|error| {
        RecordingError::of_file(
            path,
            format!("the recording cannot be read: {error}"),
            "check the path and the name",
        )
    })?;
    let from = Box::new(BufReader::with_capacity(1 << 16, opened));
    Ok((path.display().to_string(), format, from))
}

fn error(file: &str, fault: ReadError, line: u64) -> RecordingError {
    RecordingError {
        file: file.to_owned(),
        line: (!fault.of_file).then_some(line),
        mistake: fault.mistake,
    }
}
