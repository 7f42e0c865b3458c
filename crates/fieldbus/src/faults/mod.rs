//! Faults that are asked for: wrong values of signals and troubles of the line, to see what a PLC program
//! makes of them.
//!
//! Nothing here does any I/O or reads a clock. [`Faults`] is the tick's side: it knows when each fault begins
//! and ends, and bends the slots of an exchange. [`Wires`] is the bus's side: it loses, repeats and holds back
//! frames. Both share a [`Board`], on which the tick says what is active, so that neither waits for the other.
//! What is left to chance comes from a seed: the same seed gives the same run.

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
