//! SDSP as a bus: `kind = "sdsp"` makes a simulation, or a PLC program, a client of a run on virtual time.
//!
//! It is a stepped bus. A step of the client is a bus cycle: what this end writes is sent as the variables of the step
//! that it is in, then the bus waits for the next step, and hands in what this end reads. [`Variables`] converts between
//! the image and the variables of the run.

mod bus;
mod kind;
mod options;
mod run;
mod variables;

pub use bus::Sdsp;
pub use options::{Every, Options};
pub use run::connect;
pub use variables::Variables;
