//! SDSP as a bus: `kind = "sdsp"` makes a simulation, or a PLC program, a client of a run on virtual time.
//!
//! A stepped bus: a step of the client is a bus cycle. This end's values are sent as the variables of the current step;
//! then the bus waits for the next step, and passes the values on that this end reads. [`Variables`] converts between
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
