//! Recordings: what every tick saw, for people, for reports, and to be replayed.
//!
//! A [`Recorder`] takes whole ticks from the thread that ticks, through a ring that never makes it wait,
//! and a thread of its own writes them to a file: VCD, which every waveform viewer opens, or CSV. A
//! [`Recording`] reads such a file again, tick by tick.

mod columns;
mod csv;
mod file;
mod options;
mod places;
mod reading;
mod recorder;
mod vcd;

#[cfg(all(test, not(loom)))]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::too_many_lines,
    reason = "tests: random words, small numbers, a table of cases"
)]
mod tests;

pub use columns::{Column, Columns, Kind, Tick};
pub use options::{Format, Options, When, file_of};
pub use places::Place;
pub use reading::{Recording, RecordingError};
pub use recorder::{Recorder, RecorderError, Tally};

/// The version of the files' own layout, which stands at their beginning.
const VERSION: u32 = 1;
