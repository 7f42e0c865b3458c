//! Injected faults: wrong values of signals and trouble on the line, to test how a PLC program reacts.
//!
//! Nothing here does any I/O or reads a clock. [`Faults`] is the tick's side, which decides when each fault begins and
//! ends, and changes the slots of an exchange. [`LineFaults`] is the bus's side, which loses, repeats and delays
//! frames. Both share a [`FaultBoard`], on which the tick publishes the active faults, so that neither waits for the
//! other. Random numbers come from a seed: the same seed gives the same run.

mod answer;
mod board;
mod cell;
mod condition;
mod diagnosis;
mod fault;
mod line_fault;
mod line_faults;
mod list;
mod measure;
mod models;
mod notes;
mod random;
mod ring;
mod schedule;
mod section;
mod signal_fault;
mod tick_time;

pub use answer::{
    AnswerCodes, AnswerEffect, AnswerTrouble, Elements, Request, Spoilt, WrongAnswer,
};
pub use board::FaultBoard;
pub use cell::{FaultStatus, Phase};
pub use condition::{Condition, unknown};
pub use diagnosis::{AlarmKind, ChannelError, Diagnosis, Finding, Octets};
pub use fault::{Begin, Direction, Effect, Fault, Lasts, LineEffect, SignalEffect};
pub use line_fault::LineFault;
pub use line_faults::{Fate, LineFaults, Shape, Taken};
pub use list::{Faults, Prepared, Retired, Slots};
pub use notes::Note;
pub use random::Random;
pub use section::{
    FAULT_KEYS, FAULT_KINDS, FORMER_FAULT_KINDS, LIMIT, Scope, model_value, read_file, read_one,
    read_sections,
};
pub use signal_fault::between;
pub use tick_time::TickTime;

#[cfg(test)]
mod tests;
