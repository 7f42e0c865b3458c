//! Injected faults: wrong values of signals and trouble on the line, to test how a PLC program reacts.
//!
//! Nothing here does any I/O or reads a clock. [`Faults`] is the tick's side: it decides when each fault
//! begins and ends, and bends the slots of an exchange. [`Wires`] is the bus's side: it loses, repeats and
//! delays frames. Both share a [`Board`], on which the tick publishes what is active, so that neither waits
//! for the other. Random numbers come from a seed: the same seed gives the same run.

mod bend;
mod board;
mod condition;
mod fault;
mod list;
mod measure;
mod random;
mod ring;
mod schedule;
mod section;
mod wires;

pub use board::{Board, Injected, Phase};
pub use condition::{Condition, unknown};
pub use fault::{Begin, Change, Direction, Effect, Fault, Lasts, Trouble};
pub use list::{Faults, Moment, Slots};
pub use section::{LIMIT, read_file, read_one, read_sections};
pub use wires::{Fate, LineFault, Shape, Wires};

#[cfg(test)]
mod tests;
