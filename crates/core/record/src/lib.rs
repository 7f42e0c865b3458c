//! Recordings of every tick's values, for people to read, for reports, and for replays.
//!
//! A [`Recorder`] takes whole ticks from the ticking thread through a ring that never blocks that thread, and its own
//! thread writes them to a file: VCD, which every waveform viewer opens, or CSV. A [`Recording`] reads such a file
//! back, tick by tick. A [`History`] keeps ticks in memory instead, from the same thread.

mod columns;
mod csv;
mod file;
mod history;
mod options;
mod places;
mod reading;
mod recorder;
mod rows;
mod sink;
mod tape;
mod vcd;

#[cfg(all(test, not(loom)))]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::too_many_lines,
    reason = "tests: random words, small numbers, a table of cases"
)]
mod tests;

pub use columns::{Column, Columns, Tick, ValueKind};
pub use history::{Goal, History, Moment, Span, TrendPoint};
pub use options::{FILE_SHAPE, Format, Options, When, file_of};
pub use places::FileClaim;
pub use reading::{MOST_COLUMNS, Recording, RecordingError};
pub use recorder::{Recorder, RecorderCounters, RecorderError};
pub use rows::Rows;
pub use tape::Tape;

/// The version of the layout of these files; they state it at the beginning.
const VERSION: u32 = 1;
