//! Injected faults: wrong values of signals and trouble on the line, to test how a PLC program reacts.
//!
//! Nothing here does any I/O or reads a clock. [`Faults`] is the tick's side: it decides when each fault
//! begins and ends, and bends the slots of an exchange. [`Wires`] is the bus's side: it loses, repeats and
//! delays frames. Both share a [`Board`], on which the tick publishes what is active, so that neither waits
//! for the other. Random numbers come from a seed: the same seed gives the same run.

mod bend;
mod board;
mod cell;
mod condition;
mod fault;
mod line_fault;
mod list;
mod measure;
mod moment;
mod random;
mod ring;
mod schedule;
mod section;
mod wires;

pub use board::Board;
pub use cell::{Injected, Phase};
pub use condition::{Condition, unknown};
pub use fault::{Begin, Change, Direction, Effect, Fault, Lasts, Trouble};
pub use line_fault::LineFault;
pub use list::{Faults, Slots};
pub use moment::Moment;
pub use section::{LIMIT, read_file, read_one, read_sections};
pub use wires::{Fate, Shape, Wires};

#[cfg(test)]
mod tests;
