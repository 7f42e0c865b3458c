//! A small controller, of the kind of the Siemens LOGO!: its program is a plan of function blocks, in a file.
//!
//! A [`Program`] is read from TOML; docs/virtual-lab.md has the format and every block. A [`Controller`] runs it: inputs
//! and time in, outputs and the time of the next change out. It does no I/O and reads no clock.

mod block;
mod controller;
mod program;
mod week;
mod wires;

pub use controller::Controller;
pub use program::Program;
pub use week::WallTime;
pub use wires::Terminals;
